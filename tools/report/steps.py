"""How well the simulated wristbands take shapes: true heights after steps, measured and printed as one table.

    python tools/report/steps.py
    python tools/report/steps.py --shows 50 --sheets 10 --json

Every row is one kind of sheet and one range of heights: the sheet that matches the board's tables, or sheets
with part-to-part spread that nobody has calibrated; heights beside the plateau (5.5 to 7 and 9 to 12.5 mm) or
on it (7 to 9 mm). Shows follow each other without a pause between them, starting at rest; the first rows of
heights beside the plateau are the extremes. The same arguments give the same figures.
"""

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

import bubbleskin as bs

LOW, PLATEAU_LOW, PLATEAU_HIGH, HIGH = 5.5, 7.0, 9.0, 12.5
SOON, LATER = 0.6, 2.0
NEAR = 0.2
"""mm within which a bubble counts as arrived."""


@dataclass(frozen=True)
class Case:
    """One row of the report."""

    board: str
    spread: float
    plateau: bool

    @property
    def sheet(self) -> str:
        """What the bubbles are like, in words."""
        return f"spread {self.spread:g}" if self.spread else "nominal"

    @property
    def heights(self) -> str:
        """The range of heights, in words."""
        return (
            f"{PLATEAU_LOW:g}-{PLATEAU_HIGH:g}"
            if self.plateau
            else f"{LOW:g}-{PLATEAU_LOW:g}, {PLATEAU_HIGH:g}-{HIGH:g}"
        )


@dataclass(frozen=True)
class Trim:
    """What was measured in one row: heights in mm, times in s, over all bubbles of all shows."""

    shows: int
    rms_soon: float
    max_soon: float
    rms_later: float
    max_later: float
    max_after: float
    """The largest error at any time from SOON to the end of the show."""
    overshoot: float
    settling_median: float
    """Time after which a bubble stays within NEAR of its target."""
    settling_max: float
    """Infinite where a bubble is not there at the end."""
    unsettled: float
    """Share of bubbles not within NEAR at the end."""
    pulses_mean: float
    """Valve pulses per bubble and second, from SOON on."""
    pulses_max: float
    """Of the busiest bubble in its busiest second."""
    faults: int
    """Shows in which a bubble was isolated; its errors are in the figures."""


@dataclass(frozen=True)
class Step:
    """One show: `height` is (ticks, n) mm from the tick after the request, `pulses` whether one began, (ticks, n)."""

    tick: float
    start: NDArray[np.float64]
    target: NDArray[np.float64]
    height: NDArray[np.float64]
    pulses: NDArray[np.bool_]
    faulty: bool

    def at(self, seconds: float) -> int:
        """The row that stands for so long after the request."""
        return min(round(seconds / self.tick), len(self.height)) - 1

    def settling(self) -> NDArray[np.float64]:
        """When each bubble came within NEAR for good, s; infinite where it did not."""
        away = np.abs(self.height - self.target) > NEAR
        last = len(away) - np.argmax(away[::-1], axis=0)
        return np.where(away.any(axis=0), np.where(away[-1], np.inf, last * self.tick), 0.0)

    def overshoot(self) -> NDArray[np.float64]:
        """How far each bubble went beyond its target, mm."""
        way = np.sign(self.target - self.start)
        return np.maximum(((self.height - self.target) * way).max(axis=0), 0.0)

    def busiest_second(self) -> int:
        """Most pulses of one bubble within a second at rest."""
        second = round(1 / self.tick)
        sums = np.cumsum(
            np.vstack([np.zeros_like(self.pulses[:1]), self.pulses[self.at(SOON) + 1 :]]), axis=0, dtype=int
        )
        return int((sums[second:] - sums[:-second]).max(initial=0))


