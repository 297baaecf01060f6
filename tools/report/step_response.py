"""How well the simulated wristbands take shapes: true heights after steps, measured and printed as one table.

    python tools/report/step_response.py
    python tools/report/step_response.py --shows 50 --sheets 10 --json

Every case is one kind of sheet and one range of heights: the sheet that matches the board's tables, or sheets
with part-to-part spread that nobody has calibrated; heights beside the plateau (5.5 to 7 and 9 to 12.5 mm) or
on it (7 to 9 mm). Shows follow each other without a pause between them, starting at rest; the first shows of
heights beside the plateau are the extremes. The same arguments give the same values.
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
"""mm."""
SOON, LATER = 0.6, 2.0
"""Seconds after the request at which errors are taken."""
NEAR = 0.2
"""mm within which a bubble counts as arrived."""


@dataclass(frozen=True)
class Case:
    """One kind of sheet and one range of heights: a column of the report."""

    board: str
    spread: float
    plateau: bool

    @property
    def sheet(self) -> str:
        """What the bubbles are like, for people."""
        return f"spread {self.spread:g}" if self.spread else "nominal"

    @property
    def heights(self) -> str:
        """The range of heights in mm, for people."""
        return (
            f"{PLATEAU_LOW:g}-{PLATEAU_HIGH:g}"
            if self.plateau
            else f"{LOW:g}-{PLATEAU_LOW:g}, {PLATEAU_HIGH:g}-{HIGH:g}"
        )


@dataclass(frozen=True)
class Statistics:
    """What was measured in one case: heights in mm, times in s, over all bubbles of all shows."""

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
    """Shows in which a bubble was isolated; its errors are counted with the others."""


@dataclass(frozen=True)
class StepResponse:
    """One show: `height` is (ticks, n) mm from the tick after the request, `pulses` whether one began, (ticks, n)."""

    tick: float
    start: NDArray[np.float64]
    target: NDArray[np.float64]
    height: NDArray[np.float64]
    pulses: NDArray[np.bool_]
    faulty: bool

    def at(self, seconds: float) -> int:
        """The index of the tick that ends so long after the request."""
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


def measure(skin: bs.Skin, target: NDArray[np.float64], seconds: float) -> StepResponse:
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
    return StepResponse(tick, start, target, heights, began[..., 0] | began[..., 1], bool(skin.faults()))


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


def statistics(responses: list[StepResponse]) -> Statistics:
    """Put the shows of one case together."""

    def error_at(seconds: float) -> NDArray[np.float64]:
        return np.concatenate([one.height[one.at(seconds)] - one.target for one in responses])

    soon, later = error_at(SOON), error_at(LATER)
    settling = np.concatenate([one.settling() for one in responses])
    rest = [one.pulses[one.at(SOON) + 1 :] for one in responses]
    return Statistics(
        shows=len(responses),
        rms_soon=_rms(soon),
        max_soon=float(np.abs(soon).max()),
        rms_later=_rms(later),
        max_later=float(np.abs(later).max()),
        max_after=max(float(np.abs(one.height[one.at(SOON) :] - one.target).max()) for one in responses),
        overshoot=max(float(one.overshoot().max()) for one in responses),
        settling_median=float(np.median(settling)),
        settling_max=float(settling.max()),
        unsettled=float(np.isinf(settling).mean()),
        pulses_mean=float(np.mean([pulses.mean() for pulses in rest])) / responses[0].tick,
        pulses_max=float(max(one.busiest_second() for one in responses)),
        faults=sum(one.faulty for one in responses),
    )


def _rms(error: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(error**2)))


def print_tables(found_by_case: list[tuple[Case, Statistics]], console: Console) -> None:
    """One table per board, for people: a column per case, narrow enough for a terminal."""
    for board in dict.fromkeys(case.board for case, _ in found_by_case):
        of_board = [(case, found) for case, found in found_by_case if case.board == board]
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


LINES: tuple[tuple[str, Callable[[Statistics], str]], ...] = (
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
    """Run all cases and print what was found."""
    parser = argparse.ArgumentParser(description="Measure how simulated wristbands follow steps in height.")
    parser.add_argument(
        "--board", action="append", help="wristband7 or wristband19; repeat for several (default: both)"
    )
    parser.add_argument("--firmware", choices=("sim", "micropython"), default="sim", help="what runs it (default: sim)")
    parser.add_argument("--shows", type=int, default=20, help="per case, over all its sheets (default: 20)")
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
    try:
        found = run(cases, options)
    except bs.BubbleskinError as error:
        Console(stderr=True).print(f"[red]{error}[/red]", highlight=False)
        return 2 if isinstance(error, bs.InvalidInput) else 1
    if options.json:
        sys.stdout.write(json.dumps([asdict(case) | _without_inf(asdict(one)) for case, one in found], indent=2) + "\n")
    else:
        print_tables(found, console)
    return 0


def run(cases: list[Case], options: argparse.Namespace) -> list[tuple[Case, Statistics]]:
    """What was found in each case."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.0f}/{task.total:.0f} shows"),
        TimeRemainingColumn(),
    )
    found = []
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        bar = progress.add_task("stepping", total=len(cases) * options.shows)
        for case in cases:
            progress.update(bar, description=f"{case.board}, spread {case.spread:g}, {case.heights} mm")
            responses = []
            for response in respond(case, options):
                responses.append(response)
                progress.advance(bar)
            found.append((case, statistics(responses)))
    return found


def respond(case: Case, options: argparse.Namespace) -> Iterator[StepResponse]:
    """The shows of one case, on all its sheets."""
    rng = np.random.default_rng(options.seed)
    sheets = min(options.sheets, options.shows) if case.spread else 1
    for sheet in range(sheets):
        url = f"{options.firmware}://{case.board}?seed={options.seed + sheet}&spread={case.spread}&contact=0"
        shows = options.shows // sheets + (sheet < options.shows % sheets)
        with bs.connect(url) as skin:
            for target in targets(rng, len(skin.layout), case.plateau, shows):
                response = measure(skin, target, options.seconds)
                yield response
                if response.faulty:
                    skin.clear_faults()


def _without_inf(values: dict[str, float]) -> dict[str, float | None]:
    return {name: None if value == np.inf else value for name, value in values.items()}


if __name__ == "__main__":
    sys.exit(main())
