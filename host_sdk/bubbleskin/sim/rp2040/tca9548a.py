"""TCA9548A, as seen from its pins: a switch between one I2C bus and eight (Texas Instruments SCPS207)."""

from bubbleskin.sim.rp2040.bus import I2cChip


class Tca9548a(I2cChip):
    """A switch at `address`. Its one register has a bit for each of the eight buses behind it that is joined."""

    def __init__(self, address: int = 0x70):
        self.silent = False
        self.joined = 0
        self._address = address
        self._behind: list[tuple[int, I2cChip]] = []
        self._active: list[I2cChip] = []
        self._self = False
        self._written: int | None = None

    def add(self, channel: int, device: I2cChip) -> None:
        """Solder `device` to bus `channel`, 0 to 7."""
        self._behind.append((channel, device))

    def start(self, address: int, read: bool) -> bool:
        """Its own address, or one on a bus that is joined."""
        if self.silent:
            return False
        self._self = address == self._address
        self._active = [
            device for channel, device in self._behind if self.joined >> channel & 1 and device.start(address, read)
        ]
        return self._self or bool(self._active)

    def write(self, byte: int) -> bool:
        """The register, or a byte for what is behind."""
        taken = [device.write(byte) for device in self._active]
        if self._self:
            self._written = byte
        return self._self or any(taken)

    def read(self) -> int:
        """The register, or what comes from behind."""
        value = self.joined if self._self else 0xFF
        for device in self._active:
            value &= device.read()
        return value

    def stop(self) -> None:
        """The buses are switched when the transfer is over."""
        for device in self._active:
            device.stop()
        self._active = []
        if self._written is not None:
            self.joined, self._written = self._written, None
