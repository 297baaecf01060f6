"""Bubbles that touch: true tops of the firmware with the host's shows, planned and raw, and what a show costs."""

import logging
import time
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bubbleskin import boards
from bubbleskin.async_skin import AsyncSkin
from bubbleskin.bench.control.contenders import CONDITIONED_MM
from bubbleskin.bench.control.plants import BOARD, KINDS, REAL, Kind, sheet
from bubbleskin.bench.rows import Row, share_of
from bubbleskin.connecting import connect
from bubbleskin.errors import DeviceFault
from bubbleskin.link.link import run_sync
from bubbleskin.sim.board import SimulatedBoard
from bubbleskin.sim.transport import SimulatedTransport
from bubbleskin.skin import Skin

Array = NDArray[np.float64]

_SHEETS, _SHAPES, _WILD, _FRAMES = 6, 6, 20, 240
"""Sheets at full size; of each shapes that can be had, random heights that mostly cannot, frames of a stream."""
_HERTZ = 30.0
_BEGINS = 30
"""Frames of a stream before those that are counted: the bubbles come from flat."""
IDEAL = KINDS[0]
_FRAME_MS = {7: "≤ 10", 19: "≤ 20"}
"""By the number of bubbles."""
_FLAT_S, _STAND_S = 1.5, 1.0
_HIGH_MM = 13.0  # near the limit a show may rather be lower than risk to pass it
_LEAST_MM = 0.1  # of lift, for a shape to count as one of bubbles that touch
_WAITS_S = 4.0
_LOOK_S = 0.05


def rows(size: float = 1.0, seed: int = 1) -> Iterator[Row]:
    """Of ideal and real rubber: shapes that the same sheet has had, asked again; a hill under a pointer; random heights
    against the limit. Then the processor time of one frame of a hill on both boards.
    """
    quiet = logging.getLogger("bubbleskin.surface")
    before = quiet.level
    quiet.setLevel(logging.ERROR)  # what cannot be had is counted, not said
    try:
        for kind in (IDEAL, REAL):
            yield from _of_kind(kind, size, seed)
        for board in boards.NAMES:
            skin = connect(f"sim://{board}")
            costs = 1e3 * np.array([cost for cost, _ in _stream(skin, share_of(_FRAMES, size))])
            name = f"touching, {board}, a frame of a stream of 30 Hz: processor time"
            yield Row(f"{name}, median", float(np.median(costs)), "ms", _FRAME_MS.get(skin.info.bubbles, ""))
            yield Row(f"{name}, 99 of 100 within", float(np.percentile(costs, 99)), "ms")
            rng = np.random.default_rng((seed, *b"touching"))
            most = max(_wild(skin, rng).cost_s for _ in range(share_of(_WILD, size)))
            yield Row(f"touching, {board}, a show of random heights: processor time, most", most, "s")
    finally:
        quiet.setLevel(before)


def _of_kind(kind: Kind, size: float, seed: int) -> Iterator[Row]:
    planned: list[Array] = []
    raw: list[Array] = []
    streamed: list[Array] = []
    high: list[Array] = []
    wild: list[_Wild] = []
    for number in range(share_of(_SHEETS, size)):
        skin = _connected(kind, seed + number)
        rng = np.random.default_rng((seed + number, *b"touching"))
        for had in _shapes(skin, rng, share_of(_SHAPES, size)):
            for plan, errors in ((True, planned), (False, raw)):
                if _shown(skin, had, plan):
                    errors.append(_truth(skin) - had)
                    if plan and had.max() > _HIGH_MM:
                        high.append(errors[-1])
        streamed += [off for _, off in _stream(skin, share_of(_FRAMES, size))]
        wild += [_wild(skin, rng) for _ in range(share_of(_WILD, size))]
        skin.close()
    limit = skin.info.height_max_mm
    for name, errors, rms, most in (
        (f"{len(planned)} shapes that can be had, show", planned, "≤ 0.15", "≤ 0.5"),
        (f"{len(high)} of these with a top above {_HIGH_MM:g} mm, show", high, "", ""),
        ("all of them, plan=False", raw, "", ""),
        ("a stream of 30 Hz, show", streamed, "≤ 0.2", ""),
    ):
        if errors:
            off = np.concatenate(errors)
            yield Row(f"touching, {kind.name}, {name}: RMS", float(np.sqrt(np.mean(off**2))), "mm", rms)
            yield Row(f"touching, {kind.name}, {name}: most", float(np.abs(off).max()), "mm", most)
    shows = f"touching, {kind.name}, {len(wild)} random shows"
    yield Row(f"{shows}: highest top", max(one.highest_mm for one in wild), "mm", f"≤ {limit:g}")
    yield Row(f"{shows}: above {limit:g} mm", sum(one.highest_mm > limit for one in wild), "", "0")
    off = np.concatenate([one.told_off_mm for one in wild])
    yield Row(f"{shows}: told against true, RMS", float(np.sqrt(np.mean(off**2))), "mm")
    yield Row(f"{shows}: told against true, most", float(np.abs(off).max()), "mm")


