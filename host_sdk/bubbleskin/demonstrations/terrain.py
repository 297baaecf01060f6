"""The topographic mouse: a terrain lies under the wristband as a map lies under a mouse, and is felt where the pointer is."""

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bubbleskin import checks
from bubbleskin.demonstrations.landscapes import LANDSCAPES
from bubbleskin.device.state import State
from bubbleskin.errors import InvalidInput
from bubbleskin.files import is_image, path_of, read_image
from bubbleskin.layout import Layout
from bubbleskin.shape import shapes
from bubbleskin.shape.heightfield import filled

MODES = ("plain", "slope", "stretched")
"""How a terrain is felt: its elevation; how steep it is; its elevation with the contrast under the pointer raised."""
WIDTH_MM = 160.0
"""Of a terrain from its left edge to its right one, where nobody says another: what a mouse crosses on a desk."""
STRETCH_MAX = 5.0
"""How many times the contrast is raised at most: beyond it a plain would be felt as mountains of nothing."""
_FOOTPRINT = 0.25
"""Standard deviation over pitch of the Gaussian that is as wide as a bubble's round footprint, along x and along y."""
_APART = 2.0
"""Standard deviations by which two heights differ where they are told apart."""


@dataclass(frozen=True, eq=False)
class Patch:
    """What is under the wristband at one place, and what of it can be felt."""

    heights_mm: NDArray[np.float64]
    """As of `Terrain.patch`, (n,)."""
    contrast_mm: float
    """From the lowest bubble to the highest."""
    finest_mm: float
    """The pitch: what is narrower falls between two bubbles."""
    lost_mm: float
    """RMS of the elevation under the wristband that is too fine for its bubbles, in mm of theirs."""
    apart_mm: float | None
    """By how much the heights of two bubbles must differ to be told apart; None where the wristband does not tell its `sd_mm`."""

    @property
    def steps(self) -> float | None:
        """How many heights between the lowest and the highest are told apart; None where nobody knows."""
        return None if not self.apart_mm else self.contrast_mm / self.apart_mm

    def __str__(self) -> str:
        steps = "" if self.steps is None else f", {self.steps:.0f} steps of {self.apart_mm:.2f} mm"
        return (
            f"contrast {self.contrast_mm:.1f} mm{steps}; "
            f"{self.lost_mm:.1f} mm RMS are finer than the bubbles, {self.finest_mm:g} mm apart"
        )


