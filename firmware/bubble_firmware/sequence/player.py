"""The player: executes the sequence in memory on the device's own clock.

Times in records are ms; the player counts whole ticks and carries what is left over to the next step, so that every
step begins in the tick of its schedule, however many came before it. Memory is made once; playing allocates nothing.
"""

from array import array

from bubble_firmware.device_clock import ticks_add, ticks_diff
from bubble_firmware.sequence.memory import SequenceMemory, word
from bubble_protocol import steps
from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from types import ModuleType

    from bubble_firmware.board_state import BoardState
    from bubble_firmware.control.bubbles import Bubbles

# [constants] bubble_protocol.steps: HEAD DEPTH_MAX ONE STEP REPEAT
# [constants] bubble_protocol.steps: GO_ON as THEN_GO_ON
# [constants] bubble_protocol.schema.faults: VENTING as VENTING_FAULTS
# [constants] bubble_protocol.schema.modes: ACTIVE
# [constants] bubble_protocol.schema.sequences: EMPTY LOADING ARMED WAITING PLAYING PAUSED ENDED
# [constants] bubble_protocol.schema.sequences: UNENDED BY_TIME BY_SETTLING BY_TIMEOUT COMPLETE CANCELLED UNDERRUN
# [constants] bubble_protocol.schema.sequences: STEP_BEGUN SEQUENCE_PAUSED SEQUENCE_RESUMED SEQUENCE_ENDED
# [constants] bubble_firmware.safety.state: SHOW as EVENT_SHOW
# [constants] message SEQUENCE_EVENT as EVENT: *
_HEAD = const(4)
_DEPTH_MAX = const(4)
_ONE = const(32768)
_STEP = const(0)
_REPEAT = const(1)
_THEN_GO_ON = const(0)
_VENTING_FAULTS = const(135)
_ACTIVE = const(1)
_EMPTY = const(0)
_LOADING = const(1)
_ARMED = const(2)
_WAITING = const(3)
_PLAYING = const(4)
_PAUSED = const(5)
_ENDED = const(6)
_UNENDED = const(0)
_BY_TIME = const(1)
_BY_SETTLING = const(2)
_BY_TIMEOUT = const(3)
_COMPLETE = const(4)
_CANCELLED = const(5)
_UNDERRUN = const(6)
_STEP_BEGUN = const(0)
_SEQUENCE_PAUSED = const(1)
_SEQUENCE_RESUMED = const(2)
_SEQUENCE_ENDED = const(3)
_EVENT_SHOW = const(1)
_EVENT_TICKS = const(0)
_EVENT_SEQUENCE = const(1)
_EVENT_EVENT = const(2)
_EVENT_REASON = const(3)
_EVENT_RECORD = const(4)
_EVENT_UNSETTLED = const(5)
_EVENT_FREE = const(6)
# [end of constants]

_EVENTS = const(8)  # that may wait for room on the link
_EVENT_FIELDS = const(_EVENT_FREE)  # of an event that is kept; what is free is known when it is sent


