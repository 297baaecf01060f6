"""Make tests/firmware/golden_traces.json: record simulated boards in many situations, and what the firmware decides.

python tools/record_golden_traces.py              # record all anew: where the plant has changed, other counts come in
python tools/record_golden_traces.py --digests    # the same counts and requests; only what the firmware decides

The file is no generated file that `make generate` would write: it changes where the control law is meant to change, and
a change that is not meant is what it is there to find.
"""

import argparse
import importlib.util
import json
import zlib
from array import array
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bubble_firmware import boards
from bubble_firmware.control.nominal import KNOTS
from bubble_protocol import steps
from bubble_protocol.schema import settings
from bubbleskin.sim import SimulatedBoard
from bubbleskin.sim.board import InProcessFirmware

TEST = Path(__file__).parents[1] / "tests" / "firmware" / "test_golden_traces.py"
spec = importlib.util.spec_from_file_location("golden", TEST)
golden = importlib.util.module_from_spec(spec)
spec.loader.exec_module(golden)


class Recorder:
    """A firmware that keeps the counts that it is given; `pump` says whether the plant's pump obeys."""

    def __init__(self, firmware):
        self.firmware = firmware
        self.counts = []
        self.pump = True

    def tick(self, counts, link):
        self.counts.append(array("H", counts))
        outputs = self.firmware.tick(counts, link)
        return outputs if self.pump else outputs._replace(pump=0, dump=True)

    def close(self):
        self.firmware.close()


class Scenario(NamedTuple):
    """What happens to a simulated board. Times are in s."""

    name: str
    board: str
    seconds: float
    requests: Iterable
    """(time, name, fixed, repeated)."""
    faults: Sequence = ()
    """(time, name, bubble, value)."""
    spread: float = 0.0
    seed: int = 0
    silent: Sequence = ()
    """(from, to) when the host says nothing."""
    pump_fails: float | None = None


def record(scenario):
    """The trace of a scenario."""
    name, board, seconds, requests, faults, spread, seed, silent, pump_fails = scenario
    simulated = SimulatedBoard(board, seed=seed, spread=spread)
    simulated.firmware = recorder = Recorder(InProcessFirmware(simulated.data, golden.BOOT_ID))
    tick_s = simulated.tick_s
    trace = {
        "name": name,
        "board": board,
        "ticks": round(seconds / tick_s),
        "requests": [[round(time / tick_s), *request] for time, *request in requests],
        "silent": [[round(first / tick_s), round(end / tick_s)] for first, end in silent],
    }
    links = golden.frames(trace, simulated.data)
    for tick in range(trace["ticks"]):
        for time, *fault in faults:
            if round(time / tick_s) == tick:
                simulated.inject(*fault)
        if pump_fails is not None:
            recorder.pump = tick * tick_s < pump_fails
        simulated.to_device += links.get(tick, b"")
        simulated.tick()
    trace["counts"] = golden.packed(np.array([counts.tolist() for counts in recorder.counts]))
    return trace


def show(time, heights, over=0.0):
    return (time, "SHOW", [round(1000 * over)], [[int(height)] for height in heights])


def motions(n, seed):
    """Jumps, ramps, STOP, a way back, VENT, another jump."""
    rng = np.random.default_rng(seed)

    def shape(low, high):
        return rng.integers(low, high, n)

    yield show(0.1, shape(5500, 13500))
    yield show(0.6, shape(7000, 9000), 0.5)
    yield show(1.3, shape(5000, 14000))
    for step in range(8):
        yield show(1.8 + 0.05 * step, shape(6000, 12000), 0.05)
    yield (2.5, "STOP", [], [])
    yield show(2.8, [4000, *shape(5000, 10000)[1:]])
    yield show(3.4, [*shape(9000, 14000)[1:], 5000], 1.0)
    yield (4.6, "VENT", [], [])
    yield show(4.9, shape(8000, 9000))


def sequence(n):
    """Ramps of every easing, conditions, a repeat: uploaded and played."""
    rng = np.random.default_rng(5)

    def step(easing, until, ramp, wait, tolerance, then=steps.GO_ON):
        targets = rng.integers(4000, 14000, n)
        targets[rng.random(n) < 0.2] = steps.LEAVE
        return [steps.flags(easing, until, then), ramp, wait, tolerance, *targets.tolist()]

    blank = [0] * (n + 2)
    records = [step(easing, steps.TIME, 173, 31, 0) for easing in range(4)]
    records += [[steps.REPEAT, 2, *blank], *records[:2], [steps.END, 0, *blank]]
    records += [step(1, steps.SETTLE, 90, 1500, 300), step(2, steps.SETTLE, 0, 70, 60)]
    records += [step(0, steps.TIME, 333, 0, 0), step(3, steps.SETTLE, 77, 50, 50, steps.VENT)]
    crc = zlib.crc32(np.array(records, "<u2").tobytes())
    yield (0.1, "SEQUENCE_BEGIN", [7, n, 0, len(records), crc], [])
    for first in range(0, len(records), 4):
        words = [[int(word)] for record in records[first : first + 4] for word in record]
        yield (0.15 + 0.02 * first, "SEQUENCE_WRITE", [7, first], words)
    yield (0.45, "SEQUENCE_ARM", [7], [])
    yield (0.5, "SEQUENCE_START", [7, 0], [])


