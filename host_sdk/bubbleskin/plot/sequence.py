"""Moving pictures: what a sequence or a recording looks like, from above and from the side, as GIF or MP4."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bubbleskin.device.state import State
from bubbleskin.errors import InvalidInput
from bubbleskin.files import guarded, path_of
from bubbleskin.layout import Layout
from bubbleskin.plot.contact import Above, Side, colours
from bubbleskin.plot.membrane import STYLE
from bubbleskin.sequence.model import Sequence as BubbleSequence
from bubbleskin.skin import Skin

_DPI = 80


class Frame(NamedTuple):
    """Bubbles at one moment, as `draw_above` and `draw_side` want them."""

    time: float
    """s."""
    height_mm: NDArray[np.float64]
    position: NDArray[np.float64]
    """Centres in m, (n, 3)."""
    radius: NDArray[np.float64]
    """m, (n,)."""
    contacts: tuple[()] = ()


def watch(
    skin: Skin,
    sequence: BubbleSequence,
    *,
    rate: int = 15,
    seconds: float = 30.0,
    progress: Callable[[float], None] = lambda time: None,
) -> list[Frame]:
    """Play `sequence` on the simulated wristband behind `skin`; its true shapes, `rate` times a second, to its end.

    Frames are whole hundredths of a second apart, because a GIF counts in those. At most `seconds` of it. `progress` is
    called with the seconds seen so far. Raises `InvalidInput` where there is no simulated wristband.
    """
    board = skin.simulated
    if board is None:
        raise InvalidInput("A film needs a simulated wristband: nobody sees the true shape of a real one.")
    apart = round(100 / rate) / 100
    skin.play(sequence, wait=False)
    begin = board.time
    frames: list[Frame] = []
    while len(frames) * apart < seconds:
        plant = board.plant
        radius = plant.parameters.radius * plant.stretch
        frames.append(Frame(len(frames) * apart, plant.height_mm, plant.position_m, radius))
        progress(frames[-1].time)
        if skin.playing().state == "ended":
            break
        skin.sleep(max(begin + len(frames) * apart - board.time, 0.0))
    return frames


def of_states(layout: Layout, states: Sequence[State], *, rate: int = 15, seconds: float = 30.0) -> list[Frame]:
    """What `states` tell, `rate` times a second, at most `seconds` of it: heights as the wristband knew them."""
    apart = round(100 / rate) / 100
    times = np.array([state.time for state in states])
    frames: list[Frame] = []
    while len(frames) * apart < min(seconds, times[-1] - times[0] + apart):
        state = states[int(np.searchsorted(times, times[0] + len(frames) * apart + 1e-9, side="right")) - 1]
        frames.append(Frame(len(frames) * apart, state.height_mm, *spheres(layout, state)))
    return frames


def spheres(layout: Layout, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centres, (n, 3), and radii, (n,), in m, of bubbles at `state`: above their places, as who pushes whom aside is not told."""
    radius = state.alone_mm / 2000
    return np.column_stack([layout.positions_mm / 1000, state.height_mm / 1000 - radius]), radius


def animate(
    layout: Layout,
    frames: Sequence[Frame],
    path: str | Path,
    *,
    title: str = "",
    progress: Callable[[int], None] = lambda done: None,
) -> Path:
    """Write `frames`, which are equally far apart in time, as a film that plays at that pace; returns its path.

    The ending says which: .gif, or .mp4, which needs ffmpeg. `progress` is called with the frames done so far.
    """
    path = path_of(path, "the film")
    if len(frames) < 2:
        raise InvalidInput("A film needs at least two frames: give the sequence more time.")
    if path.suffix not in (".gif", ".mp4"):
        raise InvalidInput(f"{path} ends in {path.suffix or 'nothing'}; a film is a .gif or an .mp4.")
    if path.suffix == ".mp4" and not shutil.which("ffmpeg"):
        raise InvalidInput("An .mp4 needs the program ffmpeg, which is not here. Install it, or write a .gif.")
    rate = (len(frames) - 1) / (frames[-1].time - frames[0].time) * (1 - 1e-9)  # the writer rounds ms per frame down
    # fps may be a fraction, other than its type says.
    make: Any = FFMpegWriter if path.suffix == ".mp4" else PillowWriter
    writer = make(fps=rate)
    with rc_context(STYLE):
        picture = _Picture(layout)
        with guarded(path, "the film"), writer.saving(picture, str(path), _DPI):
            for done, frame in enumerate(frames, 1):
                picture.draw_frame(frame, f"{title}  {frame.time:.1f} s".strip())
                writer.grab_frame()
                progress(done)
    return path


class _Picture(Figure):
    """The array from above and from the side: what stays is drawn once, and kept as pixels; what moves is drawn over it."""

    def __init__(self, layout: Layout) -> None:
        super().__init__(figsize=(4.2, 6.0), dpi=_DPI, layout="constrained")
        self._pixels = FigureCanvasAgg(self)
        above, side = self.subplots(2, 1, height_ratios=(1.7, 1))
        self.colorbar(colours(), ax=[above, side], label="height (mm)", shrink=0.6)
        self._views = Above(above, layout), Side(side, layout)
        self._title = above.set_title("0.0 s", loc="left")
        # Axes are drawn over what moves, and so with it.
        self._moving = [*self._title_and_spines(above, side), *self._views[0].artists, *self._views[1].artists]
        for artist in self._moving:
            artist.set_animated(True)
        self._pixels.draw()
        self.set_layout_engine("none")  # places are found: they stay
        self._still = self._pixels.copy_from_bbox(self.bbox)

    def _title_and_spines(self, *axes: Axes) -> list[Artist]:
        return [self._title, *(spine for one in axes for spine in one.spines.values())]

    def draw_frame(self, frame: Frame, title: str) -> None:
        """Draw `frame` over what stays."""
        for view in self._views:
            view.update(frame)
        self._title.set_text(title)
        self._pixels.restore_region(self._still)
        for artist in sorted(self._moving, key=Artist.get_zorder):
            self.draw_artist(artist)

    def savefig(self, fname: Any, **options: Any) -> None:
        """Give the pixels as they are: writers of films ask for them so, and would have everything drawn again."""
        fname.write(self._pixels.buffer_rgba())
