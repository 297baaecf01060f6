"""Which faults stand: each is latched and logged once when it appears, and stays until it has been acknowledged."""

from array import array

from bubble_firmware.safety.fault_log import FaultLog
from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from bubble_firmware.control.bubbles import Bubbles
    from bubble_firmware.control.supply import Supply
    from bubble_firmware.device_clock import DeviceClock
    from bubble_firmware.safety.fault_monitor import FaultMonitor

# [constants] bubble_protocol.schema.faults: BOARD
_BOARD = const(255)
# [end of constants]


class LatchedFaults:
    """`board`: faults of the board as a whole, bits; those of each bubble stand with the bubble. `log`: what has happened.

    The log's value of a bubble's fault is the bubble's pressure, of a board's fault the reservoir's.
    """

    def __init__(self, clock: "DeviceClock", supply: "Supply", bubbles: "Bubbles", monitor: "FaultMonitor"):
        self.board = 0
        self.log = FaultLog()
        self._clock = clock
        self._supply = supply
        self._bubbles = bubbles
        self._monitor = monitor
        self._board_id = 0  # of the board's newest entry
        self._bubble_ids = array("i", bytearray(4 * bubbles.count))  # of each bubble's

    def latch_board(self, bits: int) -> None:
        """The board has these faults: log those that are new."""
        new = bits & ~self.board
        self.board |= bits
        bit = 1
        while new:
            if new & 1:
                self._board_id = self.note(bit, self._supply.pressure_pa)
            new >>= 1
            bit <<= 1

    def latch_bubbles(self) -> None:
        """The monitor has found new faults of bubbles: log them."""
        bubbles = self._bubbles
        ticks = self._clock.ticks
        for bubble in range(bubbles.count):
            new = self._monitor.take_new_faults(bubble)
            bit = 1
            while new:
                if new & 1:
                    self._bubble_ids[bubble] = self.log.add(ticks, bit, bubble, bubbles.pressure_pa(bubble))
                new >>= 1
                bit <<= 1

    def note(self, what: int, value: int) -> int:
        """Log what has happened to the board as a whole; the entry's id."""
        return self.log.add(self._clock.ticks, what, _BOARD, value)

    def acknowledge(self, up_to: int) -> bool:
        """Acknowledge the log up to this entry and forget faults without a later one; whether that includes the board's.

        What still is wrong faults again.
        """
        self.log.acknowledge(up_to)
        for bubble in range(self._bubbles.count):
            if self._bubble_ids[bubble] <= up_to:
                self._bubbles.clear_faults(bubble)
                self._monitor.acknowledge(bubble)
        if self._board_id > up_to:
            return False
        self.board = 0
        self._supply.clear()
        return True
