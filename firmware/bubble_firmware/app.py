"""The tick: sense, estimate, guard, control, act, talk. What the board as a whole does is decided here.

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

from bubble_firmware.bubbles import Bubbles
from bubble_firmware.figures import Figures
from bubble_firmware.selftest import SelfTest
from bubble_firmware.sequence import Player
from bubble_firmware.sequence_requests import SequenceRequests
from bubble_firmware.session import Session
from bubble_firmware.store import Store
from bubble_firmware.store_requests import StoreRequests
from bubble_firmware.supply import Supply
from bubble_firmware.table import Tables
from bubble_firmware.ticks import bins, count
from bubble_protocol.messages import ACTIVE, EXCEPTION, HOLDING, SELF_TEST, SUPPLY_LOST, VENTED, VENTING

_TIDY_MASK = 1023  # ticks
_TICKS_MASK = (1 << 30) - 1  # more, and counting allocates: ticks begin again after 62 days


LISTEN = -1


class App:
    """The firmware of one board. Call `tick` once per period; it catches everything and allocates nothing."""

    def __init__(self, board, hands):
        gc.collect()  # or what imports have left behind splits the heap where the bubbles' state is to go in one piece
        self.board = board
        self.hands = hands
        self.ticks = -1  # the first is 0
        self.mode = VENTED
        self.faults = hands.boot_faults
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
        self.figures = Figures(board, self.bubbles)
        self.store = Store(self, getattr(hands, "flash", None))
        self.player = Player(self)
        self.session = Session(self)
        StoreRequests(self, self.session)
        self.sequence_requests = SequenceRequests(self, self.session)
        self._counts = array("H", bytearray(2 * (board.BUBBLES + 1)))
        hands.vent()

    def tick(self):
        """One period. Whatever goes wrong in it, the outputs go to vent and the next one is tried."""
        self.ticks = self.ticks + 1 & _TICKS_MASK
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
        if self.player.running:
            self.player.tick()
        bubbles.step(counts, supply.pressure_pa, self.mode)
        if self.self_test.running:
            self._test()
        hands.act(bubbles.pulses, supply.pump, supply.dump)
        hands.alive(self.mode, self.faults)

    def _talk(self):
        hands = self.hands
        self.session.poll()
        if self.player.waiting_news:
            self.sequence_requests.tell()
        if not self.ticks & _TIDY_MASK and self.mode == VENTED:
            hands.tidy()
        spent = hands.phase_us()
        count(self.worked, spent, self.work_us)
        if spent > self.tick_worst_us:
            self.tick_worst_us = spent

    def _fail(self):
        self.hands.vent()  # first of all
        self.exceptions += 1
        self.faults |= EXCEPTION
        self.vent()

    def _alarm(self, alarms):
        if self.supply.lost:
            alarms |= SUPPLY_LOST
        self.faults |= alarms
        if alarms & VENTING:
            self.hands.vent()
            self.self_test.skip()
            if self.mode != VENTED:
                self.vent()

    def _test(self):
        self.self_test.tick(self.bubbles, self.supply)
        if self.self_test.failed:
            self.faults |= SELF_TEST

    def show(self, values, first, over_ms):
        """Take the shape whose heights (µm) stand in `values[first:]`, in `over_ms`."""
        self.self_test.skip()
        self.player.cancel()
        ticks = over_ms * 1000 // self.board.TICK_US
        self.bubbles.show(values, first, ticks if ticks > 1 else 1)
        self.mode = ACTIVE

    def stop(self):
        """Close all valves and keep the air."""
        self.self_test.skip()
        self.player.cancel()
        self.bubbles.hold()
        self.mode = HOLDING

    def vent(self):
        """Open all vent valves until the next `show`."""
        self.player.cancel()
        self.bubbles.rest()
        self.mode = VENTED

    def clear(self):
        """Forget all faults; what still is wrong faults again."""
        self.faults = 0
        self.supply.clear()
        self.bubbles.clear_faults()
        self.hands.clear()

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
            app.ticks += periods - 1
            app.tick()
        elif periods:
            app.listen()
        else:
            return
