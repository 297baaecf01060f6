"""Which faults stand: each is latched and logged once when it appears, and stays until it has been acknowledged.

What has a fault is isolated. It stays so for ISOLATION_MS at least, from its newest fault on: an acknowledgement that comes
earlier counts, and takes effect when that time is over. So a host that acknowledges all the time cannot disarm the
fault monitor, whatever its pace.
"""

from array import array

from bubble_firmware.device_clock import ticks_diff
from bubble_firmware.safety.fault_log import FaultLog
from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from types import ModuleType

    from bubble_firmware.control.bubbles import Bubbles
    from bubble_firmware.control.supply import Supply
    from bubble_firmware.device_clock import DeviceClock
    from bubble_firmware.safety.fault_monitor import FaultMonitor

# [constants] bubble_protocol.schema.faults: BOARD ESTOP ISOLATION_MS
_BOARD = const(255)
_ESTOP = const(1)
_ISOLATION_MS = const(1000)
# [end of constants]


class LatchedFaults:
    """`board`: faults of the board as a whole, bits; those of each bubble stand with the bubble. `log`: what has happened.

    `waiting`: for how many more ticks something that is acknowledged stays isolated; call `release` in every tick while
    there are any. The log's value of a bubble's fault is the bubble's pressure, of a board's fault the reservoir's.
    """

    def __init__(
        self, board: "ModuleType", clock: "DeviceClock", supply: "Supply", bubbles: "Bubbles", monitor: "FaultMonitor"
    ):
        self.board = 0
        self.waiting = 0
        self.log = FaultLog()
        self._isolation = -(-_ISOLATION_MS * 1000 // board.TICK_US)  # ticks
        self._clock = clock
        self._supply = supply
        self._bubbles = bubbles
        self._monitor = monitor
        self._board_id = 0  # of the board's newest entry
        self._board_since = 0  # the tick of it
        self._bubble_ids = array("i", bytearray(4 * bubbles.count))  # of each bubble's
        self._bubble_since = array("i", bytearray(4 * bubbles.count))

    def latch_board(self, bits: int) -> None:
        """The board has these faults: log those that are new."""
        new = bits & ~self.board
        if bits & _ESTOP and self._board_id <= self.log.acknowledged:  # pressed again, before it was released
            new |= _ESTOP
        self.board |= bits
        bit = 1
        while new:
            if new & 1:
                self._board_id = self.note(bit, self._supply.pressure_pa)
                self._board_since = self._clock.ticks
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
                    self._bubble_since[bubble] = ticks
                new >>= 1
                bit <<= 1

    def note(self, what: int, value: int) -> int:
        """Log what has happened to the board as a whole; the entry's id."""
        return self.log.add(self._clock.ticks, what, _BOARD, value)

    def acknowledge(self, up_to: int, pressed: int) -> None:
        """Acknowledge the log up to this entry; call `release` then.

        While the emergency stop is `pressed` its entry cannot be acknowledged, nor what has come after it.
        """
        if pressed and up_to >= self._board_id:
            up_to = self._board_id - 1
        self.log.acknowledge(up_to)

    def release(self) -> bool:
        """Forget faults without a later entry than the one acknowledged, where isolation has lasted; what still is wrong
        faults again. Whether that includes the board's.
        """
        acknowledged = self.log.acknowledged
        bubbles = self._bubbles
        ids = self._bubble_ids
        waiting = 0
        for bubble in range(bubbles.count):
            if ids[bubble] <= acknowledged and bubbles.faults(bubble):
                left = self._left(self._bubble_since[bubble])
                if left <= 0:
                    bubbles.clear_faults(bubble)
                    self._monitor.acknowledge(bubble)
                elif left > waiting:
                    waiting = left
        released = False
        if self.board and self._board_id <= acknowledged:
            left = self._left(self._board_since)
            if left <= 0:
                self.board = 0
                released = True
            elif left > waiting:
                waiting = left
        self.waiting = waiting
        return released

    def _left(self, since: int) -> int:
        ticks = ticks_diff(self._clock.ticks, since)
        return self._isolation - ticks if ticks >= 0 else 0  # it has lasted for longer than differences of ticks reach
