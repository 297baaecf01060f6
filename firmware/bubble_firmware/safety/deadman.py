"""The deadman: how long the host has been silent, and what follows from it.

A host that lives says so; what moves while nobody speaks is held after one time of silence, and everything is vented after
another. Both are settings.
"""

from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from types import ModuleType

# [constants] bubble_protocol.schema.modes: ACTIVE HOLDING
# [constants] bubble_firmware.safety.state: HOST_QUIET HOST_SILENT NO_EVENT
_ACTIVE = const(1)
_HOLDING = const(2)
_HOST_QUIET = const(5)
_HOST_SILENT = const(6)
_NO_EVENT = const(-1)
# [end of constants]

_SILENT_MAX = const(1 << 24)  # ticks of silence counted


class Deadman:
    """`silent_ticks`: since the host's last valid frame. `tick` counts them and returns the event they make."""

    def __init__(self, board: "ModuleType"):
        self.silent_ticks = 0
        self._tick_us = board.TICK_US
        self._hold_ticks = 1
        self._vent_ticks = 1

    def configure(self, hold_ms: int, vent_ms: int) -> None:
        """After how much silence of the host what moves is held, and everything is vented."""
        self._hold_ticks = self._ticks(hold_ms)
        self._vent_ticks = self._ticks(vent_ms)

    def host_activity(self) -> None:
        """A valid frame of the host's has come."""
        self.silent_ticks = 0

    def tick(self, mode: int, moving: int) -> int:
        """Count one tick of silence; the event that this makes for a board in state `mode`, or NO_EVENT."""
        silent = self.silent_ticks
        if silent < _SILENT_MAX:
            self.silent_ticks = silent = silent + 1
        if mode != _ACTIVE and mode != _HOLDING:
            return _NO_EVENT
        if silent >= self._vent_ticks:
            return _HOST_SILENT
        if moving and mode == _ACTIVE and silent >= self._hold_ticks:
            return _HOST_QUIET
        return _NO_EVENT

    def _ticks(self, ms: int) -> int:
        """Whole ticks, at least one."""
        ticks = ms * 1000 // self._tick_us
        return ticks if ticks > 1 else 1
