"""The tick: what the firmware does in every period, and in what order.

Whatever goes wrong in it, the bubbles are vented and the next tick is tried. It allocates nothing: a collection takes longer
than a tick.
"""

from array import array

from bubble_firmware.board_state import BoardState
from bubble_firmware.commands import Commands
from bubble_firmware.control.bubbles import Bubbles
from bubble_firmware.control.table import Tables
from bubble_firmware.control.trim import Trim
from bubble_firmware.handlers.faults import FaultHandlers
from bubble_firmware.handlers.inject import InjectHandlers
from bubble_firmware.handlers.layout import LayoutHandlers
from bubble_firmware.handlers.sequence import SequenceHandlers
from bubble_firmware.handlers.session import SessionHandlers
from bubble_firmware.handlers.settings import SettingHandlers
from bubble_firmware.handlers.shape import ShapeHandlers
from bubble_firmware.handlers.store import StoreHandlers
from bubble_firmware.handlers.system import SystemHandlers
from bubble_firmware.handlers.tables import TableHandlers
from bubble_firmware.handlers.trim import TrimHandlers
from bubble_firmware.link.server import Server
from bubble_firmware.sequence.player import Player
from bubble_firmware.store.record import Content
from bubble_firmware.store.settings import Settings
from bubble_firmware.store.slots import Store
from bubble_firmware.tick_stats import TickStats
from bubble_protocol.mpy_compat import TYPE_CHECKING, collect, const

if TYPE_CHECKING:
    from types import ModuleType

    from bubble_firmware.hal.base import Hal

# [constants] bubble_protocol.schema.faults: OVERFILLED SELF_TEST SHUTTING
# [constants] bubble_protocol.schema.modes: BOOT IDLE VENTING
# [constants] bubble_firmware.safety.state: NO_EVENT TESTED as EVENT_TESTED
# [constants] bubble_firmware.safety.watch_layout: NEW_FAULT MOVING_BUBBLE PRESSED_BUBBLE OVERFILLED_BUBBLE
_OVERFILLED = const(128)
_SELF_TEST = const(64)
_SHUTTING = const(130)
_BOOT = const(3)
_IDLE = const(0)
_VENTING = const(4)
_NO_EVENT = const(-1)
_EVENT_TESTED = const(0)
_NEW_FAULT = const(1)
_MOVING_BUBBLE = const(2)
_PRESSED_BUBBLE = const(4)
_OVERFILLED_BUBBLE = const(8)
# [end of constants]

_IDLE_MASK = const(1023)  # ticks


