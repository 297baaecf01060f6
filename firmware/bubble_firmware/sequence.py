# mypy: disable-error-code="valid-type,index,operator,arg-type"
"""A sequence of steps in memory, and the player that executes it on the device's own clock.

Times in records are ms; the player counts whole ticks and carries what is left over to the next step, so that every
step begins in the tick of its schedule, however many came before it. Memory is made once; playing allocates nothing.
"""

from array import array

from bubble_firmware import safety
from bubble_protocol import steps
from bubble_protocol.messages import (
    ACTIVE,
    ARMED,
    BY_SETTLING,
    BY_TIME,
    BY_TIMEOUT,
    CANCELLED,
    COMPLETE,
    EMPTY,
    ENDED,
    LOADING,
    PAUSED,
    PLAYING,
    SEQUENCE_ENDED,
    SEQUENCE_PAUSED,
    SEQUENCE_RESUMED,
    STEP_BEGUN,
    UNDERRUN,
    UNENDED,
    VENTING,
    WAITING,
)
from bubble_protocol.portable import const, micropython, ptr16, ptr32

_NEWS = const(8)  # events that may wait for room on the link
_FIELDS = const(6)  # of an event: ticks, sequence, event, reason, record, unsettled
_WHOLE = const(32768)
_PIECE = const(4096)  # bytes
_LEFT = const(6)  # pieces of the heap that are not ours: what is made after us takes 11 kB


@micropython.viper
def _store(v: ptr32, w: ptr16, at: int, count: int, to: int):
    end = at + count
    while at < end:
        w[to] = v[at]
        at += 1
        to += 1


@micropython.viper
def _word(w: ptr16, at: int) -> int:
    return w[at]


