"""Bubbles that touch, as a user meets them: the paper's rigid rule and the compliant model, and the shapes they give."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from copy import copy
from os import PathLike
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bubbleskin.checks import SEED_MAX, finite, instance, number, one_of, positive, whole
from bubbleskin.contact import energy as core
from bubbleskin.contact.continuation import FINE, Outcome, PathFollower, Resolution, ramps
from bubbleskin.contact.relax import BURST, CONVERGED, evaluate, hold, solve
from bubbleskin.contact.shape import Contact, Shape
from bubbleskin.errors import InvalidInput, NoEquilibrium
from bubbleskin.files import parse_json, path_of, read_text
from bubbleskin.layout import Layout
from bubbleskin.membrane import YeohBalloon
from bubbleskin.membrane.balloon import ATMOSPHERE

Array = NDArray[np.float64]
Ramp = Literal["pressure", "height"]

KZ, KXY, KC, KBASE = 10.0, 50.0, 300.0, 3000.0
"""N/m. The preset: with these springs the model gives the paper's three heights (`tools/report/contact.py`)."""

GRIP = 1e5
"""N/m. How stiffly a wristband holds sizes: 1 N of its neighbours makes a bubble 0.02 mm smaller, as its law's dead band does."""

_SIZES = 5.0
"""Sizes that are followed, times the rest height."""

_FILED = ("kz", "kxy", "kc", "kbase", "doubt")

DOUBT = 1.3
"""Springs of a sheet that nobody has measured are taken to be within this factor of the preset's, as drawn by `springs=0.3`."""

LINE_VOLUME = 0.2e-6
"""m³ of air in valve node and tube of the simulated boards."""


