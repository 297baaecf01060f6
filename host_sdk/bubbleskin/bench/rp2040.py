"""The firmware's speed on the emulated RP2040, in emulated cycles: the same in every run, and no timing of hardware."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bubble_firmware.control import state_layout as layout
from bubble_firmware.control.bubbles import Bubbles
from bubble_firmware.control.table import Tables
from bubbleskin import boards
from bubbleskin.async_skin import AsyncSkin
from bubbleskin.bench import float_law
from bubbleskin.bench.rows import Row
from bubbleskin.bench.trace import Tick, record
from bubbleskin.errors import BubbleskinError
from bubbleskin.link.link import run_sync
from bubbleskin.sim.rp2040 import open_chip
from bubbleskin.sim.rp2040.chip import CLOCK_HZ, Chip
from bubbleskin.sim.rp2040.prompt import Prompt
from bubbleskin.sim.transport import SimulatedTransport
from bubbleskin.skin import Skin
from bubbleskin.toolchain.frozen import BARE
from bubbleskin.toolchain.rp2040 import firmware

if TYPE_CHECKING:
    from bubbleskin.sim.rp2040.board import Rp2040Board

_US = CLOCK_HZ // 1_000_000  # cycles
_SHARE = 40  # of its period that a whole tick may take, %
_PHASES = (
    ("following ramps", 0.2, 0.05, 0.05),
    ("changing at once", 0.2, 0.05, 0.0),
    ("coming to rest", 0.4, 0.0, 0.0),
    ("at rest", 0.1, 0.0, 0.0),
)
_EDGES = (layout.FIRST_SEGMENT, layout.LAST_SEGMENT)
_CHUNK = 20  # ticks sent to the prompt at once
_LOOK_S = 1e-4
_SAME_US = 20  # so near, two pulses count as one

_HARNESS = """
from array import array
import binascii, machine, time
from bubble_firmware import boards
from bubble_firmware.control import bubbles, table
data = boards.load({board!r})
machine.mem32[0xE000E014] = 0xFFFFFF
machine.mem32[0xE000E010] = 5

@micropython.viper
def now() -> int:
    return ptr32(0xE000E018)[0]

def replay(ticks):
    spent = array("i", bytearray(4 * len(ticks)))
    said = []
    k = 0
    time.sleep_ms(20)  # until USB is quiet
    for heights, over, counts, supply, mode in ticks:
        if heights:
            show(heights, over)
        counts = array("H", binascii.unhexlify(counts))
        step = law.step
        a = now()
        b = now()
        step(counts, supply, mode)
        c = now()
        spent[k] = (b - c & 0xFFFFFF) - (a - b & 0xFFFFFF)
        said.append(decided())
        k += 1
    print(" ".join(map(str, spent)))
    print("\\n".join(said))
"""

_FIXED = """
law = bubbles.Bubbles(data, table.Tables(data.BUBBLES))
def show(heights, over):
    law.set_targets(array("i", heights), 0, over)
def decided():
    return " ".join(map(str, law.pulses))
"""

_FLOAT = """
law = Bubbles(data, {curves!r})
def show(heights, over):
    law.set_targets(heights, over)
def decided():
    return " ".join([str(int(width + 0.5)) for width in law.pulses()])
