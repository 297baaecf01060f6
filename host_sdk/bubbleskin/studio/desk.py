"""What all pages of a studio share: the wristband's owner, and how each demonstration is set. Pages keep nothing that matters."""

from dataclasses import dataclass, field

from bubbleskin.errors import BubbleskinError
from bubbleskin.sequence.library import LOW_MM, pulse
from bubbleskin.sequence.model import Sequence
from bubbleskin.studio.owner import Owner
from bubbleskin.studio.widgets import Range

RATE = Range(6.0, 30.0, 1.0, "a minute")
DEPTH = Range(1.0, 7.5, 0.5, "mm")


@dataclass
class Pulse:
    """How the pulse is set."""

    rate: float = 12.0
    """Pulses a minute."""
    depth_mm: float = 6.5
    times: int = 3

    def sequence(self, owner: Owner) -> Sequence:
        """The library's pulse for this wristband, at this rate and depth."""
        assert owner.skin
        layout = owner.skin.layout
        high = min(LOW_MM + self.depth_mm, owner.skin.info.height_max_mm)
        usual = pulse(layout, loops=1).duration
        shorter = 60.0 / self.rate / usual
        rise, each, rest = (round(seconds * shorter, 3) for seconds in (0.8, 0.25, 0.4))
        return pulse(layout, high_mm=high, rise=rise, each=each, rest=rest, loops=self.times)


@dataclass
class Desk:
    """Shared by all pages of a run."""

    owner: Owner
    token: str
    address: str
    """Of the studio, without the token: http://127.0.0.1:8808."""
    pulse: Pulse = field(default_factory=Pulse)

    def notify(self) -> str:
        """Play the pulse, as a notification asks for; why it could not be, or nothing."""
        if self.owner.skin is None:
            return self.owner.problem or "No wristband is connected."
        try:
            self.owner.play(self.pulse.sequence(self.owner), "pulse")
        except BubbleskinError as error:
            return str(error)
        return ""
