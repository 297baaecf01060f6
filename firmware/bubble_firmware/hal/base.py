"""The hardware of a board as the firmware sees it: one base class, which every board and whatever stands in for one inherits."""

from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from array import array
    from types import ModuleType
    from typing import Protocol

    class Flash(Protocol):
        """Where the store is: see `bubble_firmware.drivers.flash`."""

        size: int

        def read(self, offset: int, page: bytearray) -> None:
            """Fill `page` with what stands at `offset`."""

        def erase(self, offset: int) -> None:
            """Set all bits of the sector at `offset`."""

        def program(self, offset: int, page: bytearray) -> None:
            """Clear the bits of the page at `offset` that are clear in `page`."""


LISTEN = const(-1)
"""What `Hal.wait` returns between two ticks, when there is time for a look at the link."""

ABSENT = const(0xFFFF)
"""What `Hal.read_sensors` puts in place of a count where no chip has answered."""


class Hal:
    """The hardware of `board`; as it stands here, a board at rest with nobody at the other end of its link.

    `boot_ticks`: device time before the first tick.
    `boot_id`: another number each boot. `late_ticks`: ticks that began late. `active_faults`: faults of the board that
    are there now, as bits, found by `read_sensors`. `boot_faults`: those of the time before this boot. `self_test`:
    whether there are valves and sensors to test. `flash`: where the store is, None where there is none.

    In each period the firmware calls `read_sensors`, then `write_outputs`, then `feed_watchdog`, then `receive` and `send`.
    None of these may allocate memory. An exception out of any of them vents the board.
    """

    boot_id = 1
    boot_ticks = -1
    late_ticks = 0
    active_faults = 0
    boot_faults = 0
    self_test = False
    flash: "Flash | None" = None

    def __init__(self, board: "ModuleType"):
        self.board = board
        self._noise = 0

    # Time.

    def wait(self) -> int:
        """Sleep until the next period has begun: how many have begun since the last call.

        LISTEN: none has, but something has come over the link. 0: there will be no more periods.
        """
        return 0

    def phase_us(self) -> int:
        """µs since this period began."""
        return 0

    # Sensors and valves.

    def read_sensors(self, counts: "array[int]") -> None:
        """Fill in one count for each bubble, then the supply's; ABSENT where no chip answers."""
        board = self.board
        self._noise ^= 1  # a sensor without any is not believed
        for index in range(board.BUBBLES):
            counts[index] = board.SENSOR_ZERO + self._noise
        counts[board.BUBBLES] = board.SUPPLY_ZERO + board.SUPPLY_PA // board.SUPPLY_PA_PER_COUNT + self._noise

    def write_outputs(self, pulses: "array[int]", pump: int, dump: int) -> None:
        """Set what the next period does.

        `pulses`: fill and vent µs of each bubble in turn. `pump`: its duty, 0 to 65535. `dump`: whether the reservoir is
        emptied.
        """

    def safe_outputs(self) -> None:
        """Close every fill valve, open every vent valve, stop the pump: at once, whatever else is under way."""

    def clear_faults(self) -> None:
        """Try again what has failed: the host has acknowledged it."""

    # Watchdog and time to spare.

    def feed_watchdog(self, mode: int, faults: int) -> None:
        """The board has been controlled in this period; show its mode and its faults, bits, to whoever looks at it."""

    def allow_overrun(self) -> None:
        """This tick may take longer than its period and harm nobody: the bubbles are vented."""

    def idle(self) -> None:
        """Make use of a moment in which nothing is urgent."""

    # Link.

    def receive(self, buffer: bytearray) -> int:
        """Put bytes that have come over the link in `buffer`, without waiting for any: how many."""
        return 0

    def send(self, frame: bytearray, length: int) -> bool:
        """Send `frame[:length]`. False, and nothing of it is sent, where there is no room for the whole."""
        return True

    def restart(self, into: int) -> None:
        """Start again, into what RESTART names; the outputs are safe."""