class Player:
    """Plays `sequence`. Call `tick` in every period while `running`.

    `id`: the host's number of the sequence. `state`, `reason`: see `sequences` in the schema. `start`: tick of the first
    step. `record`: of the step being played; `begun`: the tick in which it began. `unsettled`: the bubbles, as bits, that its
    timeout found elsewhere; `timeouts`: how many steps ended so. `events_waiting`: how many events are to be sent to the
    host, of which the oldest has the number `event_number`.
    """

    def __init__(self, board: "ModuleType", state: "BoardState", bubbles: "Bubbles"):
        self._tick_us = board.TICK_US
        self._clock = state.clock
        self._safety = state.safety
        self._faults = state.faults
        self._self_test = state.self_test
        self._bubbles = bubbles
        self.sequence = SequenceMemory(board)
        self.id = 0
        self.state = _EMPTY
        self.reason = _UNENDED
        self.running = False
        self.start = 0
        self.record = 0
        self.begun = 0  # its beginning by the schedule is `_carry_us` later
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
        self._back = array("i", bytearray(4 * _DEPTH_MAX))  # first record within each repeat
        self._left = array("i", bytearray(4 * _DEPTH_MAX))  # times that it will be played again; -1: for ever
        self._events = array("i", bytearray(4 * _EVENTS * _EVENT_FIELDS))
        self._oldest = 0
        self.events_waiting = 0
        self.event_number = 0

    # What the host asks for.

    def begin(self, number: int, total: int) -> None:
        """Make room for a sequence of `total` records. What runs is cancelled, and held where it is."""
        if self.running:
            playing = self.state != _WAITING
            self.cancel()
            if playing:
                self._bubbles.hold_position()
        self.id = number
        self.state = _LOADING
        self.reason = _UNENDED
        self.unsettled = 0
        self.timeouts = 0
        self.record = 0
        self.sequence.begin(total)

    def arm(self) -> None:
        """The sequence may be started."""
        self.state = _ARMED

    def start_at(self, tick: int) -> None:
        """Begin the first step in that tick."""
        self.start = tick
        self.state = _WAITING
        self.running = True

    def pause(self) -> None:
        """Let time and setpoints stand still."""
        if self.state == _PLAYING:
            self._elapsed = ticks_diff(self._clock.ticks, self.begun)
            self.state = _PAUSED
            self._keep_event(_SEQUENCE_PAUSED, _UNENDED, self._clock.ticks)

    def resume(self) -> None:
        """Let time go on from where it stood still."""
        if self.state == _PAUSED:
            self.begun = ticks_add(self._clock.ticks, -self._elapsed)
            self.state = _PLAYING
            self._keep_event(_SEQUENCE_RESUMED, _UNENDED, self._clock.ticks)

    def cancel(self) -> None:
        """Something else decides from now on where the bubbles go."""
        if self.running:
            self._end(_CANCELLED, self._clock.ticks)

    # A period.

    def tick(self) -> int:
        """One period, before anything of it has been decided. What the sequence wants done at its end: see `steps.GO_ON`."""
        now = self._clock.ticks
        if self.state == _WAITING:
            if ticks_diff(now, self.start) < 0:
                return _THEN_GO_ON
            self._open()
            if not self.running:
                return _THEN_GO_ON
        elif self.state == _PAUSED:
            self.begun = ticks_add(now, -self._elapsed)
        elapsed = ticks_diff(now, self.begun)
        if self.state == _PLAYING:
            reason = self._over(elapsed)
            while reason:
                self._next(reason)
                if self.state != _PLAYING:
                    return self._then if self.reason == _BY_TIMEOUT else _THEN_GO_ON
                elapsed = ticks_diff(now, self.begun)
                reason = self._over(elapsed)
        if self._moving:
            share = steps.ease(elapsed + 1, self._ramp, self._easing)
            self._bubbles.advance(share)
            self._moving = share < _ONE or self.state == _PAUSED
        return _THEN_GO_ON

    def _open(self) -> None:
        """Begin with the first step."""
        if self._faults.board & _VENTING_FAULTS:
            self.cancel()
            return
        self._self_test.skip()
        self.state = _PLAYING
        self.reason = _UNENDED
        self.unsettled = 0
        self.timeouts = 0
        self.begun = self.start
        self._length = 0
        self._carry_us = 0
        self._settle = 0
        self._depth = 0
        self.sequence.next = 0
        self._next(_UNENDED)
        self._safety.handle(_EVENT_SHOW)

    def _over(self, elapsed: int) -> int:
        """Why the step is over after so many ticks of it, UNENDED where it is not."""
        if not self._settle:
            return _BY_TIME if elapsed >= self._length else _UNENDED
        if elapsed < self._ramp:
            return _UNENDED
        self.unsettled = self._bubbles.unsettled(self._tolerance)
        if not self.unsettled:
            return _BY_SETTLING
        return _BY_TIMEOUT if elapsed >= self._length else _UNENDED

    def _next(self, reason: int) -> None:
        """Begin the step that follows one that ended for `reason`, or end the sequence."""
        tick = self._clock.ticks
        if not self._settle:
            tick = ticks_add(self.begun, self._length)
        elif reason == _BY_TIMEOUT:
            self.timeouts += 1
            if self._then != _THEN_GO_ON:
                self._end(_BY_TIMEOUT, tick)
                return
        ended = self._find_step()
        if ended:
            self._end(ended, tick)
            return
        sequence = self.sequence
        self.record = sequence.next
        sequence.next = self.record + 1
        self.begun = tick
        self._keep_event(_STEP_BEGUN, reason, tick)
        self._begin(sequence.block(self.record), sequence.offset(self.record))

    def _find_step(self) -> int:
        """Go through repeats and their ends up to the next step; UNENDED, or why there is none."""
        sequence = self.sequence
        while True:
            record = sequence.next
            if sequence.total and record == sequence.total:
                return _COMPLETE
            if record == sequence.received:
                return _UNDERRUN
            block = sequence.block(record)
            at = sequence.offset(record)
            kind = word(block, at) & 3
            if kind == _STEP:
                return _UNENDED
            if kind == _REPEAT:
                sequence.next = record + 1
                self._back[self._depth] = record + 1
                self._left[self._depth] = word(block, at + 1) - 1
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

    def _begin(self, block: bytearray, at: int) -> None:
        """Begin the step whose record stands at `block[at:]`."""
        flags = word(block, at)
        tick_us = self._tick_us
        ramp_us = word(block, at + 1) * 1000
        span_us = ramp_us + word(block, at + 2) * 1000
        self._easing = flags >> 2 & 3
        self._settle = flags >> 4 & 1
        self._then = flags >> 5 & 3
        self._tolerance = word(block, at + 3)
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
        self._bubbles.begin_step(block, at + _HEAD, self._safety.mode != _ACTIVE)

    def _end(self, reason: int, tick: int) -> None:
        self.running = False
        self.state = _ENDED
        self.reason = reason
        self._moving = False
        self._keep_event(_SEQUENCE_ENDED, reason, tick)

    # What is to be sent to the host.

    def _keep_event(self, event: int, reason: int, tick: int) -> None:
        if self.events_waiting == _EVENTS:  # the oldest is lost, and its number with it
            self.drop_event()
        events = self._events
        at = (self._oldest + self.events_waiting) % _EVENTS * _EVENT_FIELDS
        events[at + _EVENT_TICKS] = tick
        events[at + _EVENT_SEQUENCE] = self.id
        events[at + _EVENT_EVENT] = event
        events[at + _EVENT_REASON] = reason
        events[at + _EVENT_RECORD] = self.record
        events[at + _EVENT_UNSETTLED] = self.unsettled
        self.events_waiting += 1

    def read_event(self, values: "array[int]") -> None:
        """Put the oldest event in `values`, as the fields of SEQUENCE_EVENT."""
        events = self._events
        at = self._oldest * _EVENT_FIELDS
        for field in range(_EVENT_FIELDS):
            values[field] = events[at + field]
        values[_EVENT_FREE] = self.sequence.free

    def drop_event(self) -> None:
        """The oldest event has been sent, or is lost."""
        self._oldest = (self._oldest + 1) % _EVENTS
        self.events_waiting -= 1
        self.event_number = self.event_number + 1 & 0xFFFF
