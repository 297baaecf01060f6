"""What there is to know about the board as a whole."""

from bubble_firmware.control.supply import Supply
from bubble_firmware.device_clock import DeviceClock
from bubble_firmware.safety.deadman import Deadman
from bubble_firmware.safety.fault_monitor import FaultMonitor
from bubble_firmware.safety.latched_faults import LatchedFaults
from bubble_firmware.safety.self_test import SelfTest
from bubble_firmware.safety.state import SafetyState
from bubble_protocol.mpy_compat import TYPE_CHECKING

if TYPE_CHECKING:
    from types import ModuleType

    from bubble_firmware.control.bubbles import Bubbles
    from bubble_firmware.hal.base import Hal


class BoardState:
    """The board's time, supply, mode, faults, deadman and self-test, each an object that changes itself."""

    def __init__(self, board: "ModuleType", hal: "Hal", bubbles: "Bubbles"):
        self.clock = DeviceClock(hal.boot_ticks)
        self.supply = Supply(board)
        self.self_test = SelfTest(board, hal.self_test)
        self.safety = SafetyState(board)
        self.deadman = Deadman(board)
        self.fault_monitor = FaultMonitor(board, bubbles)
        self.faults = LatchedFaults(board, self.clock, self.supply, bubbles, self.fault_monitor)
