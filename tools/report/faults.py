"""Give simulated bubbles faults and measure how soon the firmware isolates them; count false alarms of sound ones.

python tools/report/faults.py                      # both, for both boards
python tools/report/faults.py --shows 0            # only how soon faults are found
python tools/report/faults.py --sheets 0           # only false alarms

Each fault is given to one bubble in each situation, on sheets that match the tables and on sheets that do not. A
fault without any effect as long as nothing moves (a fill valve that does not open, say) is followed by moves, and
timed from the first pulse that it spoils. The same arguments give the same values.
"""

import argparse
import sys
from dataclasses import dataclass, field

import numpy as np
from rich.console import Console
from rich.progress import track

import bubbleskin as bs

VICTIM = 3
"""The bubble that gets the fault."""
REST = 0.8
"""Seconds until a shape is at rest."""
PATIENCE = 1.0
"""Seconds for which a fault is waited for."""
TARGET = 0.5
"""Seconds within which a faulty bubble is to be isolated."""


@dataclass(frozen=True)
class Injected:
    """A fault of `Plant.inject`; a value of None is what the sensor reads at that moment."""

    text: str
    name: str
    value: float | None


FAULTS = (
    Injected("leak, 5 µJ/ms at 10 mm", "leak", 2.2e-7),
    Injected("leak, 200 µJ/ms at 10 mm", "leak", 9e-6),
    Injected("leak, 500 µJ/ms at 10 mm", "leak", 2.2e-5),
    Injected("off its barb", "pop_off", 1.0),
    Injected("fill valve stuck open", "fill_stuck", 1.0),
    Injected("fill valve stuck closed", "fill_stuck", -1.0),
    Injected("vent valve stuck open", "vent_stuck", 1.0),
    Injected("vent valve stuck closed", "vent_stuck", -1.0),
    Injected("sensor repeats itself", "sensor_stuck", None),
    Injected("sensor absent", "sensor_absent", 1.0),
    Injected("sensor 1 kPa too high", "sensor_bias", 1e3),
    Injected("sensor 6 kPa too high", "sensor_bias", 6e3),
    Injected("sensor 6 kPa too low", "sensor_bias", -6e3),
)

SITUATIONS = {
    "idle": (None, None, 0.0),
    "at rest, 6.5 mm": (6.5, None, 0.0),
    "at rest, 8 mm": (8.0, None, 0.0),
    "at rest, 10.5 mm": (10.5, None, 0.0),
    "held (STOP), 10.5 mm": (10.5, "stop", 0.0),
    "5 → 12 mm at once": (5.0, 12.0, 0.0),
    "7 → 9 mm at once": (7.0, 9.0, 0.0),
    "12 → 6.5 mm at once": (12.0, 6.5, 0.0),
    "6 → 12 mm in 1 s": (6.0, 12.0, 1.0),
}


@dataclass
class Found:
    """What became of one fault in one situation, over all sheets."""

    times: list[float] = field(default_factory=list)
    later: list[float] = field(default_factory=list)
    missed: int = 0
    names: set[str] = field(default_factory=set)
    others: int = 0
    board: set[str] = field(default_factory=set)

    def text(self) -> str:
        """For a cell of the table."""
        parts = []
        if self.times:
            parts.append(f"{max(self.times):.2f}")
        if self.later:
            parts.append(f"move + {max(self.later):.2f}")
        if self.missed:
            parts.append("–" if self.missed > 1 or not parts else f"not on {self.missed} sheet")
        if self.others:
            parts.append(f"others: {self.others}")
        return "; ".join([", ".join(parts), ", ".join(sorted(self.names | self.board))]).strip("; ")


def inject(url: str, fault: Injected, situation: str, found: Found) -> None:
    """One fault on one sheet."""
    with bs.connect(url) as skin:
        board = skin.simulated
        assert board is not None
        show = _Shower(skin)
        _bring_about(skin, show, situation)
        if skin.fault_log():
            raise RuntimeError(f"{situation}: {skin.fault_log()} before the fault")
        value = float(board.plant.sense()[VICTIM]) if fault.value is None else fault.value
        board.inject(fault.name, VICTIM, value)
        time = _wait(skin, fault)
        if time is not None:
            found.times.append(time)
        else:
            later = _wait_for_moves(skin, show, fault)
            if later is None:
                found.missed += 1
            else:
                found.later.append(later)
        skin.sleep(0.6)
        for entry in skin.fault_log():
            if entry.bubble is None:
                found.board.add(entry.name)
            elif entry.bubble == VICTIM:
                found.names.add(entry.name)
            else:
                found.others += 1


class _Shower:
    """Shows a height (mm) of the victim while the other bubbles stay as they are."""

    def __init__(self, skin: bs.Skin) -> None:
        self._skin = skin
        self._heights = np.linspace(6.0, 12.0, skin.info.bubbles)

    def __call__(self, height: float, over: float = 0.0) -> None:
        self._heights[VICTIM] = height
        self._skin.show(self._heights, over=over, wait=False)