def measure(skin: bs.Skin, target: NDArray[np.float64], seconds: float) -> Step:
    """Show `target` and watch the true heights tick by tick."""
    board = skin.simulated
    assert board is not None
    tick = skin.info.tick
    start = board.height_mm
    skin.show(target, wait=False)
    ticks = round(seconds / tick)
    heights = np.empty((ticks, len(target)))
    energised = np.empty((ticks, len(target), 2))
    for k in range(ticks):
        heights[k], energised[k] = board.height_mm, board.pulses
        skin.sleep(tick)
    held = np.zeros(energised.shape, bool)  # a valve still on from the tick before begins no pulse
    held[1:] = energised[:-1] >= tick
    began = np.logical_and(energised > 0, ~held)
    return Step(tick, start, target, heights, began[..., 0] | began[..., 1], bool(skin.faults()))


def targets(rng: np.random.Generator, n: int, plateau: bool, shows: int) -> Iterator[NDArray[np.float64]]:
    """Heights for `shows` shows: the extremes first where they are in range, then at random."""
    if plateau:
        extremes: list[NDArray[np.float64]] = []
    else:
        other = np.where(np.arange(n) % 2, LOW, HIGH)
        extremes = [np.full(n, HIGH), np.full(n, LOW), other, LOW + HIGH - other]
    for k in range(shows):
        if k < len(extremes):
            yield extremes[k]
        elif plateau:
            yield rng.uniform(PLATEAU_LOW, PLATEAU_HIGH, n)
        else:
            drawn = rng.uniform(LOW, HIGH - (PLATEAU_HIGH - PLATEAU_LOW), n)
            yield np.where(drawn < PLATEAU_LOW, drawn, drawn + PLATEAU_HIGH - PLATEAU_LOW)


def figures(steps: list[Step]) -> Trim:
    """Put the shows of one row together."""

    def error_at(seconds: float) -> NDArray[np.float64]:
        return np.concatenate([step.height[step.at(seconds)] - step.target for step in steps])

    soon, later = error_at(SOON), error_at(LATER)
    settling = np.concatenate([step.settling() for step in steps])
    rest = [step.pulses[step.at(SOON) + 1 :] for step in steps]
    return Trim(
        shows=len(steps),
        rms_soon=_rms(soon),
        max_soon=float(np.abs(soon).max()),
        rms_later=_rms(later),
        max_later=float(np.abs(later).max()),
        max_after=max(float(np.abs(step.height[step.at(SOON) :] - step.target).max()) for step in steps),
        overshoot=max(float(step.overshoot().max()) for step in steps),
        settling_median=float(np.median(settling)),
        settling_max=float(settling.max()),
        unsettled=float(np.isinf(settling).mean()),
        pulses_mean=float(np.mean([pulses.mean() for pulses in rest])) / steps[0].tick,
        pulses_max=float(max(step.busiest_second() for step in steps)),
        faults=sum(step.faulty for step in steps),
    )


def _rms(error: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(error**2)))


def print_tables(rows: list[tuple[Case, Trim]], console: Console) -> None:
    """One table per board, for people: a column per case, narrow enough for a terminal."""
    for board in dict.fromkeys(case.board for case, _ in rows):
        of_board = [(case, found) for case, found in rows if case.board == board]
        table = Table(title=f"{board}: true heights after a step", title_justify="left")
        table.add_column("mm, where no unit is given")
        for case, _ in of_board:
            table.add_column(f"{case.sheet}\n{case.heights} mm", justify="right")
        for name, text in LINES:
            table.add_row(name, *(text(found) for _, found in of_board))
        console.print(table)
    console.print(
        "Over all bubbles of all shows. 'never': a bubble that was not within "
        f"{NEAR:g} mm at the end of its show. Pulses at rest are those from {SOON:g} s on."
    )


