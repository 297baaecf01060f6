"""The tick: sense, estimate, watch, control, act, talk. What the board as a whole does is decided here.

`hands` is the board's hardware, or what stands in for it:

    wait() -> periods           until the next period has begun; how many have, 0: there will be no more, LISTEN: none yet,
                                but there is time for a look at the link
    sense(counts)               fill in one count per bubble, then the supply's; 0xFFFF where no chip answers
    act(pulses, pump, dump)     outputs of the next period: fill and vent µs per bubble, pump 0 to 65535
    vent()                      the safe outputs, at once: fill closed, vent open, pump off
    receive(buffer) -> n        bytes that have come over the link, without waiting
    send(frame, length) -> bool whether there was room for the whole frame
    phase_us() -> µs            since this tick's period began
    alive(mode, faults)         a tick has gone well: feeds the watchdog
    clear()                     try again what has failed
    slack()                     this tick may take long, and harms nobody: the bubbles are vented
    tidy()                      make use of a moment when nothing is urgent
    restart(into)               start again, see RESTART
    boot_id, late_ticks         another number each boot; ticks that began late
    alarms                      board faults that are there now, bits
    boot_faults                 board faults since boot, bits
    self_test                   whether there is hardware to test
    flash                       where the store is, see `store`; None where there is none
"""

import gc
from array import array

from bubble_firmware.control.bubbles import Bubbles
from bubble_firmware.control.supply import Supply
from bubble_firmware.control.table import Tables
from bubble_firmware.control.trim import Trim
from bubble_firmware.handlers.layout import LayoutRequests
from bubble_firmware.handlers.sequence import SequenceRequests
from bubble_firmware.handlers.store import StoreRequests
from bubble_firmware.link.server import Session
from bubble_firmware.safety import state
from bubble_firmware.safety.deadman import Deadman
from bubble_firmware.safety.fault_log import FaultLog
from bubble_firmware.safety.fault_monitor import FaultMonitor
from bubble_firmware.safety.self_test import SelfTest
from bubble_firmware.sequence.player import Player
from bubble_firmware.store.settings import Settings
from bubble_firmware.store.slots import Store
from bubble_firmware.tick_stats import bins, count, later
from bubble_protocol.mpy_compat import const
from bubble_protocol.schema import faults, modes, settings
from bubble_protocol.schema.faults import ESTOP, EXCEPTION, OVERFILLED, SELF_TEST, SUPPLY_LOST, VENTING
from bubble_protocol.schema.modes import ACTIVE, HOLDING, IDLE

# [constants] bubble_firmware.safety.watch_layout: used
_NEW_FAULT = const(1)
_MOVING_BUBBLE = const(2)
_PRESSED_BUBBLE = const(4)
_OVERFILLED_BUBBLE = const(8)
# [end of constants]

_TIDY_MASK = 1023  # ticks


LISTEN = -1


