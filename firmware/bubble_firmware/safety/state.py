"""What the board as a whole may do: one state, and one table of transitions.

Every change of the board's state is here. `App` tells what has happened (`handle`), and does what the state it
gets demands. docs/safety.md has the drawing, made from this table.
"""

from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from types import ModuleType

# [constants] bubble_protocol.schema.modes: ACTIVE BOOT FAULTED HOLDING IDLE STOPPED VENTING
_ACTIVE = const(1)
_BOOT = const(3)
_FAULTED = const(5)
_HOLDING = const(2)
_IDLE = const(0)
_STOPPED = const(6)
_VENTING = const(4)
# [end of constants]

# Events.
NO_EVENT = -1
TESTED, SHOW, STOP, VENT, DEPRESSURISED, HOST_QUIET, HOST_SILENT, EXCEPTION, BOARD_FAULT, ESTOP, CLEAR = range(11)

STATES = const(7)
# For each event, the state that follows IDLE, ACTIVE, HOLDING, BOOT, VENTING, FAULTED, STOPPED.
_I, _A, _H, _B, _V, _F, _S = _IDLE, _ACTIVE, _HOLDING, _BOOT, _VENTING, _FAULTED, _STOPPED
_TABLE = bytes(
    (_I, _A, _H, _I, _V, _F, _S)  # TESTED
    + (_A, _A, _A, _A, _A, _F, _S)  # SHOW
    + (_H, _H, _H, _H, _H, _F, _S)  # STOP: where the vents must stay open it closes nothing
    + (_I, _V, _V, _V, _V, _F, _S)  # VENT
    + (_I, _A, _H, _B, _I, _F, _S)  # DEPRESSURISED
    + (_I, _H, _H, _B, _V, _F, _S)  # HOST_QUIET
    + (_I, _V, _V, _B, _V, _F, _S)  # HOST_SILENT
    + (_V, _V, _V, _V, _V, _F, _S)  # EXCEPTION
    + (_F, _F, _F, _F, _F, _F, _S)  # BOARD_FAULT
    + (_S, _S, _S, _S, _S, _S, _S)  # ESTOP
    + (_I, _A, _H, _B, _V, _V, _V)  # CLEAR
)
# What control is to do in each state, see `control.state_layout`: open the vents (0), follow (1), keep all closed (2).
_CONTROL_MODES = bytes((0, 1, 2, 0, 0, 0, 0))

_VENTING_US = const(2000000)  # a full bubble is empty in half a second: what is not empty by then will not be


class SafetyState:
    """`mode` is the state of the board, one of MODES; `handle` changes it.

    `control_mode`: what control is to do, 0 open the vents, 1 follow the setpoints, 2 keep all valves closed.
    """

    def __init__(self, board: "ModuleType"):
        self.mode = _BOOT
        self.control_mode = _CONTROL_MODES[_BOOT]
        self._venting_max = _VENTING_US // board.TICK_US
        self._venting_ticks = 0

    def handle(self, event: int) -> bool:
        """Something has happened: the state follows the table. Returns whether it has changed."""
        mode = _TABLE[event * STATES + self.mode]
        if mode == self.mode:
            return False
        self.mode = mode
        self.control_mode = _CONTROL_MODES[mode]
        self._venting_ticks = 0
        return True

    def update_venting(self, pressed: int) -> None:
        """One tick of VENTING on the way to IDLE: there, when no bubble is `pressed` any longer or it has taken too long."""
        self._venting_ticks += 1
        if not pressed or self._venting_ticks >= self._venting_max:
            self.handle(DEPRESSURISED)