LINES: tuple[tuple[str, Callable[[Trim], str]], ...] = (
    ("shows", lambda found: str(found.shows)),
    (f"RMS error at {SOON:g} s", lambda found: f"{found.rms_soon:.3f}"),
    (f"largest error at {SOON:g} s", lambda found: f"{found.max_soon:.3f}"),
    (f"RMS error at {LATER:g} s", lambda found: f"{found.rms_later:.3f}"),
    (f"largest error at {LATER:g} s", lambda found: f"{found.max_later:.3f}"),
    (f"largest error from {SOON:g} s on", lambda found: f"{found.max_after:.3f}"),
    ("largest overshoot", lambda found: f"{found.overshoot:.3f}"),
    (f"within {NEAR:g} mm for good, median", lambda found: _seconds(found.settling_median)),
    (f"within {NEAR:g} mm for good, last", lambda found: _seconds(found.settling_max)),
    (f"not within {NEAR:g} mm at the end", lambda found: f"{found.unsettled:.0%}"),
    ("pulses at rest, mean", lambda found: f"{found.pulses_mean:.2f} /s"),
    ("pulses at rest, most in 1 s", lambda found: f"{found.pulses_max:.0f}"),
    ("shows with a fault", lambda found: str(found.faults)),
)


def _seconds(value: float) -> str:
    return "never" if np.isinf(value) else f"{value:.2f} s"


def main(arguments: list[str] | None = None) -> int:
    """Run all rows and print them."""
    parser = argparse.ArgumentParser(description="Measure how simulated wristbands follow steps in height.")
    parser.add_argument(
        "--board", action="append", help="wristband7 or wristband19; repeat for several (default: both)"
    )
    parser.add_argument("--firmware", choices=("sim", "micropython"), default="sim", help="what runs it (default: sim)")
    parser.add_argument("--shows", type=int, default=20, help="per row, over all its sheets (default: 20)")
    parser.add_argument("--sheets", type=int, default=5, help="different sheets with spread (default: 5)")
    parser.add_argument("--spread", type=float, default=0.1, help="of the sheets that have some (default: 0.1)")
    parser.add_argument("--seconds", type=float, default=10.6, help="length of a show (default: 10.6)")
    parser.add_argument("--seed", type=int, default=1, help="of heights, sheets and sensor noise (default: 1)")
    parser.add_argument(
        "--json", action="store_true", help="print JSON instead of a table; null for a bubble that never settled"
    )
    options = parser.parse_args(arguments)
    if options.shows < 1 or options.sheets < 1 or options.seconds <= LATER:
        parser.error(f"at least one show on one sheet, of more than {LATER:g} s")
    cases = [
        Case(board, spread, plateau)
        for board in options.board or ("wristband7", "wristband19")
        for spread in (0.0, options.spread)
        for plateau in (False, True)
    ]
    console = Console(stderr=options.json)
    rows: list[tuple[Case, Trim]] = []
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.0f}/{task.total:.0f} shows"),
        TimeRemainingColumn(),
    )
    try:
        with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
            bar = progress.add_task("stepping", total=len(cases) * options.shows)
            for case in cases:
                progress.update(bar, description=f"{case.board}, spread {case.spread:g}, {case.heights} mm")
                rng = np.random.default_rng(options.seed)
                sheets = min(options.sheets, options.shows) if case.spread else 1
                steps: list[Step] = []
                for sheet in range(sheets):
                    url = (
                        f"{options.firmware}://{case.board}?seed={options.seed + sheet}&spread={case.spread}&contact=0"
                    )
                    shows = options.shows // sheets + (sheet < options.shows % sheets)
                    with bs.connect(url) as skin:
                        for target in targets(rng, len(skin.layout), case.plateau, shows):
                            steps.append(measure(skin, target, options.seconds))
                            progress.advance(bar)
                            if steps[-1].faulty:
                                skin.clear_faults()
                rows.append((case, figures(steps)))
    except bs.BubbleskinError as error:
        Console(stderr=True).print(f"[red]{error}[/red]", highlight=False)
        return 2 if isinstance(error, bs.InvalidInput) else 1
    if options.json:
        found = [{name: None if value == np.inf else value for name, value in asdict(f).items()} for _, f in rows]
        sys.stdout.write(
            json.dumps([asdict(case) | f for (case, _), f in zip(rows, found, strict=True)], indent=2) + "\n"
        )
    else:
        print_tables(rows, console)
    return 0


if __name__ == "__main__":
    sys.exit(main())
