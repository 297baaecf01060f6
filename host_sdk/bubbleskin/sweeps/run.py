"""A sweep runs: points go to an executor in handfuls, rows come back and are kept at once."""

import logging
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import CancelledError, Executor, Future, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from bubbleskin import checks
from bubbleskin.connecting import connect
from bubbleskin.errors import BubbleskinError, InvalidInput
from bubbleskin.sweeps.rows import Row, Rows, figures
from bubbleskin.sweeps.study import Point, Study
from bubbleskin.sweeps.tasks import check_options, task_of
from bubbleskin.sweeps.workers import processes

Progress = Callable[[int, int], None]
"""Called with how many points are done, and how many there are."""

_HANDFUL_S = 0.5
"""At least this much work goes to a worker at once: handing over costs some milliseconds."""
_ALONE = 64
"""So many points go one by one, to every worker at once: the first of each also pays for what it imports and compiles."""
_Found = tuple[list[Row], float]


def sweep(
    study: "Study | Mapping[str, Any] | str | os.PathLike[str]",
    executor: Executor | None = None,
    *,
    out: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
) -> list[Row]:
    """Run a study's task on each of its wristbands; one row for each, in the study's order.

    `study`: a `Study`, what a file of one says as a dict, or its path. `executor`: any of `concurrent.futures`, or one that
    does as they do, such as `distributed.Client(…).get_executor()`; None is a process for each core. `out`: a .csv or .parquet
    file for the rows. They are kept beside it while the sweep runs: one that was interrupted goes on from there when it is
    asked for again. A row has the point's number, what varies, what the task returned, and `error`, a sentence where it failed.
    """
    if not isinstance(study, Study):
        study = Study.of(study) if isinstance(study, Mapping) else Study.load(study)
    check_options(study.task, study.options)
    rows = Rows(study, None if out is None else Path(out))
    points = study.points()
    with rows, ExitStack() as ours:
        left = [point for point in points if point.number not in rows]
        if progress:
            progress(len(points) - len(left), len(points))
        if left:
            workers = executor or ours.enter_context(processes())
            for found in _results(study, left, workers):
                rows.add(found)
                if progress:
                    progress(len(rows), len(points))
        return rows.finished()


def _results(study: Study, left: list[Point], executor: Executor) -> Iterable[list[Row]]:
    """Rows as they come. The quickest of the first points says how many make a handful, before workers run out of them."""

    def submit(points: list[Point]) -> "Future[_Found]":
        return executor.submit(work, study.task, dict(study.options), points)

    futures: list[Future[_Found]] = []
    try:
        futures += [submit([point]) for point in left[:_ALONE]]
        quickest, told = _HANDFUL_S, set()
        for future in islice(as_completed(futures), (len(futures) + 1) // 2):
            rows, seconds = _outcome(future)
            quickest = min(quickest, seconds)
            told.add(future)
            yield rows
        size = max(1, min(round(_HANDFUL_S / max(quickest, 1e-3)), 64))
        futures += [submit(left[at : at + size]) for at in range(_ALONE, len(left), size)]
        for future in as_completed(future for future in futures if future not in told):
            yield _outcome(future)[0]
    finally:
        for future in futures:
            future.cancel()


def _outcome(future: "Future[_Found]") -> _Found:
    """What a worker has found. A task's own errors are in its rows, so that whatever is raised is of who ran it."""
    try:
        return future.result()
    except BrokenProcessPool:
        said = "A process of the sweep was killed, perhaps for want of memory."
    except CancelledError:
        said = "Those who worked for the sweep have gone: the scheduler does not answer any more, or has been closed."
    except Exception as error:  # whatever kind of executor it is, and whatever it lacks
        said = f"A worker of the sweep failed: {type(error).__name__}: {error}."
    raise BubbleskinError(f"{said} Rows so far are kept; ask for the same again.")


def work(task: str, options: Mapping[str, Any], points: list[Point]) -> _Found:
    """What a worker does with some points: rows, and seconds for each."""
    begin = time.perf_counter()
    with _warnings_unsaid():
        rows = [_row(task, options, point) for point in points]
    return rows, (time.perf_counter() - begin) / len(points)


@contextmanager
def _warnings_unsaid() -> Iterator[None]:
    """Warnings go where a program sends its log, and nowhere by themselves: they do not say of which wristband they are."""
    logger, nowhere = logging.getLogger("bubbleskin"), logging.NullHandler()
    logger.addHandler(nowhere)
    try:
        yield
    finally:
        logger.removeHandler(nowhere)


def _row(task: str, options: Mapping[str, Any], point: Point) -> Row:
    row: Row = {"point": point.number, **point.varied}
    seed = point.varied["seed"]
    try:
        with connect(point.url) as skin:
            found = task_of(task)(skin, np.random.default_rng(int(seed)), **options)
        if not isinstance(found, Mapping):
            raise InvalidInput(f"The task {task} returned {checks.shown(found)}; it returns numbers by their names.")
        row |= {name: checks.number(f"{name} of the task {task}", value) for name, value in found.items()}
        row["error"] = ""
    except BubbleskinError as error:
        row["error"] = str(error)
    except Exception as error:  # a task of one's own; one bad wristband must not take the others' rows
        row["error"] = f"{type(error).__name__}: {error}"
    return row


def describe(rows: list[Row]) -> dict[str, dict[str, float]]:
    """Median, greatest and mean of each number that the task returned."""
    found = {}
    for name in figures(rows):
        values = np.array([row[name] for row in rows if isinstance(row.get(name), float)])
        found[name] = {"mean": float(values.mean()), "median": float(np.median(values)), "most": float(values.max())}
    return found
