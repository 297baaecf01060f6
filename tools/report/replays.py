"""How large full recordings are, how fast they replay, and what a history costs a simulated board: the figures of docs/replay.md.

python tools/report/replays.py [--seconds 60]      # some minutes

Of a replay, and of a tick, the best of three runs counts.
"""

import argparse
import tempfile
import time
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path

import numpy as np

import bubbleskin as bs
from bubbleskin.errors import DeviceRefused, DeviceRestarted
from bubbleskin.sim.board import SimulatedBoard

BOARDS = ("wristband7", "wristband19")
INTERPRETERS = ("cpython", "micropython")
RUNS = 3
TICKS = 4000


def at_rest(skin: bs.Skin, seconds: float) -> None:
    skin.show([9.0] * skin.info.bubbles, wait=False, plan=False)
    skin.sleep(seconds)


def trouble(skin: bs.Skin, seconds: float) -> None:
    """A shape a second; a sensor fails and is mended, power fails, the wristband is told to restart."""
    rng = np.random.default_rng(1)
    board = skin.simulated
    assert board
    moments = {0.2: lambda: skin.inject("sensor", 2, "stuck"), 0.4: lambda: skin.inject("sensor", 2, "healthy")}
    moments |= {0.5: skin.clear_faults, 0.6: board.reset, 0.8: skin.restart}
    due = sorted(moments)
    while board.time < seconds:
        if due and board.time >= due[0] * seconds:
            with suppress(DeviceRestarted):
                moments[due.pop(0)]()
        with suppress(DeviceRefused, DeviceRestarted):
            skin.show(rng.uniform(5.0, 10.5, skin.info.bubbles), over=0.2, wait=False, plan=False)
        with suppress(DeviceRestarted):
            skin.sleep(1.0)


def telemetry(skin: bs.Skin, seconds: float) -> None:
    at_rest(skin, 0.0)
    with closing(skin.telemetry(1 / skin.info.tick)) as states:
        begun = next(states).time
        while next(states).time < begun + seconds:
            pass


CASES: dict[str, tuple[Callable[[bs.Skin, float], None], str]] = {
    "at rest": (at_rest, ""),
    "trouble": (trouble, "loss=0.03&"),
    "telemetry in every tick": (telemetry, ""),
}


def tick_us(board: str, *, kept: bool) -> float:
    """What a tick of a board at rest takes this computer, with its history or without."""
    spent = []
    for _ in range(RUNS):
        simulated = SimulatedBoard(board)
        if kept:
            simulated.keep_history()
        simulated.step(1.0)
        begun = time.perf_counter()
        simulated.step(TICKS * simulated.tick_s)
        spent.append((time.perf_counter() - begun) / TICKS)
        simulated.close()
    return 1e6 * min(spent)


def main() -> None:
    """Record, replay and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0, help="of each recording")
    seconds = parser.parse_args().seconds
    print("| board | what | size (kB a minute) | replay on CPython, times real time | on MicroPython |")
    print("|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for board in BOARDS:
            for name, (live, options) in CASES.items():
                path = Path(folder) / f"{board}-{name.replace(' ', '-')}.jsonl"
                with bs.connect(f"sim://{board}?{options}seed=2&spread=0.1") as skin, skin.record(path, full=True):
                    live(skin, seconds)
                speeds = []
                for interpreter in INTERPRETERS:
                    runs = [bs.replay(path, interpreter) for _ in range(RUNS)]
                    assert all(run.identical for run in runs), runs
                    speeds.append(max(run.duration_s / run.wall_s for run in runs))
                size = path.stat().st_size / 1e3 * 60 / runs[0].duration_s
                print(f"| {board} | {name} | {size:.0f} | {speeds[0]:.0f} | {speeds[1]:.0f} |", flush=True)
    print("\n| a tick of a board at rest (µs) | without a history | with one |\n|---|---|---|")
    for board in BOARDS:
        print(f"| {board} | {tick_us(board, kept=False):.1f} | {tick_us(board, kept=True):.1f} |", flush=True)


if __name__ == "__main__":
    main()
