"""What the board as a whole may do: one state, one table of transitions, and the deadman that watches the host.

Every change of the board's state is here. `App` tells what has happened (`take`), and does what the state it
gets demands. docs/safety.md has the drawing, made from this table.
"""

from bubble_protocol.mpy_compat import const
from bubble_protocol.schema.modes import ACTIVE, BOOT, FAULTED, HOLDING, IDLE, STOPPED, VENTING

# Events.
NOTHING = -1
TESTED, SHOW, STOP, VENT, FLAT, QUIET, SILENT, FAILED, FAULT, ESTOP, CLEAR = range(11)
EVENTS = (
    (TESTED, "self-test over"),
    (SHOW, "SHOW"),
    (STOP, "STOP"),
    (VENT, "VENT"),
    (FLAT, "no pressure left"),
    (QUIET, "host silent, moving"),
    (SILENT, "host silent for long"),
    (FAILED, "exception"),
    (FAULT, "fault of the board"),
    (ESTOP, "emergency stop"),
    (CLEAR, "CLEAR"),
)

STATES = const(7)
# For each event, the state that follows IDLE, ACTIVE, HOLDING, BOOT, VENTING, FAULTED, STOPPED.
_I, _A, _H, _B, _V, _F, _S = IDLE, ACTIVE, HOLDING, BOOT, VENTING, FAULTED, STOPPED
_TABLE = bytes(
    (_I, _A, _H, _I, _V, _F, _S)  # TESTED
    + (_A, _A, _A, _A, _A, _F, _S)  # SHOW
    + (_H, _H, _H, _H, _H, _F, _S)  # STOP: where the vents must stay open it closes nothing
    + (_I, _V, _V, _V, _V, _F, _S)  # VENT
    + (_I, _A, _H, _B, _I, _F, _S)  # FLAT
    + (_I, _H, _H, _B, _V, _F, _S)  # QUIET
    + (_I, _V, _V, _B, _V, _F, _S)  # SILENT
    + (_V, _V, _V, _V, _V, _F, _S)  # FAILED
    + (_F, _F, _F, _F, _F, _F, _S)  # FAULT
    + (_S, _S, _S, _S, _S, _S, _S)  # ESTOP
    + (_I, _A, _H, _B, _V, _V, _V)  # CLEAR
)
# What control is to do in each state: vent (0), control (1) or keep all valves closed (2).
_DRIVE = bytes((0, 1, 2, 0, 0, 0, 0))

_FLAT_US = const(2000000)  # a full bubble is empty in half a second: what is not flat by then will not be
_SILENT_MAX = const(1 << 24)  # ticks of silence counted


class Safety:
    """`mode` is the state of the board; `take` changes it. `silent`: ticks since the host was heard."""

    def __init__(self, board):
        self.mode = BOOT
        self.silent = 0
        self.hold_ticks = 1
        self.vent_ticks = 1
        self._tick_us = board.TICK_US
        self._patience = _FLAT_US // board.TICK_US
        self._venting = 0

    @property
    def drive(self):
        """What control is to do: 0 vent, 1 control, 2 keep all valves closed."""
        return _DRIVE[self.mode]

    def take(self, event):
        """Something has happened: the state follows the table. Returns whether it has changed."""
        mode = _TABLE[event * STATES + self.mode]
        if mode == self.mode:
            return False
        self.mode = mode
        self._venting = 0
        return True

    def set_deadman(self, hold_ms, vent_ms):
        """After how much silence of the host what moves is held, and everything is vented."""
        self.hold_ticks = _ticks(hold_ms, self._tick_us)
        self.vent_ticks = _ticks(vent_ms, self._tick_us)

    def heard(self):
        """A valid frame of the host's has come."""
        self.silent = 0

    def watch(self, moving):
        """Count one tick of silence; the event that this makes, or NOTHING."""
        silent = self.silent
        if silent < _SILENT_MAX:
            self.silent = silent = silent + 1
        mode = self.mode
        if mode != ACTIVE and mode != HOLDING:
            return NOTHING
        if silent >= self.vent_ticks:
            return SILENT
        if moving and mode == ACTIVE and silent >= self.hold_ticks:
            return QUIET
        return NOTHING

    def settle(self, pressed):
        """One tick on the way to IDLE: there, when no bubble is `pressed` any longer or it has taken too long."""
        if self.mode == VENTING:
            self._venting += 1
            if not pressed or self._venting >= self._patience:
                self.take(FLAT)


def _ticks(ms, tick_us):
    """Whole ticks, at least one."""
    ticks = ms * 1000 // tick_us
    return ticks if ticks > 1 else 1