class App:
    """The firmware of one board. Call `tick` once per period; it catches everything and allocates nothing."""

    def __init__(self, board, hands):
        gc.collect()  # or what imports have left behind splits the heap where the bubbles' state is to go in one piece
        self.board = board
        self.hands = hands
        self.ticks = -1  # the first is 0
        self.faults = 0
        self.exceptions = 0
        self.tick_worst_us = 0
        self.work_us = board.TICK_US // 50
        self.delay_us = board.TICK_US // 250
        self.worked = bins()
        self.delayed = bins()
        self.tables = Tables(board.BUBBLES)
        self.bubbles = Bubbles(board, self.tables)
        self.supply = Supply(board)
        self.self_test = SelfTest(board, hands.self_test)
        self.safety = state.SafetyState(board)
        self.deadman = Deadman(board)
        self.settings = Settings(board)
        self.fault_monitor = FaultMonitor(board, self.bubbles)
        self.log = FaultLog()
        self._fault_id = 0  # of the board's newest fault
        self._fault_ids = array("i", bytearray(4 * board.BUBBLES))  # of each bubble's
        self._moving = 0
        self.fault(hands.boot_faults)
        self.figures = Trim(board, self.bubbles)
        self.store = Store(self, getattr(hands, "flash", None))
        self.use_settings()
        self.player = Player(self)
        self.session = Session(self)
        StoreRequests(self, self.session)
        self.sequence_requests = SequenceRequests(self, self.session)
        LayoutRequests(self, self.session)
        self._counts = array("H", bytearray(2 * (board.BUBBLES + 1)))
        hands.vent()

    def tick(self):
        """One period. Whatever goes wrong in it, the outputs go to vent and the next one is tried."""
        self.ticks = later(self.ticks, 1)
        try:
            self._control()
        except Exception:
            self._fail()
        try:  # a board that cannot control still says so
            self._talk()
        except Exception:
            self._fail()
            self.session.fail()

    def listen(self):
        """Between two ticks, when there is time: answer what has come over the link."""
        try:
            self.session.listen()
        except Exception:
            self._fail()
            self.session.fail()

    @property
    def mode(self):
        """The state of the board, one of MODES."""
        return self.safety.mode

    def _control(self):
        hands = self.hands
        supply = self.supply
        bubbles = self.bubbles
        counts = self._counts
        count(self.delayed, hands.phase_us(), self.delay_us)
        hands.sense(counts)
        supply.sense(counts[bubbles.count])
        if hands.alarms or supply.lost:
            self._alarm(hands.alarms)
        silence = self.deadman.tick(self.safety.mode, self._moving)
        if silence != state.NO_EVENT:
            self._silence(silence)
        if self.player.running:
            self.player.tick()
        bubbles.step(counts, supply.pressure_pa, self.safety.control_mode)
        self.fault_monitor.block_backflow(supply.pressure_pa)
        found = self.fault_monitor.check()
        self._moving = found & _MOVING_BUBBLE
        self.safety.update_venting(found & _PRESSED_BUBBLE)
        if found & (_NEW_FAULT | _OVERFILLED_BUBBLE):
            self._found(found)
        if self.safety.mode == modes.BOOT:
            self._test()
        if self.faults & OVERFILLED:  # nothing more into it
            hands.act(bubbles.pulses, 0, 1)
        else:
            hands.act(bubbles.pulses, supply.pump, supply.dump)
        hands.alive(self.safety.mode, self.faults)

    def _talk(self):
        hands = self.hands
        self.session.poll()
        if self.player.waiting_news:
            self.sequence_requests.tell()
        if not self.ticks & _TIDY_MASK and self.safety.mode == IDLE:
            hands.tidy()
        spent = hands.phase_us()
        count(self.worked, spent, self.work_us)
        if spent > self.tick_worst_us:
            self.tick_worst_us = spent

    def _fail(self):
        self.hands.vent()  # first of all
        self.exceptions += 1
        self.fault(EXCEPTION)
        self.safety.handle(state.EXCEPTION)
        self.player.cancel()
        self.bubbles.retract()

    def _alarm(self, alarms):
        if self.supply.lost:
            alarms |= SUPPLY_LOST
        self.fault(alarms)
        if alarms & VENTING:
            self.hands.vent()
            self.self_test.skip()
            self.player.cancel()
            if self.safety.handle(state.ESTOP if alarms & ESTOP else state.BOARD_FAULT):
                self.bubbles.retract()

    def _silence(self, event):
        if self.safety.handle(event):
            self.player.cancel()
            ms = self.deadman.silent_ticks * (self.board.TICK_US // 1000)
            self.log.add(self.ticks, faults.HOST_SILENT, faults.BOARD, ms)
            if self.safety.mode == HOLDING:
                self.bubbles.hold_position()
            else:
                self.bubbles.retract()

    def _found(self, found):
        bubbles = self.bubbles
        for i in range(bubbles.count):
            new = self.fault_monitor.take_new_faults(i)
            bit = 1
            while new:
                if new & 1:
                    self._fault_ids[i] = self.log.add(self.ticks, bit, i, bubbles.pressure_pa(i))
                new >>= 1
                bit <<= 1
        if found & _OVERFILLED_BUBBLE:
            self._alarm(OVERFILLED)

    def fault(self, bits):
        """The board has these faults: those that are new are latched and written down."""
        new = bits & ~self.faults
        self.faults |= bits
        bit = 1
        while new:
            if new & 1:
                self._fault_id = self.log.add(self.ticks, bit, faults.BOARD, self.supply.pressure_pa)
            new >>= 1
            bit <<= 1

    def _test(self):
        if self.self_test.running:
            self.self_test.tick(self.bubbles, self.supply)
        if not self.self_test.running:
            if self.self_test.failed:
                self.fault(SELF_TEST)
            self.safety.handle(state.TESTED)

    def show(self, values, first, over_ms):
        """Take the shape whose heights (µm) stand in `values[first:]`, in `over_ms`."""
        self.self_test.skip()
        self.player.cancel()
        self.safety.handle(state.SHOW)
        if self.safety.mode == ACTIVE:
            ticks = over_ms * 1000 // self.board.TICK_US
            self.bubbles.set_targets(values, first, ticks if ticks > 1 else 1)

    def stop(self):
        """Close all valves and keep the air, unless a fault of the board keeps the vents open."""
        self.self_test.skip()
        self.player.cancel()
        self.safety.handle(state.STOP)
        if self.safety.mode == HOLDING:
            self.bubbles.hold_position()

    def vent(self):
        """Open all vent valves until the next `show`."""
        self.player.cancel()
        self.safety.handle(state.VENT)
        self.bubbles.retract()

    def clear(self):
        """Acknowledge all faults: forget them; what still is wrong faults again."""
        self.acknowledge(self.log.newest)

    def acknowledge(self, up_to):
        """Acknowledge the log up to this entry, and forget what has no later one; what still is wrong faults again."""
        self.log.acknowledge(up_to)
        for i in range(self.bubbles.count):
            if self._fault_ids[i] <= up_to:
                self.bubbles.clear_faults(i)
                self.fault_monitor.acknowledge(i)
        if self._fault_id <= up_to:
            self.faults = 0
            self.supply.clear()
            self.hands.clear()
            self.safety.handle(state.CLEAR)
            if self.hands.alarms & ESTOP:  # still pressed
                self._alarm(ESTOP)

    def heard(self):
        """A valid frame of the host's has come: it lives."""
        self.deadman.host_activity()

    def use_settings(self):
        """The settings have changed."""
        values = self.settings.values
        self.deadman.configure(values[settings.DEADMAN_HOLD], values[settings.DEADMAN_VENT])
        self.fault_monitor.set_budget(values[settings.BUDGET_KPA_S])

    def restart(self, into):
        """Vent and start again."""
        self.vent()
        self.hands.vent()
        self.hands.restart(into)


def run(app):
    """Tick for as long as the hands' clock does."""
    while True:
        periods = app.hands.wait()
        if periods > 0:
            app.ticks = later(app.ticks, periods - 1)
            app.tick()
        elif periods:
            app.listen()
        else:
            return