class Terrain:
    """Elevations over a plane, felt through the bubbles of a wristband that is moved over it.

    `elevation`: (rows, columns) in any unit, row 0 at the lowest y; the lowest becomes `low_mm` and the highest `high_mm`.
    Places are in mm from the lower left corner, x to the right and y up; the terrain is `width_mm` wide, and its cells are
    square. Every bubble feels the mean under its own footprint, so that nothing is felt where it is not.
    """

    def __init__(
        self,
        elevation: ArrayLike,
        layout: Layout,
        *,
        name: str = "",
        width_mm: float = WIDTH_MM,
        low_mm: float = shapes.LOW_MM,
        high_mm: float = shapes.HIGH_MM,
    ):
        field = checks.finite("elevation", elevation)
        if field.ndim != 2 or min(field.shape) < 2:
            raise InvalidInput(f"An elevation of shape {field.shape}; a terrain has two rows and two columns at least.")
        self.layout = checks.instance("layout", layout, Layout, "a Layout, such as skin.layout")
        self.name = checks.text("name", name)
        self.width_mm = checks.above_zero("width_mm", width_mm, unit="mm")
        self.low_mm, self.high_mm = checks.number("low_mm", low_mm, 0.0), checks.number("high_mm", high_mm, 0.0)
        if self.low_mm >= self.high_mm:
            raise InvalidInput(f"Heights from {low_mm} to {high_mm} mm are asked; low_mm must be below high_mm.")
        span = np.ptp(field)
        share = (field - field.min()) / span if span else np.zeros(field.shape)
        self.relief_mm: NDArray[np.float64] = self.low_mm + (self.high_mm - self.low_mm) * share
        """What bubbles without end, as small as one likes, would show of it: (rows, columns)."""

    @classmethod
    def named(cls, name: str, layout: Layout, **options: Any) -> Self:
        """One of `LANDSCAPES`, which come with the SDK; `options` as of `Terrain`."""
        checks.one_of("The terrain", name, tuple(LANDSCAPES))
        return cls(LANDSCAPES[name](), layout, name=name, **options)

    @classmethod
    def load(cls, path: str | os.PathLike[str], layout: Layout, *, fill: str | None = None, **options: Any) -> Self:
        """From a picture (bright is high; .tif with numbers too, as GeoTIFF has them), .npy, or a table of numbers.

        The first row of a picture is its upper edge; that of an array has the lowest y. `fill`: 'nearest' gives what a
        file does not know the elevation beside it. `options` as of `Terrain`.
        """
        where = path_of(path, "the terrain")
        if is_image(where):
            field = read_image(where, "the terrain")[::-1]
            if fill is not None:
                field = filled(field, fill)
            checks.refuse_places(f"The terrain {where}", "not known", np.isnan(field))
        else:
            field = shapes.load(where, fill)
        return cls(field, layout, name=Path(where).stem, **options)

    def __repr__(self) -> str:
        wide, deep = self.size_mm
        return f"<Terrain {self.name + ', ' if self.name else ''}{wide:g} by {deep:g} mm, {len(self.layout)} bubbles>"

    @property
    def size_mm(self) -> tuple[float, float]:
        """Its width and its depth, along x and y."""
        return self.width_mm, self._cell_mm * (len(self.relief_mm) - 1)

    @property
    def _cell_mm(self) -> float:
        return self.width_mm / (self.relief_mm.shape[1] - 1)

    @cached_property
    def felt_mm(self) -> NDArray[np.float64]:
        """What one bubble shows at each place: the relief's mean over its footprint, (rows, columns)."""
        from scipy.ndimage import gaussian_filter

        return np.asarray(
            gaussian_filter(self.relief_mm, _FOOTPRINT * self.layout.pitch_mm / self._cell_mm, mode="nearest")
        )

    @cached_property
    def _steepness_mm(self) -> NDArray[np.float64]:
        """The gradient's length at each place, as heights: level ground is the lowest, the steepest place the highest."""
        steep = np.hypot(*np.gradient(self.felt_mm))
        return self.low_mm + (self.high_mm - self.low_mm) * steep / max(steep.max(), 1e-12)

    def patch(self, x_mm: float, y_mm: float, mode: str = "plain") -> NDArray[np.float64]:
        """The height of each bubble with the wristband's middle at (x, y), mm, (n,); what is beyond an edge is as the edge.

        `mode`: one of `MODES`. `plain`: the elevation. `slope`: the steeper the higher, the terrain's steepest place the
        highest. `stretched`: the elevation, its differences under the wristband raised up to `STRETCH_MAX` times until
        they fill the range.
        """
        checks.one_of("mode", mode, MODES)
        heights = self._read(self._steepness_mm if mode == "slope" else self.felt_mm, x_mm, y_mm)
        if mode != "stretched":
            return heights
        low, high = heights.min(), heights.max()
        gain = min(STRETCH_MAX, (self.high_mm - self.low_mm) / max(high - low, 1e-9))
        return (self.low_mm + self.high_mm) / 2 + gain * (heights - (low + high) / 2)

    def look(self, x_mm: float, y_mm: float, mode: str = "plain", state: State | None = None) -> Patch:
        """The patch at (x, y) with its contrast and what the wristband can resolve; `state`: for how well it knows heights."""
        heights = self.patch(x_mm, y_mm, mode)
        sd = None if state is None or state.sd_mm is None else float(np.median(state.sd_mm))
        return Patch(
            heights,
            contrast_mm=float(np.ptp(heights)),
            finest_mm=self.layout.pitch_mm,
            lost_mm=self._lost(x_mm, y_mm),
            apart_mm=None if sd is None else _APART * np.sqrt(2) * sd,
        )

    def _lost(self, x_mm: float, y_mm: float) -> float:
        """RMS of what the footprints smooth away around (x, y)."""
        places = self._around
        fine = self._read(self.relief_mm, x_mm, y_mm, places) - self._read(self.felt_mm, x_mm, y_mm, places)
        return float(np.sqrt(np.mean(fine**2)))

    @cached_property
    def _around(self) -> NDArray[np.float64]:
        """Places under the wristband, eight to a pitch, (k, 2)."""
        pitch = self.layout.pitch_mm
        low = self.layout.positions_mm.min(axis=0) - pitch / 2
        high = self.layout.positions_mm.max(axis=0) + pitch / 2
        x, y = (np.arange(a, b, pitch / 8) for a, b in zip(low, high, strict=True))
        return np.column_stack([one.ravel() for one in np.meshgrid(x, y)])

    def _read(
        self, field: NDArray[np.float64], x_mm: float, y_mm: float, places: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        from scipy.ndimage import map_coordinates

        middle = checks.number("x_mm", x_mm, unit="mm"), checks.number("y_mm", y_mm, unit="mm")
        at = ((self.layout.positions_mm if places is None else places) + middle) / self._cell_mm
        return np.asarray(map_coordinates(field, [at[:, 1], at[:, 0]], order=1, mode="nearest"))
