"""Moving pictures: what a sequence looks like, from above and from the side, as GIF or MP4."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout
from bubbleskin.plot.contact import colours, draw_above, draw_side
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


def watch(skin: Skin, sequence: BubbleSequence, *, rate: int = 15, seconds: float = 30.0) -> list[Frame]:
    """Play `sequence` on the simulated wristband behind `skin`; its true shapes, `rate` times a second, to its end.

    At most `seconds` of it. Raises `InvalidInput` where there is no simulated wristband.
    """
    board = skin.simulated
    if board is None:
        raise InvalidInput("A film needs a simulated wristband: nobody sees the true shape of a real one.")
    skin.play(sequence, wait=False)
    begin = board.time
    frames = []
    while board.time - begin < seconds:
        plant = board.plant
        radius = plant.parameters.radius * plant.stretch
        frames.append(Frame(board.time - begin, plant.height_mm, plant.position_m, radius))
        skin.sleep(1 / rate)
        if skin.playing().state == "ended":
            break
    return frames


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
    path = Path(path)
    if len(frames) < 2:
        raise InvalidInput("A film needs at least two frames: give the sequence more time.")
    if path.suffix not in (".gif", ".mp4"):
        raise InvalidInput(f"{path} ends in {path.suffix or 'nothing'}; a film is a .gif or an .mp4.")
    if path.suffix == ".mp4" and not shutil.which("ffmpeg"):
        raise InvalidInput("An .mp4 needs the program ffmpeg, which is not here. Install it, or write a .gif.")
    rate = round((len(frames) - 1) / (frames[-1].time - frames[0].time))
    writer = FFMpegWriter(fps=rate) if path.suffix == ".mp4" else PillowWriter(fps=rate)
    with rc_context(STYLE):
        figure = Figure(figsize=(4.2, 6.0), layout="constrained")
        FigureCanvasAgg(figure)
        above, side = figure.subplots(2, 1, height_ratios=(1.7, 1))
        figure.colorbar(colours(), ax=[above, side], label="height (mm)", shrink=0.6)
        try:
            with writer.saving(figure, str(path), _DPI):
                for done, frame in enumerate(frames, 1):
                    for axes in (above, side):
                        axes.clear()
                    draw_above(above, layout, frame)
                    draw_side(side, layout, frame)
                    above.set_title(f"{title}  {frame.time:.1f} s".strip(), loc="left")
                    writer.grab_frame()
                    progress(done)
        except OSError as error:
            raise InvalidInput(f"Cannot write the film {path}: {error.strerror}.") from None
    return path
