"""What can be asked of each wristband of a sweep: tasks by name, and how one of your own is found."""

import importlib
import inspect
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bubbleskin import checks
from bubbleskin.errors import BubbleskinError, InvalidInput
from bubbleskin.skin import Skin

if TYPE_CHECKING:
    from bubbleskin.sim.board import Simulated

Task = Callable[..., Mapping[str, float]]

SETTLED_WRONG_MM = 0.5
"""A bubble that says settled and is further off than this tells an untruth."""
_SHOWN_S = 0.6


def reach(
    skin: Skin,
    random: np.random.Generator,
    *,
    shapes: int = 3,
    low_mm: float = 5.5,
    high_mm: float = 12.0,
    hold_s: float = 10.0,
) -> dict[str, float]:
    """Random shapes, and how far true tops are from what was asked: after 0.6 s and after `hold_s`, mm; faults."""
    board = _simulated(skin)
    soon, late, wrong, settled = [], [], 0, 0
    for _ in range(checks.whole("shapes", shapes, 1, 1000)):
        heights = random.uniform(low_mm, high_mm, skin.info.bubbles)
        skin.show(heights, wait=False)
        skin.sleep(_SHOWN_S)
        soon.append(board.height_mm - heights)
        skin.sleep(max(hold_s - _SHOWN_S, 0.0))
        off = board.height_mm - heights
        says = np.array([status == "settled" for status in skin.state().status])
        late.append(off)
        settled += int(says.sum())
        wrong += int((says & (np.abs(off) > SETTLED_WRONG_MM)).sum())
    return {
        "rms_soon_mm": _rms(soon),
        "rms_mm": _rms(late),
        "most_mm": float(np.abs(late).max()),
        "settled": float(settled),
        "settled_wrong": float(wrong),
        "faults": float(len(skin.faults())),
    }


def step(skin: Skin, random: np.random.Generator, *, low_mm: float = 5.5, high_mm: float = 12.0) -> dict[str, float]:
    """All bubbles from low to high: until the last true top is within 0.3 mm for good, s; the greatest overshoot, mm."""
    board = _simulated(skin)
    n = skin.info.bubbles
    skin.show(np.full(n, low_mm), wait=False)
    skin.sleep(2.0)
    skin.show(np.full(n, high_mm), wait=False)
    ticks = round(2.0 / skin.info.tick)
    heights = np.empty((ticks, n))
    for k in range(ticks):
        skin.sleep(skin.info.tick)
        heights[k] = board.height_mm
    off = np.abs(heights - high_mm).max(axis=1) > 0.3
    last = int(np.flatnonzero(off)[-1]) + 1 if off.any() else 0
    return {"settled_s": last * skin.info.tick, "overshoot_mm": float(heights.max() - high_mm)}


TASKS: dict[str, Task] = {"reach": reach, "step": step}
"""By the names that a study calls them by."""


def task_of(name: str) -> Task:
    """The task that a study names; `InvalidInput` where there is none."""
    if name in TASKS:
        return TASKS[name]
    module, colon, function = name.partition(":")
    if not colon:
        raise InvalidInput(f"There is no task {name!r}; there are {', '.join(TASKS)}, or yours as 'module:function'.")
    try:
        found = getattr(importlib.import_module(module), function)
    except AttributeError as error:
        if error.name == function:
            raise InvalidInput(f"The module {module} has no {function!r}.") from None
        raise InvalidInput(f"The task {name!r} cannot be imported: {error}.") from None
    except Exception as error:  # a module of one's own may fail in any way
        raise InvalidInput(f"The task {name!r} cannot be imported: {error}.") from None
    if not callable(found):
        raise InvalidInput(f"The task {name!r} is no function: {checks.shown(found)}.")
    task: Task = found
    return task


def check_options(name: str, options: Mapping[str, Any]) -> None:
    """`InvalidInput` where there is no such task, or it does not take these options."""
    task = task_of(name)
    try:
        inspect.signature(task).bind(None, None, **options)
    except TypeError as error:
        raise InvalidInput(f"The task {name} does not fit [options]: {error}.") from None
    except ValueError:  # one that does not say what it takes
        return


def _simulated(skin: Skin) -> "Simulated":
    if skin.simulated is None:
        raise BubbleskinError("Only a simulated wristband tells its true heights.")
    return skin.simulated


def _rms(errors: list[NDArray[np.float64]]) -> float:
    return float(np.sqrt(np.mean(np.square(errors))))