def _bring_about(skin: bs.Skin, show: _Shower, situation: str) -> None:
    start, then, over = SITUATIONS[situation]
    skin.sleep(0.1)
    if start is not None:
        show(start)
        skin.sleep(REST)
    if then == "stop":
        skin.stop()
        skin.sleep(0.3)
    elif isinstance(then, float):
        show(then, over)
        skin.sleep(0.05 if not over else 0.3)


def _wait_for_moves(skin: bs.Skin, show: _Shower, fault: Injected) -> float | None:
    """As `_wait`, in one move after the other; None where none of them shows the fault."""
    for height in (13.0, 7.0, 0.0):
        show(height)
        time = _wait(skin, fault)
        if time is not None:
            return time
    return None


def _spoils(fault: Injected, fill: float, vent: float, tick: float) -> bool:
    """Whether what the valves are told makes the fault felt."""
    wanted = {
        ("fill_stuck", 1.0): fill < tick,
        ("fill_stuck", -1.0): fill > 0,
        ("vent_stuck", 1.0): vent < tick,
        ("vent_stuck", -1.0): vent > 0,
    }
    return wanted.get((fault.name, fault.value or 0.0), True)


def _wait(skin: bs.Skin, fault: Injected) -> float | None:
    """Seconds until the victim has a fault, from the first pulse that was spoilt by it; None where it gets none."""
    board = skin.simulated
    assert board is not None
    felt = None
    end = board.time + PATIENCE
    while board.time < end:
        if felt is None and _spoils(fault, *board.pulses[VICTIM], skin.info.tick):
            felt = board.time
        skin.sleep(skin.info.tick)
        for entry in skin.fault_log():
            if entry.bubble == VICTIM:
                return entry.time - (entry.time if felt is None else felt)
    return None


def false_alarms(name: str, spread: float, sheets: int, shows: int, seed: int) -> tuple[int, list[str]]:
    """Random shows, quick and slow, ended early, stopped and vented, on sound bubbles: shows, and what was reported."""
    rng = np.random.default_rng(seed)
    alarms = []
    done = 0
    for sheet in range(sheets):
        with bs.connect(f"sim://{name}?seed={seed + sheet}&spread={spread}") as skin:
            n = skin.info.bubbles
            for _ in range(shows // sheets):
                kind = rng.integers(5)
                low, high = ((5.5, 13.5), (7.0, 9.0), (5.0, 14.0), (5.0, 14.0), (5.0, 14.0))[kind]
                target = np.full(n, rng.uniform(low, high)) if kind == 2 else rng.uniform(low, high, n)
                if kind == 3:
                    target[rng.random(n) < 0.3] = 0.0
                over = float(rng.choice([0.0, 0.0, 0.3, 1.0, 3.0]))
                skin.show(target, over=over, wait=False)
                skin.sleep(rng.uniform(0.2, 2.0) + over * rng.uniform(0, 1))
                end = rng.integers(8)
                if end < 2:
                    skin.stop() if end else skin.vent()
                    skin.sleep(rng.uniform(0.05, 1.5))
                done += 1
            alarms += [f"{name}, spread {spread:g}, sheet {sheet}: {entry}" for entry in skin.fault_log()]
    return done, alarms


def main(arguments: list[str] | None = None) -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--board", action="append", help="wristband7 or wristband19 (default: both)")
    parser.add_argument("--sheets", type=int, default=2, help="with spread, for each fault (default: 2)")
    parser.add_argument(
        "--shows", type=int, default=200, help="without faults, for each board and spread (default: 200)"
    )
    parser.add_argument("--spread", type=float, default=0.1)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--fault", help="only faults whose text has this in it")
    options = parser.parse_args(arguments)
    console = Console(width=170)
    late = 0
    boards = options.board or ["wristband7", "wristband19"]
    faults = [fault for fault in FAULTS if not options.fault or options.fault in fault.text]
    for name in boards if options.sheets else []:
        lines = [f"{name}: s until isolated, the longest; as what", "", "| fault | " + " | ".join(SITUATIONS) + " |"]
        lines.append("|---" * (1 + len(SITUATIONS)) + "|")
        for fault in track(faults, name, console=Console(stderr=True), transient=True):
            cells = []
            for situation in SITUATIONS:
                found = Found()
                urls = [f"sim://{name}?seed={options.seed}"]
                urls += [f"sim://{name}?seed={options.seed + k}&spread={options.spread}" for k in range(options.sheets)]
                for url in urls:
                    inject(url, fault, situation, found)
                late += sum(time > TARGET for time in found.times + found.later)
                cells.append(found.text())
            lines.append(f"| {fault.text} | " + " | ".join(cells) + " |")
        sys.stdout.write("\n".join([*lines, "", ""]))
        sys.stdout.flush()
    if options.sheets:
        console.print(f"{late} of them later than {TARGET:g} s")
    wrong: list[str] = []
    if options.shows:
        for name in boards:
            for spread, sheets in ((0.0, 2), (options.spread, 5)):
                shows, alarms = false_alarms(name, spread, sheets, options.shows, options.seed)
                wrong += alarms
                console.print(
                    f"{name}, spread {spread:g}: {len(alarms)} false alarms in {shows} shows on {sheets} sheets"
                )
    for line in wrong:
        console.print(line)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