class App:
    """The firmware of `board` on `hal`. Call `tick` once per period, and `listen` between two where there is time."""

    def __init__(self, board: "ModuleType", hal: "Hal"):
        collect()  # or what imports have left behind splits the heap where the bubbles' state is to go in one piece
        self.board = board
        self.hal = hal
        self.stats = TickStats(board)
        self.tables = Tables(board.BUBBLES)
        self.bubbles = Bubbles(board, self.tables)
        self.trim = Trim(board, self.bubbles)
        self.state = state = BoardState(board, hal, self.bubbles)
        self.clock = state.clock
        self.supply = state.supply
        self.self_test = state.self_test
        self.safety = state.safety
        self.deadman = state.deadman
        self.fault_monitor = state.fault_monitor
        self.faults = state.faults
        self.faults.latch_board(hal.boot_faults)
        self.settings = Settings(board, self.deadman, self.fault_monitor, self.bubbles)
        content = Content(board, self.tables, self.bubbles, self.trim, self.settings)
        self.store = Store(board.NAME, hal.flash, content)
        self.player = Player(board, state, self.bubbles)
        self.commands = Commands(board, hal, state, self.bubbles, self.player)
        self.server = Server(board, hal, state, self.bubbles)
        reply = self.server.reply
        self.sequence_handlers = SequenceHandlers(self.server.sender, reply, board, state, self.player, self.commands)
        for handlers in (
            SessionHandlers(self.server, board, hal, self.clock, self.tables),
            ShapeHandlers(reply, board, state, self.bubbles, self.commands),
            TableHandlers(reply, board, self.tables, self.bubbles),
            TrimHandlers(reply, board, self.safety, self.trim),
            StoreHandlers(reply, hal, state, self.store),
            LayoutHandlers(reply, board, self.clock),
            SettingHandlers(reply, self.clock, self.settings),
            FaultHandlers(reply, board, state, self.commands),
            SystemHandlers(self.server, hal, state, self.stats, self.tables, self.store, self.commands),
            InjectHandlers(reply, board, hal, self.safety, self._use),
            self.sequence_handlers,
        ):
            self.server.register(handlers)
        self._counts = array("H", bytearray(2 * (board.BUBBLES + 1)))
        self._moves = 0  # whether bubbles moved in the last tick
        hal.safe_outputs()

    def tick(self) -> None:
        """One period: sense, decide, act, then talk."""
        self.clock.advance(1)
        try:
            self._control()
        except Exception:
            self._fail()
        try:  # a board that cannot control still says so
            self._communicate()
        except Exception:
            self._fail()
            self.server.fail()

    def listen(self) -> None:
        """Between two ticks, when there is time: answer what has come over the link."""
        try:
            self.server.listen()
        except Exception:
            self._fail()
            self.server.fail()

    def _control(self) -> None:
        # Locals, because an attribute costs the chip 2.5 µs.
        hal = self.hal
        supply = self.supply
        bubbles = self.bubbles
        pulses = bubbles.pulses
        safety = self.safety
        monitor = self.fault_monitor
        faults = self.faults
        counts = self._counts
        self.stats.began(hal.phase_us())

        # What is there? Counts of all sensors, and faults of the board.
        hal.read_sensors(counts)
        supply.sense(counts[-1], pulses, faults.board & _SHUTTING)
        if hal.active_faults or supply.lost:
            self.commands.fault(hal.active_faults)

        # Where are the bubbles to go? Nowhere without a host that lives; else on with what it has asked for.
        event = self.deadman.tick(safety.mode, self._moves)
        if event != _NO_EVENT:
            self.commands.host_silent(event)
        if self.player.running:
            self.commands.finish(self.player.tick())

        # How long does each valve open? Estimates and pulses of all bubbles.
        bubbles.step(counts, supply.metering_pa, safety.control_mode)
        monitor.block_backflow(supply.pressure_pa)

        # Is any of it wrong? A bubble with a fault is vented, whatever was decided.
        found = monitor.check()
        self._moves = found & _MOVING_BUBBLE
        if safety.mode == _VENTING:
            safety.update_venting(found & _PRESSED_BUBBLE)
        if found & (_NEW_FAULT | _OVERFILLED_BUBBLE):
            faults.latch_bubbles()
            if found & _OVERFILLED_BUBBLE:
                self.commands.fault(_OVERFILLED)
                monitor.open_vents()
        if safety.mode == _BOOT:
            self._test()

        # Do it.
        board_faults = faults.board
        if board_faults & _SHUTTING:  # nothing more into it, from the very tick on that finds it
            hal.write_outputs(pulses, 0, 1)
        else:
            hal.write_outputs(pulses, supply.pump, supply.dump)
        hal.feed_watchdog(safety.mode, board_faults)

    def _test(self) -> None:
        """The self-test at boot, on top of what control has decided."""
        test = self.self_test
        if test.running:
            test.tick(self.bubbles, self.supply)
        if not test.running:
            if test.failed:
                self.faults.latch_board(_SELF_TEST)
            self.safety.handle(_EVENT_TESTED)

    def _communicate(self) -> None:
        hal = self.hal
        if self.faults.waiting:
            self.commands.release()
        self.server.poll()
        if self.player.events_waiting:
            self.sequence_handlers.send_events()
        if not self.clock.ticks & _IDLE_MASK and self.safety.mode == _IDLE:
            hal.idle()
        self.stats.ended(hal.phase_us())

    def _use(self, hal: "Hal") -> None:
        """From the next tick on, sense and act by this."""
        self.hal = hal

    def _fail(self) -> None:
        self.stats.exceptions += 1
        self.commands.fail()


def run(app: App) -> None:
    """Tick for as long as the board's clock does."""
    while True:
        periods = app.hal.wait()
        if periods > 0:
            app.clock.advance(periods - 1)
            app.tick()
        elif periods:
            app.listen()
        else:
            return
