"""What a device has told of a sequence so far: its events, counted and put into words. No I/O."""

from bubble_protocol.schema import sequences
from bubbleskin.device.state import State, bubbles_of
from bubbleskin.layout import Layout
from bubbleskin.link.message import Message
from bubbleskin.sequence.playback import PlaybackStatus
from bubbleskin.sequence.steps import Settled
from bubbleskin.sequence.uploader import Uploader

REASONS = {number: name for number, name, _ in sequences.REASONS}

_STATES = {sequences.SEQUENCE_PAUSED: "paused", sequences.SEQUENCE_ENDED: "ended"}
_NAMED = 3
"""Heights in a sentence."""


class EventLog:
    """The events of the sequence that `upload` has brought to the device; `tick`: its period, s."""

    def __init__(self, upload: Uploader, layout: Layout, tick: float):
        self.upload = upload
        self.steps: list[int] = []
        """The steps in the order in which they began."""
        self.began: list[float] = []
        """When each of them began, device time, s."""
        self.timeouts: list[str] = []
        """A sentence for each step that ended by its timeout."""
        self.lost = 0
        """Events that have not come."""
        self._layout = layout
        self._tick = tick
        self._expected: int | None = None

    def take(self, event: Message) -> PlaybackStatus | None:
        """How far the sequence is by this event; None where it is another's."""
        upload = self.upload
        if event["sequence"] != upload.id:
            return None
        if self._expected is not None:
            self.lost += event.sequence - self._expected & 0xFFFF
        self._expected = event.sequence + 1
        time, unsettled = event["ticks"] * self._tick, bubbles_of(event["unsettled"])
        reason = REASONS.get(event["reason"], "unknown")
        state = _STATES.get(event["event"], "playing")
        if event["event"] == sequences.STEP_BEGUN:
            if reason == "by_timeout" and self.steps:
                self.timeouts.append(self.timeout(self.steps[-1], unsettled))
            self.steps.append(upload.step(event["record"]))
            self.began.append(time)
        step = self.steps[-1] if self.steps else -1
        return PlaybackStatus(
            state=state,
            reason=reason if state == "ended" else "unended",
            step=step,
            begun_steps=len(self.steps),
            begun=self.began[-1] if self.began else time,
            time=time,
            unsettled=unsettled,
            timeouts=len(self.timeouts),
            name=upload.name(step),
            steps=upload.compiled.total,
        )

    def timeout(self, step: int, unsettled: tuple[int, ...], state: State | None = None) -> str:
        """A sentence for a step that ended by its timeout; with `state`, it says where the bubbles are."""
        until = self.upload.sequence.each[step].until
        limit = f" within {until.timeout_s:g} s" if isinstance(until, Settled) else ""
        where = ""
        if state:
            off = [f"{state.height_mm[b]:.2f} instead of {state.target_mm[b]:.2f} mm" for b in unsettled[:_NAMED]]
            where = f" at {', '.join(off)}{' …' * (len(unsettled) > _NAMED)}"
        return f"{self.upload.sequence.say(step)} did not settle{limit}: {self._layout.names(unsettled)}{where}."