class CompliantContact:
    """Elastic bubbles on soft necks that push each other, for any layout: the least energy of `contact/energy.py`.

    `balloon` is one for all or one per bubble. Springs in N/m: `kz` the neck upwards, `kxy` the neck sideways, `kc` the
    contact of two bubbles, `kbase` the base plane. `kick` (m) is the size of the random nudges that find the stable
    branch, `seed` theirs: the same calls give the same bytes.

    Raises `InvalidInput` for springs that are not positive, and for two bubbles in one place.
    """

    def __init__(
        self,
        layout: Layout,
        balloon: YeohBalloon | Sequence[YeohBalloon] | None = None,
        *,
        kz: float = KZ,
        kxy: float = KXY,
        kc: float = KC,
        kbase: float = KBASE,
        kick: float = 1e-7,
        seed: int = 0,
    ) -> None:
        self.layout: Layout = instance("layout", layout, Layout, "a Layout")
        self.balloons = balloons_of(balloon, layout)
        for name, value in (("kz", kz), ("kxy", kxy), ("kc", kc), ("kbase", kbase)):
            positive(name, number(name, value), "N/m")
        self.kz, self.kxy, self.kc, self.kbase = float(kz), float(kxy), float(kc), float(kbase)
        self.kick, self.seed = number("kick", kick), whole("seed", seed, 0, SEED_MAX)
        self.doubt = np.diag(np.full(3, np.log(DOUBT)))
        """How `kz`, `kxy` and `kc` may be off: a row for each way, logarithms of factors, (3, 3). What a sure plan must bear."""
        self.bubbles = _bubble_records(layout, self.balloons)
        gap = layout.positions_mm[:, None] - layout.positions_mm[None]
        close = np.argwhere(np.triu(np.hypot(*gap.transpose(2, 0, 1)) < 1e-3, 1))
        if len(close):
            raise InvalidInput(
                f"Bubbles {close[0][0]} and {close[0][1]} are in one place; the layout must keep them apart."
            )

    @classmethod
    def from_file(
        cls, path: str | PathLike[str], layout: Layout, balloon: YeohBalloon | Sequence[YeohBalloon] | None = None
    ) -> Self:
        """The model with the springs of a file that `ContactFit.save` has written; `InvalidInput` for any other."""
        what = "the file of springs"
        where = path_of(path, what)
        text = read_text(where, what)
        try:
            facts = parse_json(text, "it")
            missing = [name for name in _FILED if not isinstance(facts, dict) or name not in facts]
            if missing:
                raise InvalidInput(f"it has no {missing[0]}.")
            springs = {name: facts[name] for name in ("kz", "kxy", "kc", "kbase")}
            return cls(layout, balloon, **springs).with_doubt(facts["doubt"])
        except InvalidInput as error:
            raise InvalidInput(
                f"{where} is not a file of springs: {error} `bubbleskin fit-contact … -o springs.json` writes one."
            ) from None

    def __repr__(self) -> str:
        return f"<CompliantContact of {len(self)} bubbles>"

    def __len__(self) -> int:
        return len(self.layout)

    @property
    def springs(self) -> tuple[float, float, float, float, float]:
        """`kz`, `kbase`, `kxy`, `kc` and no grip, as in `energy.SPRINGS`."""
        return self.kz, self.kbase, self.kxy, self.kc, 0.0

    def with_seed(self, seed: int) -> Self:
        """The same model with other random nudges."""
        return self._changed(seed=whole("seed", seed, 0, SEED_MAX))

    def with_doubt(self, doubt: ArrayLike) -> Self:
        """The same model whose `kz`, `kxy` and `kc` are known to a factor, one or (3,): 1.3 is 30 %, 1 exactly.

        Where they are known together, such as their ratios better than each, (3, 3) as of `doubt`.
        """
        given = finite("doubt", doubt)
        if given.shape == (3, 3):
            return self._changed(doubt=given.copy())
        if given.shape not in ((), (1,), (3,)) or (given < 1).any():
            raise InvalidInput("Springs are known to a factor of 1 or more: one number, three, or (3, 3) logarithms.")
        return self._changed(doubt=np.diag(np.log(np.broadcast_to(given, (3,)))))

    def with_springs(self, factors: ArrayLike, kick: float, seed: int) -> Self:
        """A sheet that could be this one: `kz`, `kxy` and `kc` times `factors`, (3,), nudged otherwise."""
        kz, kxy, kc = np.array([self.kz, self.kxy, self.kc]) * factors
        return self._changed(kz=float(kz), kxy=float(kxy), kc=float(kc), kick=kick, seed=seed)

    def _changed(self, **values: Any) -> Self:
        other = copy(self)
        vars(other).update(values)
        return other

    def rest(self) -> Shape:
        """Every bubble without pressure."""
        return self.settle(np.zeros((1, len(self))), resolution=Resolution(increments=1))

    def settle(
        self,
        steps: ArrayLike,
        start: Shape | None = None,
        *,
        ramp: Ramp = "pressure",
        resolution: Resolution = FINE,
        strict: bool = False,
    ) -> Shape:
        """Follow `steps`, (k, n) gauge pressures in Pa, one after the other from `start` (flat without one).

        On the way to a step all pressures change in proportion; with `ramp="height"` the heights that the bubbles would
        have alone do, as on a device. The result is where the bubbles are after the last step. An increment that moves
        a bubble too far for the `resolution` is halved; where that does not help any more, it is a snap.

        `Shape.converged` is False where no equilibrium was found, `residual` the force that is left then; with
        `strict` that raises `NoEquilibrium`. Raises `InvalidInput` for pressures that no bubble holds.
        """
        targets = self._pressures(steps)
        one_of("ramp", ramp, ("pressure", "height"))
        self._check(start, resolution)
        begin = np.zeros(len(self)) if start is None else start.pressure
        radii: list[Array] | None = None
        if ramp == "height":
            radii = [self.free_radius(begin, None if start is None else start.radius)]
            for target in targets:
                radii.append(self.free_radius(target, radii[-1]))
        path = ramps(begin, targets, None if radii is None else np.array(radii), self.bubbles)
        follower, step = self._followed(path, start, self.springs, resolution)
        shape = self._shape(follower.outcome(), targets[-1], follower.pairs)
        if strict and not shape.converged:
            how = "a bubble grows without end" if follower.ended == BURST else f"{shape.residual:.1e} N are left"
            raise NoEquilibrium(
                f"No equilibrium on the way to step {step}: {how}. Ask for less pressure, or follow in more increments."
            )
        return shape

    def settle_sizes(self, sizes_mm: ArrayLike, start: Shape | None = None, *, resolution: Resolution = FINE) -> Shape:
        """Follow `sizes_mm`, (k, n): the height that each bubble would have alone, as a wristband holds it among others.

        A wristband meters the air of each bubble, so that its neighbours raise its pressure and push it aside or up, but
        hardly make it smaller. `Shape.pressure` is what its sensor then says. On the way to a step all sizes go straight.
        Sizes below the rest height mean at rest. Raises `InvalidInput` for those that no bubble has, or of another number.
        """
        radii = 0.5e-3 * np.atleast_2d(finite("sizes_mm", sizes_mm))
        if radii.ndim != 2 or radii.shape[1] != len(self) or not len(radii):
            raise InvalidInput(
                f"Sizes are a (k, {len(self)}) array, a height alone in mm per bubble and step; this one is {radii.shape}."
            )
        if (radii < 0).any() or (radii > _SIZES * self.bubbles["outer"]).any():
            raise InvalidInput(f"A size is negative, or above {_SIZES:g} times the rest height of its bubble.")
        radii = np.maximum(radii, self.bubbles["outer"])
        self._check(start, resolution)
        begin = self.bubbles["outer"] if start is None else start.radius
        springs = (*self.springs[:4], GRIP)
        follower, _ = self._followed(ramps(begin, radii, None, self.bubbles), start, springs, resolution)
        outcome = follower.outcome()
        return self._shape(outcome, self._pressure_at(outcome.state[:, 3], radii[-1]), follower.pairs)

    def _pressure_at(self, radius: Array, held: Array) -> Array:
        """Pa inside of bubbles whose radius is `radius` (m) among their neighbours and would be `held` (m) alone."""
        alone = np.empty(len(self))
        hold(np.maximum(radius, self.bubbles["outer"]), self.bubbles, alone)
        return np.maximum(alone, 0.0) + GRIP * (held - radius) / (4 * np.pi * radius**2)

    def _followed(
        self,
        path: Iterable[Callable[[float], Array]],
        start: Shape | None,
        springs: tuple[float, ...],
        resolution: Resolution,
    ) -> tuple[PathFollower, int]:
        """A follower at the end of `path`, and the step that it came to."""
        state = self._flat() if start is None else start.state
        follower = PathFollower(self.bubbles, springs, state, kick=self.kick, seed=self.seed, resolution=resolution)
        step = 0
        for step, held in enumerate(path):
            follower.follow(step, held)
            if follower.ended != CONVERGED:
                break
        return follower, step

    def _check(self, start: Shape | None, resolution: Resolution) -> None:
        if resolution.increments < 1:
            raise InvalidInput(f"A step is followed in 1 or more increments; {resolution.increments} were asked.")
        positive("move_mm", number("move_mm", resolution.move_mm), "mm")
        if start is not None and len(start) != len(self):
            raise InvalidInput(f"The shape to start from has {len(start)} bubbles, the layout {len(self)}.")

    def free_radius(self, pressure: ArrayLike, near: ArrayLike | None = None) -> Array:
        """Outer radius (m) of each bubble if it stood alone at `pressure`, (n,) Pa.

        Where there are several, the one nearest to `near`, (n,) m, or the smallest.
        """
        p = np.broadcast_to(np.asarray(pressure, dtype=float), (len(self),))
        found = np.empty(len(self))
        for balloon in set(self.balloons):
            bubbles = np.flatnonzero([one == balloon for one in self.balloons])
            branches = np.atleast_2d(balloon.heights(p[bubbles])) / 2
            if near is None:
                found[bubbles] = branches[:, 0]
            else:
                off = np.abs(branches - np.asarray(near, dtype=float)[bubbles, None])
                found[bubbles] = branches[np.arange(len(bubbles)), np.nanargmin(off, axis=1)]
        return found

    def free_pressure(self, height_mm: ArrayLike) -> Array:
        """Pressure (Pa) that holds each bubble at `height_mm`, (n,), if it stood alone; 0 at its rest height and below."""
        radius = np.maximum(np.asarray(height_mm, dtype=float) * 0.5e-3, self.bubbles["outer"])
        held = np.empty(len(self))
        hold(radius, self.bubbles, held)
        return np.maximum(held, 0.0)

    def height_by_air(self, shape: Shape, line_volume: float = LINE_VOLUME) -> Array:
        """Height in mm of each bubble alone with the air that it has in `shape`, (n,).

        Air is pressure times volume, of the bubble and of its `line_volume` (m³).
        """
        found = np.empty(len(self))
        for i, balloon in enumerate(self.balloons):
            air = (ATMOSPHERE + shape.pressure[i]) * (balloon.volume(shape.stretch[i]) + line_volume)
            low, high = balloon.stretch_at_height(balloon.rest_height), 8.0
            for _ in range(60):  # Air grows with the stretch: halving cannot miss.
                middle = (low + high) / 2
                more = (ATMOSPHERE + balloon.pressure(middle)) * (balloon.volume(middle) + line_volume) > air
                low, high = (low, middle) if more else (middle, high)
            found[i] = 1e3 * balloon.height(low)
        return found

    def height_slope(self, shape: Shape) -> Array:
        """∂height/∂pressure of the settled `shape`, (n, n) m/Pa: row i, column j is bubble i's height by j's pressure.

        From the implicit function theorem: H ds = 4π R² dP e, H the second derivatives of the energy. Raises
        `NoEquilibrium` if `shape` is not a stable one.
        """
        return self._slope(shape, self.springs, shape.pressure, 4 * np.pi * shape.radius**2)

    def size_slope(self, shape: Shape) -> Array:
        """∂height/∂size of the settled `shape` where sizes are held, (n, n) mm/mm; as `height_slope`."""
        springs = (*self.springs[:4], GRIP)
        return self._slope(shape, springs, shape.radius, np.full(len(self), 0.5 * GRIP))

    def _slope(self, shape: Shape, springs: tuple[float, ...], held: Array, force: Array) -> Array:
        """∂height by what is `held`, (n, n); `force`, (n,), is by how much a radius is pushed per unit of it."""
        n = len(self)
        rhs, out = np.zeros((n, n, 4)), np.zeros((n, n, 4))
        rhs[np.arange(n), np.arange(n), 3] = force
        at = self._follower_at(shape.state, springs)
        if not solve(shape.state, held, self.bubbles, at.springs, at.pairs, rhs, out, 1e-9):
            raise NoEquilibrium("The shape is about to snap: its heights have no slope. Change a pressure a little.")
        return np.asarray((out[:, :, 2] + out[:, :, 3]).T)

    def energy(self, state: Array, pressure: ArrayLike) -> float:
        """Energy (J) of `state`, (n, 4) m, at gauge `pressure`, (n,) Pa."""
        return self._evaluate(state, pressure)[0]

    def gradient(self, state: Array, pressure: ArrayLike) -> Array:
        """Its gradient, (n, 4) N; zero in equilibrium."""
        return self._evaluate(state, pressure)[1]

    def _evaluate(self, state: Array, pressure: ArrayLike) -> tuple[float, Array]:
        state = np.ascontiguousarray(state, dtype=float)
        p = np.array(np.broadcast_to(np.asarray(pressure, dtype=float), (len(self),)))
        at, out = self._follower_at(state, self.springs), np.empty_like(state)
        return float(evaluate(state, p, self.bubbles, at.springs, at.pairs, out)), out

    def _follower_at(self, state: Array, springs: tuple[float, ...]) -> PathFollower:
        """A follower at `state` that knows all pairs which touch there."""
        follower = PathFollower(self.bubbles, springs, state)
        follower.find_pairs_of_state()
        return follower

    def _flat(self) -> Array:
        r = self.bubbles["outer"]
        return np.column_stack([self.bubbles["x"], self.bubbles["y"], r, r])

    def _pressures(self, steps: ArrayLike) -> Array:
        targets = np.atleast_2d(finite("steps", steps))
        if targets.ndim != 2 or targets.shape[1] != len(self) or not len(targets):
            raise InvalidInput(
                f"Steps are a (k, {len(self)}) array, a gauge pressure in Pa per bubble and step; this one is {targets.shape}."
            )
        for balloon in set(self.balloons):  # Each refuses what is negative or more than it holds, in its own words.
            bubbles = [one == balloon for one in self.balloons]
            balloon.stretches(np.array([targets[:, bubbles].min(), targets[:, bubbles].max()]))
        return targets

    def _shape(self, outcome: Outcome, pressure: Array, pairs: NDArray[np.int64]) -> Shape:
        state = outcome.state
        i, j = pairs.T
        overlap = state[i, 3] + state[j, 3] - np.sqrt(((state[i, :3] - state[j, :3]) ** 2).sum(axis=1))
        contacts = tuple(
            Contact(int(i[k]), int(j[k]), self.kc * float(overlap[k]), 1e3 * float(overlap[k]))
            for k in np.flatnonzero(overlap > 0)
        )
        rest = self.bubbles["radius"]
        thick = np.cbrt(1 + (state[:, 3] ** 3 - self.bubbles["outer"] ** 3) / rest**3)
        return Shape(
            height_mm=1e3 * (state[:, 2] + state[:, 3]),
            position=state[:, :3].copy(),
            stretch=np.where(self.bubbles["thick"], thick, state[:, 3] / rest),
            contacts=contacts,
            pressure=np.array(pressure),
            radius=state[:, 3].copy(),
            snaps=outcome.snaps,
            energy=outcome.energy,
            residual=outcome.residual,
            converged=outcome.ended == CONVERGED,
            increments=outcome.increments,
        )


def balloons_of(balloon: YeohBalloon | Sequence[YeohBalloon] | None, layout: Layout) -> tuple[YeohBalloon, ...]:
    """One balloon per bubble; the paper's where none is given."""
    if balloon is None or isinstance(balloon, YeohBalloon):
        return (balloon or YeohBalloon(),) * len(layout)
    balloons = tuple(balloon)
    if len(balloons) != len(layout):
        raise InvalidInput(f"{len(balloons)} balloons for {len(layout)} bubbles: give one for all, or one each.")
    return balloons


def _bubble_records(layout: Layout, balloons: Sequence[YeohBalloon]) -> NDArray[Any]:
    records: NDArray[Any] = np.zeros(len(layout), core.BUBBLE)
    records["x"], records["y"] = layout.positions_mm.T * 1e-3
    for record, balloon in zip(records, balloons, strict=True):
        for name in ("mu", "c2", "c3", "thickness", "radius"):
            record[name] = getattr(balloon, name)
        record["inner"], record["outer"] = balloon.inner_radius, balloon.outer_radius
        record["thick"] = balloon.wall == "thick"
    return records