def tables(n):
    """Tables that snap through, are flat in part, or end early, taken up while bubbles move."""
    ours = [
        [[5000, 0], [7000, 24000], [8000, 23500], [9000, 25000], [14000, 40000]],
        [[5000, 0], [8000, 20000], [11000, 20000], [14000, 30000]],
        [[4000, 500], [14000, 33000]],
    ]
    all_tables = [*ours, *[KNOTS] * (n - len(ours))]
    yield show(0.1, [9000] * n)
    for bubble, knots in enumerate(ours):
        yield (0.3 + 0.05 * bubble, "TABLE_WRITE", [bubble, 0, len(knots)], knots)
    yield (0.6, "TABLE_COMMIT", [zlib.crc32(b"".join(np.array(table, "<u2").tobytes() for table in all_tables))], [])
    yield show(0.8, [7500] * n, 0.3)
    yield show(1.5, [13500] * n)
    yield show(2.2, [8500] * n, 0.5)
    yield (3.0, "VENT", [], [])
    yield (4.5, "TRIM_WRITE", [], [[170 + bubble, 1100, 900 + 10 * bubble, 4000] for bubble in range(n)])
    yield show(4.6, [9500] * n)


def situations():
    """All situations: scenarios for a plant, and traces that need none."""
    for board, n in (("wristband7", 7), ("wristband19", 19)):
        yield Scenario(f"{n} ideal", board, 5.5, motions(n, 1))
        for seed in (1, 2):
            yield Scenario(f"{n} spread {seed}", board, 5.5, motions(n, 10 + seed), spread=0.1, seed=seed)
        yield Scenario(f"{n} sequence", board, 5.0, sequence(n), spread=0.1, seed=3)
        yield Scenario(f"{n} tables", board, 6.0, tables(n), spread=0.05, seed=4)
        hold = [show(0.1, np.linspace(8000, 12000, n)), show(2.0, np.linspace(12000, 8000, n)), (3.0, "CLEAR", [], [])]
        hold += [show(3.2, np.linspace(13000, 9000, n)), (4.5, "VENT", [], [])]
        kinds = [("leak", 4e-7), ("pop_off", 1.0), ("fill_stuck", 1.0), ("fill_stuck", -1.0), ("vent_stuck", 1.0)]
        kinds += [("vent_stuck", -1.0), ("sensor_stuck", 1900.0), ("sensor_absent", 1.0), ("sensor_bias", 9000.0)]
        at_hold = [(1.0 + 0.03 * k, *kinds[k % 9][:1], k, kinds[k % 9][1]) for k in range(n)]
        yield Scenario(f"{n} faults while holding", board, 6.0, hold, at_hold, spread=0.1, seed=5)
        moving = [(2.05 + 0.02 * k, kinds[(k + 3) % 9][0], k, kinds[(k + 3) % 9][1]) for k in range(n)]
        gone = [(2.9, kinds[(k + 3) % 9][0], k, 0.0) for k in range(n)]
        yield Scenario(f"{n} faults while moving", board, 6.0, hold, moving + gone, spread=0.1, seed=6)
        alone = [(1.0, "fill_stuck", 2, 1.0), (1.2, "leak", 0, 5e-8)]
        yield Scenario(f"{n} overfilled", board, 4.0, [*hold[:1], (1.5, "VENT", [], [])], alone, seed=7)
        far = [
            (0.0, "SETTING_WRITE", [], [[settings.BUDGET_KPA_S, 10]]),
            show(0.1, [13000] * n),
            (3.0, "CLEAR", [], []),
        ]
        yield Scenario(f"{n} budget", board, 4.0, far, seed=8)
        yield Scenario(f"{n} supply fails", board, 5.0, hold[:2], pump_fails=0.8, seed=9)
        yield Scenario(f"{n} host silent", board, 4.0, hold[:1], silent=[(0.4, 2.5)], seed=10)
    for board in ("wristband7", "wristband19"):
        for seed in (1, 2, 3):
            yield {
                "name": f"{board[9:]} hostile {seed}",
                "board": board,
                "ticks": 2000,
                "hostile": seed,
                "requests": [],
            }


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--digests", action="store_true", help="keep counts and requests; write the digests anew")
    found = (
        golden.TRACES
        if parser.parse_args().digests
        else [record(one) if isinstance(one, Scenario) else one for one in situations()]
    )
    for trace in found:
        trace["digests"], _ = golden.replay(trace, InProcessFirmware(boards.load(trace["board"]), golden.BOOT_ID))
    golden.PATH.write_text("[\n" + ",\n".join(json.dumps(trace) for trace in found) + "\n]\n", encoding="utf-8")
    print(f"wrote {golden.PATH.name}: {len(found)} traces, {sum(trace['ticks'] for trace in found)} ticks")
