"""TCA9548A: one I2C bus to eight (Texas Instruments SCPS207, section 8.5): its one register has a bit per channel.

`bus` is a `machine.I2C`, which raises OSError when a chip does not answer.
"""

from bubble_protocol.mpy_compat import TYPE_CHECKING

if TYPE_CHECKING:
    from machine import I2C


class Tca9548a:
    """The switch at `address`. `missing`: it did not answer the last time."""

    def __init__(self, bus: "I2C", address: int = 0x70):
        self.missing = False
        self._bus = bus
        self._address = address
        self._mask = bytearray(1)

    def select(self, mask: int) -> bool:
        """Connect the channels whose bits are set in `mask`; says whether the switch has answered."""
        self._mask[0] = mask
        try:
            self._bus.writeto(self._address, self._mask)
            self.missing = False
        except OSError:
            self.missing = True
        return not self.missing
