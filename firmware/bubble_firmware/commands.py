"""What changes the board as a whole, whoever asks for it: the host, a sequence, or something that has gone wrong.

Each command ends what others had begun and brings mode, bubbles, self-test and sequence to where they belong together.
"""

from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from array import array
    from types import ModuleType

    from bubble_firmware.board_state import BoardState
    from bubble_firmware.control.bubbles import Bubbles
    from bubble_firmware.hal.base import Hal
    from bubble_firmware.sequence.player import Player

# [constants] bubble_protocol.steps: STOP as THEN_STOP VENT as THEN_VENT
# [constants] bubble_protocol.schema.faults: ESTOP EXCEPTION HOST_SILENT SUPPLY_LOST VENTING
# [constants] bubble_protocol.schema.modes: ACTIVE HOLDING
# [constants] bubble_firmware.safety.state: SHOW as EVENT_SHOW STOP as EVENT_STOP VENT as EVENT_VENT
# [constants] bubble_firmware.safety.state: CLEAR as EVENT_CLEAR ESTOP as EVENT_ESTOP
# [constants] bubble_firmware.safety.state: BOARD_FAULT as EVENT_BOARD_FAULT EXCEPTION as EVENT_EXCEPTION
_THEN_STOP = const(3)
_THEN_VENT = const(2)
_ESTOP = const(1)
_EXCEPTION = const(16)
_HOST_SILENT = const(256)
_SUPPLY_LOST = const(2)
_VENTING = const(135)
_ACTIVE = const(1)
_HOLDING = const(2)
_EVENT_SHOW = const(1)
_EVENT_STOP = const(2)
_EVENT_VENT = const(3)
_EVENT_CLEAR = const(10)
_EVENT_ESTOP = const(9)
_EVENT_BOARD_FAULT = const(8)
_EVENT_EXCEPTION = const(7)
# [end of constants]


class Commands:
    """Commands to the board whose state is `state`."""

    def __init__(self, board: "ModuleType", hal: "Hal", state: "BoardState", bubbles: "Bubbles", player: "Player"):
        self._tick_us = board.TICK_US
        self._hal = hal
        self._clock = state.clock
        self._supply = state.supply
        self._self_test = state.self_test
        self._safety = state.safety
        self._deadman = state.deadman
        self._faults = state.faults
        self._bubbles = bubbles
        self._player = player

    # What is asked for.

    def show(self, values: "array[int]", first: int, over_ms: int) -> None:
        """Take the shape whose heights (µm) stand in `values[first:]`, in `over_ms`."""
        self._self_test.skip()
        self._player.cancel()
        self._safety.handle(_EVENT_SHOW)
        if self._safety.mode == _ACTIVE:
            ticks = over_ms * 1000 // self._tick_us
            self._bubbles.set_targets(values, first, ticks if ticks > 1 else 1)

    def stop(self) -> None:
        """Close all valves and keep the air, unless a fault of the board keeps the vents open."""
        self._self_test.skip()
        self._player.cancel()
        self._safety.handle(_EVENT_STOP)
        if self._safety.mode == _HOLDING:
            self._bubbles.hold_position()

    def vent(self) -> None:
        """Open all vent valves until the next `show`."""
        self._player.cancel()
        self._safety.handle(_EVENT_VENT)
        self._bubbles.retract()

    def acknowledge(self, up_to: int) -> None:
        """Acknowledge the fault log up to this entry: faults that still are there come again."""
        self._faults.acknowledge(up_to, self._hal.active_faults & _ESTOP)
        self.release()

    def release(self) -> None:
        """Let go on what is acknowledged and has been isolated for long enough."""
        if self._faults.release():
            self._hal.clear_faults()
            self._safety.handle(_EVENT_CLEAR)

    def restart(self, into: int) -> None:
        """Vent and start again."""
        self.vent()
        self._hal.safe_outputs()
        self._hal.restart(into)

    # What has gone wrong.

    def fault(self, bits: int) -> None:
        """The board has these faults, and a lost supply where it is: those that forbid pressure vent all bubbles."""
        if self._supply.lost:
            bits |= _SUPPLY_LOST
        self._faults.latch_board(bits)
        if bits & _VENTING:
            self._hal.safe_outputs()
            self._self_test.skip()
            self._player.cancel()
            if self._safety.handle(_EVENT_ESTOP if bits & _ESTOP else _EVENT_BOARD_FAULT):
                self._bubbles.retract()

    def host_silent(self, event: int) -> None:
        """The host has been silent for too long, HOST_QUIET or HOST_SILENT: hold what moves, or vent."""
        if self._safety.handle(event):
            self._player.cancel()
            self._faults.note(_HOST_SILENT, self._deadman.silent_ticks * (self._tick_us // 1000))
            if self._safety.mode == _HOLDING:
                self._bubbles.hold_position()
            else:
                self._bubbles.retract()

    def finish(self, then: int) -> None:
        """A sequence has ended at a step that did not settle, and wants this done; GO_ON: it has not."""
        if then == _THEN_VENT:
            self.vent()
        elif then == _THEN_STOP:
            self.stop()

    def fail(self) -> None:
        """An exception has ended the tick: vent."""
        self._hal.safe_outputs()  # first of all
        self._faults.latch_board(_EXCEPTION)
        self._safety.handle(_EVENT_EXCEPTION)
        self._player.cancel()
        self._bubbles.retract()
