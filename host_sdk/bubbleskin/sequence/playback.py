"""How far a sequence is, and what became of it."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class PlaybackStatus:
    """How far a sequence is."""

    state: str
    """empty, loading, armed, waiting, playing, paused or ended."""
    reason: str
    """How it ended: complete, by_timeout, cancelled or underrun; unended while it has not."""
    step: int
    """The step being played, counted from 0 as written; -1 before the first, or where another host uploaded it."""
    begun: float
    """Device time at which the step began, s."""
    time: float
    """Device time, s."""
    unsettled: tuple[int, ...]
    """Bubbles that were not there when the last step with a timeout ended by it."""
    timeouts: int
    """Steps that ended by their timeout."""
    begun_steps: int = 0
    """Steps begun so far, those of repeats every time, as `play` has counted them."""
    name: str = ""
    """The step's."""
    steps: int = 0
    """Steps that will be played in all; 0 where there is no end."""

    def __repr__(self) -> str:
        name = f" ({self.name})" if self.name else ""
        step = f", step {self.step}{name}" if self.step >= 0 else ""
        end = f": {self.reason}" if self.state == "ended" else ""
        return f"<PlaybackStatus {self.state}{end}{step}>"


Progress = Callable[[PlaybackStatus], object]
"""What is called with the status at every step."""
Told = Progress | None
At = float | None
"""Device time in s at which to begin; None: at once."""


@dataclass(frozen=True)
class PlaybackReport:
    """What became of a sequence that was played to its end; times are the device's, s."""

    steps: tuple[int, ...]
    """The steps in the order in which they were played."""
    began: tuple[float, ...]
    """When each of them began."""
    ended: float
    timeouts: tuple[str, ...]
    """A sentence for each step that ended by its timeout."""
    lost: int
    """Events that did not arrive: so many steps may be missing here."""

    def __repr__(self) -> str:
        seconds = self.ended - self.began[0] if self.began else 0.0
        return f"<PlaybackReport {len(self.steps)} steps in {seconds:.3f} s, {len(self.timeouts)} timeouts>"
