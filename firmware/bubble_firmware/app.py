"""The tick: sense, estimate, guard, control, act, talk. What the board as a whole does is decided here.

`hands` is the board's hardware, or what stands in for it:

    sense(counts)               fill in one count per bubble, then the supply's
    act(pulses, pump, dump)     outputs of the next period: fill and vent µs per bubble, pump 0 to 65535
    vent()                      the safe outputs, at once: fill closed, vent open, pump off
    receive(buffer) -> n        bytes that have come over the link, without waiting
    send(frame, length) -> bool whether there was room for the whole frame
    phase_us() -> µs            since this tick began
    boot_id, late_ticks         another number each boot; ticks that began late
"""

from array import array

from bubble_firmware.bubbles import Bubbles
from bubble_firmware.session import Session
from bubble_firmware.supply import Supply
from bubble_firmware.table import Tables
from bubble_protocol.messages import ACTIVE, HOLDING, VENTED


class App:
    """The firmware of one board. Call `tick` once per period; it catches everything and allocates nothing."""

    def __init__(self, board, hands):
        self.board = board
        self.hands = hands
        self.ticks = 0
        self.mode = VENTED
        self.exceptions = 0
        self.tick_worst_us = 0
        self.tables = Tables(board.BUBBLES)
        self.bubbles = Bubbles(board, self.tables)
        self.supply = Supply(board)
        self.session = Session(self)
        self._counts = array("H", bytearray(2 * (board.BUBBLES + 1)))
        hands.vent()

    def tick(self):
        """One period. Whatever goes wrong in it, the outputs go to vent and the next one is tried."""
        try:
            self._control()
        except Exception:
            self._fail()
        try:  # a board that cannot control still says so
            self._talk()
        except Exception:
            self._fail()
            self.session.fail()
        self.ticks += 1

    def _control(self):
        counts = self._counts
        self.hands.sense(counts)
        self.supply.sense(counts[self.board.BUBBLES])
        self.bubbles.sense(counts, self.supply.pressure_pa, self.mode)
        self.bubbles.decide(self.mode)
        self.hands.act(self.bubbles.pulses, self.supply.pump, self.supply.dump)

    def _talk(self):
        self.session.poll()
        spent = self.hands.phase_us()
        if spent > self.tick_worst_us:
            self.tick_worst_us = spent

    def _fail(self):
        self.hands.vent()  # first of all
        self.exceptions += 1
        self.vent()

    def show(self, values, first, over_ms):
        """Take the shape whose heights (µm) stand in `values[first:]`, in `over_ms`."""
        ticks = over_ms * 1000 // self.board.TICK_US
        self.bubbles.show(values, first, ticks if ticks > 1 else 1)
        self.mode = ACTIVE

    def stop(self):
        """Close all valves and keep the air."""
        self.bubbles.hold()
        self.mode = HOLDING

    def vent(self):
        """Open all vent valves until the next `show`."""
        self.bubbles.rest()
        self.mode = VENTED


def run(app):
    """Tick for as long as the hands' clock does."""
    while app.hands.wait():
        app.tick()
