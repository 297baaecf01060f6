"""What all pages of a studio share: the wristband's owner, and how each demonstration is set. Pages keep nothing that matters."""

import asyncio
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

from bubbleskin import patterns
from bubbleskin.demonstrations.buttons import Buttons
from bubbleskin.demonstrations.landscapes import LANDSCAPES
from bubbleskin.demonstrations.pulse import pulse
from bubbleskin.demonstrations.terrain import Terrain
from bubbleskin.errors import BubbleskinError, InvalidInput
from bubbleskin.files import is_image
from bubbleskin.layout import Layout
from bubbleskin.sequence.model import Sequence
from bubbleskin.studio.assistant import Assistant
from bubbleskin.studio.editor import Editor
from bubbleskin.studio.owner import Owner
from bubbleskin.studio.recorder import Recorder
from bubbleskin.studio.widgets import Range

RATE = Range(6.0, 30.0, 1.0, "a minute")
DEPTH = Range(1.0, 7.5, 0.5, "mm")
TABLES = (".npy", ".csv", ".tsv", ".txt")
"""Endings of terrains that are no pictures."""
CELLS_MAX = 1000
"""Along an edge of a terrain that is uploaded; of larger ones every second cell is taken, or every third."""
PATTERN_S = 60.0
"""Seconds of a pattern that are played."""
_OVER_S = 1 / 30
"""In which bubbles go to what is under the pointer now."""


@dataclass
class Pulse:
    """How the pulse is set."""

    rate: float = 12.0
    """Pulses a minute."""
    depth_mm: float = 6.5
    times: int = 3

    def sequence(self, layout: Layout) -> Sequence:
        """The pulse for a wristband of this layout."""
        return pulse(layout, rate_hz=self.rate / 60, depth_mm=self.depth_mm, loops=self.times)


@dataclass
class Ground:
    """The terrain, how it is felt, and where."""

    name: str = next(iter(LANDSCAPES))
    mode: str = "plain"
    terrain: Terrain | None = None
    uploaded: Terrain | None = None
    place: tuple[float, float] = (0.0, 0.0)
    """x, y, mm."""


@dataclass
class Desk:
    """Shared by all pages of a run."""

    owner: Owner
    token: str
    address: str
    """Of the studio, without the token: http://127.0.0.1:8808."""
    recorder: Recorder
    assistant: Assistant = field(init=False)
    pulse: Pulse = field(default_factory=Pulse)
    ground: Ground = field(default_factory=Ground)
    pattern: str = "ripple"
    pressed: list[str] = field(default_factory=list)
    """What the buttons said, a line each, the newest last."""

    def __post_init__(self) -> None:
        self.assistant = Assistant(self.owner)
        self.editor = Editor(self.owner)
        """The sequence that is edited."""

    @property
    def layout(self) -> Layout:
        """Of the wristband that there is."""
        if self.owner.skin is None:
            raise InvalidInput(self.owner.problem or "No wristband is connected.")
        return self.owner.skin.layout

    def notify(self) -> str:
        """Play the pulse, as a notification asks for; why it could not be, or nothing."""
        try:
            self.owner.play(self.pulse.sequence(self.layout), "pulse")
        except BubbleskinError as error:
            return str(error)
        return ""

    async def play_pattern(self) -> str:
        """Play what is typed for a minute; why it could not be, or nothing."""
        try:
            pattern, layout = patterns.parse(self.pattern), self.layout
            self.owner.play(await asyncio.to_thread(pattern.sequence, layout, PATTERN_S), "pattern")
        except BubbleskinError as error:
            return str(error)
        return ""

    # The terrain.

    def choose_terrain(self, name: str) -> None:
        """Feel one of the SDK's terrains, or the one that was uploaded."""
        ground, layout = self.ground, self.layout
        if ground.uploaded and ground.uploaded.name == name:
            own = ground.uploaded
            ground.terrain = own if own.layout == layout else Terrain(own.relief_mm, layout, name=name)
        elif name in LANDSCAPES:
            ground.terrain = Terrain.named(name, layout)
        else:
            return
        wide, deep = ground.terrain.size_mm
        ground.name, ground.place = name, (wide / 2, deep / 2)
        self.feel(*ground.place, 0.0)

    def choose_mode(self, mode: str) -> None:
        """Feel it as one of `bubbleskin.demonstrations.terrain.MODES`."""
        self.ground.mode = mode
        self.feel(*self.ground.place, 0.0)

    def feel(self, x_mm: float, y_mm: float, stamp: float) -> None:
        """The pointer is at (x, y) of the terrain; `stamp`: since when, s since 1970."""
        self.ground.place = float(x_mm), float(y_mm)
        if self.owner.activity == "terrain" and self.ground.terrain:
            self.owner.ask(self.ground.terrain.patch(x_mm, y_mm, self.ground.mode), _OVER_S, stamp)

    async def upload(self, name: str, data: bytes) -> str:
        """Take a terrain from a file; why it could not be, or nothing. It lies in a folder of its own until it has been read."""
        ending = Path(name).suffix.lower()
        if not (ending in TABLES or is_image(Path(name))):
            return f"{ending or 'A file without an ending'} is no terrain; pictures, {', '.join(TABLES)} are."
        title = Path(name).stem[:40] or "terrain"
        try:
            self.ground.uploaded = await asyncio.to_thread(_read, title, ending, data, self.layout)
        except BubbleskinError as error:
            return str(error)
        self.choose_terrain(self.ground.uploaded.name)
        return ""

    # The buttons.

    def new_buttons(self) -> None:
        """All bubbles down, as buttons of the wristband that there is."""
        self._stamp = 0.0
        self.buttons = Buttons(self.layout, lambda heights: self.owner.ask(heights, stamp=self._stamp))
        for bubble in range(len(self.layout)):
            self.buttons.on_press(bubble, self._say_pressed)

    def _say_pressed(self, bubble: int) -> None:
        self.pressed.append(f"{time.strftime('%H:%M:%S')} bubble {bubble}")

    def touch(self, kind: str, bubble: int, stamp: float) -> None:
        """What pointer or keys have done to a bubble: enter, leave, press or paint."""
        if self.owner.activity != "buttons" or not 0 <= bubble < len(self.buttons.layout):
            return
        self._stamp = stamp
        if kind == "press":
            self.buttons.press(bubble)
        elif kind == "paint":
            self.buttons.drag(bubble)
        elif kind == "enter":
            self.buttons.hover(bubble)
        elif self.buttons.hovered == bubble:
            self.buttons.hover(None)


def _read(title: str, ending: str, data: bytes, layout: Layout) -> Terrain:
    """A terrain from a file's bytes; its name is never a path of ours."""
    with tempfile.TemporaryDirectory(prefix="bubbleskin-studio-") as folder:
        path = Path(folder) / f"terrain{ending}"
        path.write_bytes(data)
        try:
            read = Terrain.load(path, layout, fill="nearest")
        except InvalidInput as error:
            raise InvalidInput(str(error).replace(str(path), title + ending)) from None
    step = -(-max(read.relief_mm.shape) // CELLS_MAX)
    terrain = Terrain(read.relief_mm[::step, ::step], layout, name=title)
    terrain.patch(0.0, 0.0, "slope")  # reckoned here, beside the loop
    return terrain