"""


class Replayed(NamedTuple):
    """What a law on the chip takes and decides: emulated cycles, (ticks,), and pulses in µs, (ticks, 2n)."""

    cycles: NDArray[np.int64]
    pulses: NDArray[np.int64]


def rows(size: float = 1.0) -> Iterator[Row]:
    """Control work against the same law in float bytecode; then whole ticks of both boards. Less `size`, shorter runs."""
    yield from control_rows(boards.DEFAULT, size)
    for board in boards.NAMES:
        yield from tick_rows(board, 5.0 * size)


def control_rows(board: str, size: float = 1.0) -> Iterator[Row]:
    """Control work by phase, at fixed point and in floats.

    A `BubbleskinError` where the chip decides otherwise than the simulator, or the law in floats otherwise than both.
    """
    ticks = record(board, [(name, size * seconds, every, ramp) for name, seconds, every, ramp in _PHASES])
    bare = firmware([BARE])[BARE]
    fixed = replay(board, ticks, bare, _FIXED)
    if fixed.pulses.tolist() != [tick.pulses for tick in ticks]:
        raise BubbleskinError("The emulated chip has not decided what the simulator has: the firmware is at fault.")
    source = Path(float_law.__file__).read_text(encoding="utf-8")
    floats = replay(board, ticks, bare, source + _FLOAT.format(curves=curves(board)))
    same = float(np.mean(np.abs(fixed.pulses - floats.pulses) <= _SAME_US))
    if same < 0.95:
        raise BubbleskinError(
            f"The law in floats decides otherwise in {1 - same:.0%} of all pulses: it is another law."
        )
    bubbles = fixed.pulses.shape[1] // 2
    phase = np.array([tick.phase for tick in ticks])
    for name, *_ in _PHASES:
        spent = fixed.cycles[phase == name] / bubbles / _US
        yield Row(f"control of {board} per bubble and tick, {name}: mean", spent.mean(), "µs emulated", "≤ 6")
        yield Row(f"the same, worst tick ({round(spent.max() * _US)} cycles)", spent.max(), "µs emulated")
        ratio = floats.cycles[phase == name].sum() / fixed.cycles[phase == name].sum()
        yield Row("the same law in float bytecode, times as long", ratio, "×", "≥ 15")
    yield Row(f"pulses of both laws within {_SAME_US} µs", 100 * same, "%", "≥ 95")


def curves(board: str) -> list[list[tuple[float, int, int]]]:
    """The curves of every bubble by the tables of `board`: knots of (height µm, volume mm³, pressure Pa)."""
    data = boards.load(board)
    bubbles = Bubbles(data, Tables(data.BUBBLES))
    found = []
    for i in range(data.BUBBLES):
        first, last = (bubbles.rows[i * layout.ROW_WORDS + edge] // 4 for edge in _EDGES)
        knots = range(first, last + 2 * layout.KNOT_WORDS, layout.KNOT_WORDS)
        places = (layout.KNOT_HEIGHT, layout.KNOT_VOLUME, layout.KNOT_PRESSURE)
        heights, volumes, pressures = ([bubbles.curves[knot + place] for knot in knots] for place in places)
        found.append([(h / 16, v * 1000 / 65536, p) for h, v, p in zip(heights, volumes, pressures, strict=True)])
    return found


def replay(board: str, ticks: list[Tick], uf2: Path, law: str) -> Replayed:
    """Let `law`, a script that makes `law`, `show` and `decided`, live through `ticks` at the prompt of `uf2`."""
    prompt = Prompt(Chip(uf2))
    prompt.run(_HARNESS.format(board=board))
    prompt.run(law)
    cycles: list[int] = []
    pulses: list[list[int]] = []
    for first in range(0, len(ticks), _CHUNK):
        given = [
            (*(tick.show or (None, 0)), tick.counts.tobytes().hex(), tick.supply_pa, tick.mode)
            for tick in ticks[first : first + _CHUNK]
        ]
        spent, *said = prompt.run(f"replay({given!r})\n", seconds=60.0).splitlines()
        cycles += map(int, spent.split())
        pulses += [[int(width) for width in line.split()] for line in said]
    return Replayed(np.array(cycles), np.array(pulses))


def tick_rows(name: str, seconds: float = 5.0) -> Iterator[Row]:
    """Whole ticks of the real UF2 with telemetry at 50 Hz and a new shape at 20 Hz, for so long in emulated time."""
    period = boards.load(name).TICK_US
    busy = load(name, seconds)
    label = f"{name}, whole tick under load"
    yield Row(f"{label}: mean at most", busy.mean_us, "µs emulated", f"≤ {period * _SHARE // 100}")
    yield Row(f"the same, of {period} µs", 100 * busy.mean_us / period, "%", f"≤ {_SHARE}")
    yield Row("longest at most", busy.worst_us, "µs emulated")
    if name == boards.DEFAULT:
        yield Row("mean, of the 1000 µs that 1 kHz would leave", busy.mean_us / 10, "%")
    yield Row("ticks that began late", busy.late, f"of {busy.ticks}", "0")
    yield Row("heap lost", busy.heap_lost, "bytes", "0")
    trips = 1e3 * round_trips(name, max(8, round(12 * seconds)))
    yield Row(
        f"{name} at rest, a state asked for at any moment: told after, median", float(np.median(trips)), "ms emulated"
    )
    yield Row("the longest", float(trips.max()), "ms emulated")


class Load(NamedTuple):
    """What a board does under load. Times are upper edges of bins, see TICKS on the wire."""

    ticks: int
    elapsed_us: float
    """Emulated time in which they were counted."""
    mean_us: float
    worst_us: float
    late: int
    heap_lost: int
    telemetry: int


def load(name: str, seconds: float) -> Load:
    """Run `name` under load: telemetry at 50 Hz and a SHOW of another shape every 50 ms."""
    board, skin = boot(name)
    before, histogram = skin.health(), skin.tick_histogram()
    begun = board.time
    states = burden(board, skin, seconds)
    worked = skin.tick_histogram().worked - histogram.worked
    elapsed_us = 1e6 * (board.time - begun)
    skin.vent()
    after = skin.health()
    edges = (1 + np.arange(len(worked))) * histogram.work_bin * 1e6
    return Load(
        int(worked.sum()),
        elapsed_us,
        float(worked @ edges / worked.sum()),
        float(edges[np.nonzero(worked)[0][-1]]),
        after.late_ticks - before.late_ticks,
        before.heap_free - after.heap_free,
        states,
    )


def round_trips(name: str, count: int) -> NDArray[np.float64]:
    """Emulated seconds from asking for a state to having it, `count` times at random moments, of shapes held, (count,)."""
    board, skin = boot(name)
    skin.show([9.0] * len(skin.layout), wait=False, plan=False)
    skin.sleep(1.0)
    board.tick_s = _LOOK_S  # of the host's looks at its end of the line
    rng = np.random.default_rng(1)
    trips = []
    for wait in rng.uniform(0.01, 0.03, count):
        skin.sleep(wait)
        begun = board.time
        skin.state()
        trips.append(board.time - begun)
    return np.array(trips)


def boot(name: str) -> "tuple[Rp2040Board, Skin]":
    """The emulated board `name` with today's firmware, flat and warm: whatever is made on first use is there."""
    board = open_chip(name, firmware([name])[name])
    skin = Skin(run_sync(AsyncSkin.open(SimulatedTransport(board, f"rp2040://{name}"), 2.0)))
    skin.vent()
    skin.sleep(0.2)
    skin.health()
    return board, skin


def burden(board: "Rp2040Board", skin: Skin, seconds: float) -> int:
    """Keep `board` under the load of `load` for so many emulated seconds; returns how many telemetry messages came."""
    rng = np.random.default_rng(1)
    due = board.time
    end = due + seconds
    states = 0
    for _ in skin.telemetry(50):
        states += 1
        if board.time >= due:
            skin.show(rng.uniform(5.5, 12.5, len(skin.layout)), wait=False, plan=False)
            due += 0.05
        if board.time >= end:
            break
    return states