class Sequence:
    """The records of one sequence: a program that is all there, or a stream that is written ahead of what is read."""

    def __init__(self, board):
        self.words = steps.HEAD + board.BUBBLES  # of a record
        # In pieces, because a heap that compiles its own code has no large ones left; no arrays, for each would be
        # made from a second one.
        self.piece = _PIECE // (2 * self.words)  # records in each
        self.memory: "list[bytearray]" = []
        left = [bytearray(_PIECE) for _ in range(_LEFT)]
        try:
            for _ in range(board.SEQUENCE_BYTES // _PIECE):
                self.memory.append(bytearray(2 * self.piece * self.words))
        except MemoryError:  # a stock MicroPython has our code on its heap, too
            if not self.memory:
                raise
        del left
        self.capacity = len(self.memory) * self.piece
        self.check = array("i", bytearray(4 * steps.CHECK))
        self.check[steps.BUBBLES] = board.BUBBLES
        self.check[steps.HEIGHT_MAX] = board.HEIGHT_MAX_UM
        self.check[steps.TICK_US] = board.TICK_US
        self.total = 0  # records in all; 0: a stream without end
        self.received = 0
        self.streams = False
        self.next = 0  # record that will be read next

    def begin(self, total):
        """Await `total` records."""
        self.total = total
        self.received = 0
        self.next = 0
        self.streams = total == 0 or total > self.capacity
        steps.restart(self.check, 0 if self.streams else 1)

    @property
    def free(self):
        """Records that there is room for."""
        room = self.capacity - self.received
        if self.streams:
            room += self.next
        if self.total and room > self.total - self.received:
            room = self.total - self.received
        return room

    def write(self, values, at, records):
        """Take the records at `values[at:]`; the flaw of `steps.first_flaw` where one is not sound, then none is taken."""
        flaw = steps.first_flaw(values, self.check, at, records)
        if flaw < 0:
            words = self.words
            steps.accept(values, self.check, at, at + records * words)
            for _ in range(records):
                place = self.received % self.capacity
                _store(values, self.memory[place // self.piece], at, words, place % self.piece * words)
                self.received += 1
                at += words
        return flaw

    @property
    def whole(self):
        """Whether it can be played: a program is all there and nested properly, a stream has filled the memory."""
        if self.streams:
            return self.received > 0 and self.free == 0
        return self.received == self.total and self.check[steps.DEPTH] == 0


class Player:
    """Plays the sequence; `tick` while `running`. `read_news` gives what is to be told to the host."""

    def __init__(self, app):
        self._app = app
        self._tick_us = app.board.TICK_US
        self.sequence = Sequence(app.board)
        self.id = 0
        self.state = EMPTY
        self.reason = UNENDED
        self.running = False
        self.start = 0  # tick of the first step
        self.record = 0  # the step being played
        self.begun = 0  # tick in which it began; its beginning by the schedule is `_carry_us` later
        self.unsettled = 0
        self.timeouts = 0
        self._carry_us = 0
        self._length = 0  # ticks of the step, or until its timeout
        self._ramp = 0  # ticks
        self._easing = 0
        self._settle = 0
        self._then = 0
        self._tolerance = 0
        self._moving = False
        self._elapsed = 0  # ticks of the step when it was paused
        self._depth = 0
        self._back = array("i", bytearray(4 * steps.DEPTH_MAX))  # first record within each repeat
        self._left = array("i", bytearray(4 * steps.DEPTH_MAX))  # times that it will be played again; -1: for ever
        self._news = array("i", bytearray(4 * _NEWS * _FIELDS))
        self._oldest = 0
        self.waiting_news = 0
        self.number = 0  # of the oldest of them

    def begin(self, number, total):
        """Make room for a sequence of `total` records. What runs is cancelled, and held where it is."""
        if self.running:
            playing = self.state != WAITING
            self.cancel()
            if playing:
                self._app.bubbles.hold()
        self.id = number
        self.state = LOADING
        self.reason = UNENDED
        self.unsettled = 0
        self.timeouts = 0
        self.record = 0
        self.sequence.begin(total)

    def arm(self):
        """The sequence may be started."""
        self.state = ARMED

    def start_at(self, tick):
        """Begin the first step in that tick."""
        self.start = tick
        self.state = WAITING
        self.running = True

    def tick(self):
        """One period, before anything of it has been decided."""
        now = self._app.ticks
        if self.state == WAITING:
            if now < self.start:
                return
            self._open()
            if not self.running:
                return
        elif self.state == PAUSED:
            self.begun = now - self._elapsed
        elapsed = now - self.begun
        if self.state == PLAYING:
            reason = self._over(elapsed)
            while reason:
                self._next(reason)
                if self.state != PLAYING:
                    return
                elapsed = now - self.begun
                reason = self._over(elapsed)
        if self._moving:
            share = steps.ease(elapsed + 1, self._ramp, self._easing)
            self._app.bubbles.advance(share)
            self._moving = share < _WHOLE or self.state == PAUSED

    def _open(self):
        """Begin with the first step."""
        app = self._app
        if app.faults & VENTING:
            self.cancel()
            return
        app.self_test.skip()
        self.state = PLAYING
        self.reason = UNENDED
        self.unsettled = 0
        self.timeouts = 0
        self.begun = self.start
        self._length = 0
        self._carry_us = 0
        self._settle = 0
        self._depth = 0
        self.sequence.next = 0
        self._next(UNENDED)
        app.safety.take(safety.SHOW)

    def _over(self, elapsed):
        """Why the step is over after so many ticks of it, UNENDED where it is not."""
        if not self._settle:
            return BY_TIME if elapsed >= self._length else UNENDED
        if elapsed < self._ramp:
            return UNENDED
        self.unsettled = self._app.bubbles.unsettled(self._tolerance)
        if not self.unsettled:
            return BY_SETTLING
        return BY_TIMEOUT if elapsed >= self._length else UNENDED

    def _next(self, reason):
        """Begin the step that follows one that ended for `reason`, or end the sequence."""
        tick = self._app.ticks
        if not self._settle:
            tick = self.begun + self._length
        elif reason == BY_TIMEOUT:
            self.timeouts += 1
            if self._then != steps.GO_ON:
                self._end_by_timeout(tick)
                return
        sequence = self.sequence
        while True:
            record = sequence.next
            if sequence.total and record == sequence.total:
                self._end(COMPLETE, tick)
                return
            if record == sequence.received:
                self._end(UNDERRUN, tick)
                return
            place = record % sequence.capacity
            memory = sequence.memory[place // sequence.piece]
            at = place % sequence.piece * sequence.words
            kind = _word(memory, at) & 3
            if kind == steps.STEP:
                break
            if kind == steps.REPEAT:
                sequence.next = record + 1
                self._back[self._depth] = record + 1
                self._left[self._depth] = _word(memory, at + 1) - 1
                self._depth += 1
            else:
                left = self._left[self._depth - 1]
                if left:
                    if left > 0:
                        self._left[self._depth - 1] = left - 1
                    sequence.next = self._back[self._depth - 1]
                else:
                    self._depth -= 1
                    sequence.next = record + 1
        sequence.next = record + 1
        self.record = record
        self.begun = tick
        self._tell(STEP_BEGUN, reason, self.begun)
        self._begin(memory, at)

    def _begin(self, memory, at):
        """Begin the step whose record stands at `memory[at:]`."""
        flags = _word(memory, at)
        tick_us = self._tick_us
        ramp_us = _word(memory, at + 1) * 1000
        span_us = ramp_us + _word(memory, at + 2) * 1000
        self._easing = flags >> 2 & 3
        self._settle = flags >> 4 & 1
        self._then = flags >> 5 & 3
        self._tolerance = _word(memory, at + 3)
        self._ramp = ramp_us // tick_us or 1
        if self._settle:
            self._length = (span_us + tick_us - 1) // tick_us
            self._carry_us = 0
        else:
            span_us += self._carry_us
            self._length = span_us // tick_us
            self._carry_us = span_us % tick_us
        self.unsettled = 0
        self._moving = True
        self._app.bubbles.begin(memory, at + steps.HEAD, self._app.mode != ACTIVE)

    def _end_by_timeout(self, tick):
        app = self._app
        self._end(BY_TIMEOUT, tick)
        if self._then == steps.VENT:
            app.vent()
        elif self._then == steps.STOP:
            app.stop()

    def _end(self, reason, tick):
        self.running = False
        self.state = ENDED
        self.reason = reason
        self._moving = False
        self._tell(SEQUENCE_ENDED, reason, tick)

    def cancel(self):
        """Something else decides from now on where the bubbles go."""
        if self.running:
            self._end(CANCELLED, self._app.ticks)

    def pause(self):
        """Let time and setpoints stand still."""
        if self.state == PLAYING:
            self._elapsed = self._app.ticks - self.begun
            self.state = PAUSED
            self._tell(SEQUENCE_PAUSED, UNENDED, self._app.ticks)

    def resume(self):
        """Let time go on from where it stood still."""
        if self.state == PAUSED:
            self.begun = self._app.ticks - self._elapsed
            self.state = PLAYING
            self._tell(SEQUENCE_RESUMED, UNENDED, self._app.ticks)

    # What the host is to be told.

    def _tell(self, event, reason, tick):
        news = self._news
        if self.waiting_news == _NEWS:  # the oldest is lost, and its number with it
            self.forget_news()
        at = (self._oldest + self.waiting_news) % _NEWS * _FIELDS
        news[at] = tick
        news[at + 1] = self.id
        news[at + 2] = event
        news[at + 3] = reason
        news[at + 4] = self.record
        news[at + 5] = self.unsettled
        self.waiting_news += 1

    def read_news(self, values):
        """The oldest event, as the fields of SEQUENCE_EVENT."""
        news = self._news
        at = self._oldest * _FIELDS
        for field in range(_FIELDS):
            values[field] = news[at + field]
        values[_FIELDS] = self.sequence.free

    def forget_news(self):
        """The oldest event has been told, or is lost."""
        self._oldest = (self._oldest + 1) % _NEWS
        self.waiting_news -= 1
        self.number = self.number + 1 & 0xFFFF