def _connected(kind: Kind, seed: int) -> Skin:
    one = sheet(kind, seed)
    board = SimulatedBoard(BOARD, seed=seed, parameters=one.parameters)
    board.plant.soften(CONDITIONED_MM)
    skin = Skin(run_sync(AsyncSkin.open(SimulatedTransport(board, f"sim://{BOARD}"), 2.0, simulated=board)))
    skin.sleep(1.0)
    if one.tables and one.trim:
        skin.upload_tables(one.tables, anyway=True)
        skin.upload_trim(one.trim, anyway=True)
    return skin


def _truth(skin: Skin) -> Array:
    assert skin.simulated
    return skin.simulated.height_mm


def _flat(skin: Skin) -> None:
    skin.vent()
    skin.sleep(_FLAT_S)
    skin.clear_faults()


def _shapes(skin: Skin, rng: np.random.Generator, count: int) -> Iterator[Array]:
    """Tops that the sheet has when it is raised in random groups: where bubbles touch, and below the limit."""
    found = 0
    assert skin.simulated
    while found < count:
        _flat(skin)
        heights, group = rng.uniform(5.5, 13.0, skin.info.bubbles), rng.integers(0, 3, skin.info.bubbles)
        for last in range(3):
            skin.show(np.where(group <= last, heights, 0.0), over=0.6, wait=False, plan=False)
            skin.sleep(0.6 + _STAND_S)
        had = _truth(skin)
        lift = np.abs(had - skin.simulated.alone_mm).max()
        if had.max() <= skin.info.height_max_mm and lift > _LEAST_MM and not skin.faults():
            found += 1
            yield had


def _shown(skin: Skin, heights: Array, plan: bool) -> bool:
    """From flat; False where a fault ended it."""
    _flat(skin)
    try:
        skin.show(heights, over=0.5, plan=plan)
    except DeviceFault:
        return False
    skin.sleep(_STAND_S)
    return True


def _stream(skin: Skin, frames: int) -> Iterator[tuple[float, Array]]:
    """A hill, steep enough to be lifted by its flanks, that goes about under a pointer: of each frame what its `show` cost, s,
    and how far the tops are off, (n,) mm."""
    x, y = skin.layout.positions_mm.T
    _flat(skin)
    skin.show(np.full(len(x), 6.0))
    for frame in range(_BEGINS + frames):
        at = 8 * np.cos(frame / 25), 8 * np.sin(frame / 17)
        hill = 6 + 6 * np.exp(-((x - at[0]) ** 2 + (y - at[1]) ** 2) / (2 * 8**2))
        begin = time.process_time()
        skin.show(hill, over=1 / _HERTZ, wait=False)
        cost = time.process_time() - begin
        skin.sleep(1 / _HERTZ)
        if frame >= _BEGINS:
            yield cost, _truth(skin) - hill


class _Wild(NamedTuple):
    """A show of random heights: the highest top on its way, how far told tops are off at its end, (n,), and what it cost."""

    highest_mm: float
    told_off_mm: Array
    cost_s: float


def _wild(skin: Skin, rng: np.random.Generator) -> _Wild:
    """A show of random heights up to the limit, from whatever was there before."""
    heights = rng.uniform(5.0, skin.info.height_max_mm, skin.info.bubbles)
    begin = time.process_time()
    skin.show(heights, wait=False)
    cost = time.process_time() - begin
    highest = 0.0
    for _ in range(round(_WAITS_S / _LOOK_S)):
        skin.sleep(_LOOK_S)
        highest = max(highest, float(_truth(skin).max()))
    told_off = skin.state().height_mm - _truth(skin)
    if skin.faults():
        _flat(skin)
    return _Wild(highest, told_off, cost)
