"""The integers of the tick: against floats, against the SDK's table, and never beyond 32 bits."""

import math
import random
from array import array

import numpy as np
import pytest

from bubble_firmware import boards
from bubble_firmware.control import curve, dose, estimate, flow, reference, table, trajectory
from bubble_firmware.control import state_layout as layout
from bubble_firmware.control.bubbles import Bubbles
from bubble_protocol import codec
from bubbleskin import Table, YeohBalloon, build_table

BOARD = boards.load("wristband7")
ATMOSPHERE = 101325.0
AIR_MAX = 400_000  # µJ: keeps every product of the control law within 32 bits


def names_of(module):
    """The places that a module names, as (name, place), in the order in which it names them."""
    return [(name, place) for name, place in vars(module).items() if name.isupper()]


def test_every_place_of_the_state_has_one_name():
    names = names_of(layout)
    places = dict(names)
    order = [name for name, _ in names]
    for first, size in (("SENSOR_ZERO", "ROW_WORDS"), ("KNOT_HEIGHT", "KNOT_WORDS"), ("BUBBLE_COUNT", "BOARD_WORDS")):
        record = order[order.index(first) : order.index(size) + 1]
        assert [places[name] for name in record] == list(range(len(record)))
    assert layout.ROOTS == layout.BOARD_WORDS
    assert 2 * (layout.ROOT_STEPS + 1) == layout.ROWS - layout.ROOTS


def test_the_state_is_in_the_schemas_order():
    """`pack_state` fills in the repeated fields of STATE by place."""
    names = [field[0] for field in codec.BY_NAME["STATE_REPLY"].repeated]
    assert names == ["height_um", "pressure_pa", "target_um", "status", "faults"]


# Air.


def bubbles_with(knots):
    """A board's bubbles, the first one with a table of its own; and its curve, (knots, numbers of a knot)."""
    tables = table.Tables(BOARD.BUBBLES)
    tables.write_size(0, len(knots))
    for index, (height, pressure) in enumerate(knots):
        tables.write_knot(0, index, int(height), int(pressure))
    tables.swap()
    bubbles = Bubbles(BOARD, tables)
    size = bubbles.rows[layout.LAST_SEGMENT] // 4 // layout.KNOT_WORDS + 2
    return bubbles, np.array(bubbles.curves[: size * layout.KNOT_WORDS]).reshape(size, layout.KNOT_WORDS)


def volume(height_um):
    """Of sphere and line, mm³."""
    return math.pi / 6 * (height_um * 1e-3) ** 3 + BOARD.DEAD_VOLUME_MM3


TABLES = {
    name: build_table(YeohBalloon(mu=mu)) for name, mu in (("soft", 30e3), ("nominal", 39.62e3), ("snap-through", 50e3))
} | {"sparse": Table(np.array([5000, 5500, 9000, 14000]), np.array([0, 20000, 21000, 36000]))}


@pytest.mark.parametrize("name", TABLES)
def test_a_curve_says_of_the_table_what_a_sphere_holds(name):
    """Volume and its slope per µm, from 5 to 14 mm, against floats and the exact segment."""
    made = TABLES[name]
    _, knots = bubbles_with(list(zip(made.height_um, made.pressure_pa, strict=True)))
    h = knots[:, layout.KNOT_HEIGHT] / 16
    assert np.diff(h).max() <= 1024
    assert set(made.height_um) <= set(h)
    assert np.abs(knots[:, layout.KNOT_PRESSURE] - np.interp(h, made.height_um, made.pressure_pa)).max() <= 1

    heights = np.arange(5000.0, 14000.0, 7.0)
    exact = 65.536 * volume(heights)
    slope = np.diff(knots[:, layout.KNOT_VOLUME]) / np.diff(h)
    off = (
        np.abs(np.interp(heights, h, knots[:, layout.KNOT_VOLUME]) - exact)
        / slope[np.searchsorted(h, heights, "right") - 1]
    )
    print(f"{name}: volume within {off.max():.1f} µm of height")
    assert off.max() < (35 if name == "sparse" else 6)
    assert knots[:-1, layout.KNOT_SLOPE] == pytest.approx(256 * slope, rel=2e-3)
    rise = 4096 * np.diff(knots[:, layout.KNOT_PRESSURE]) / np.diff(knots[:, layout.KNOT_HEIGHT])
    assert knots[:-1, layout.KNOT_RISE] == pytest.approx(rise.clip(-65536, 65536), abs=1)
    assert knots[:-1, layout.KNOT_RECIPROCAL] == pytest.approx(2**28 / knots[:-1, layout.KNOT_SLOPE], abs=1)


def test_volume_rises_whatever_the_table():
    for knots in extreme_tables(random.Random(0)):
        _, made = bubbles_with(knots)
        assert (np.diff(made[:, layout.KNOT_HEIGHT]) > 0).all()
        assert (np.diff(made[:, layout.KNOT_VOLUME]) > 0).all()
        assert len(made) <= curve.KNOTS_MAX


@pytest.mark.parametrize("name", TABLES)
def test_height_is_what_the_gas_law_says(name):
    """Closed valves, any air and any pressure that its curve may have: volume is air by pressure, whatever the membrane."""
    made = TABLES[name]
    bubbles, _ = bubbles_with(list(zip(made.height_um, made.pressure_pa, strict=True)))
    counts = array("H", [BOARD.SENSOR_ZERO] * (BOARD.BUBBLES + 1))
    for height in range(5200, 14000, 400):
        pressure = np.interp(height, made.height_um, made.pressure_pa) * 1.1
        counts[0] = BOARD.SENSOR_ZERO + round(pressure / BOARD.SENSOR_PA_PER_COUNT)
        pressure = BOARD.SENSOR_PA_PER_COUNT * (counts[0] - BOARD.SENSOR_ZERO)
        bubbles.rows[layout.AIR] = round((pressure + ATMOSPHERE) * volume(height) / 1000)
        bubbles.rows[layout.QUIESCENT] = 0
        bubbles.step(counts, 60000, layout.KEEP_CLOSED)
        assert bubbles.rows[layout.HEIGHT] / 16 == pytest.approx(height, abs=40 if name == "sparse" else 8)


@pytest.mark.parametrize("critical", [77, 128])
def test_roots_are_those_of_iso_6358(critical):
    b = critical / 256
    table = array("i", bytes(8 * (layout.ROOT_STEPS + 1)))
    flow.fill_roots(table, 0, critical)
    flow.vent_roots(table, layout.ROOT_STEPS + 1, critical, int(ATMOSPHERE))
    filling, venting = np.array(table).reshape(2, layout.ROOT_STEPS + 1)

    def root(p1, p2):
        p2 = np.maximum(p2, b * p1)  # choked
        return np.sqrt((p1 - p2) * (p2 + (1 - 2 * b) * p1))

    share = np.linspace(0.04, 0.5, 300)
    assert np.interp(128 * share, np.arange(65), filling) / 2**14 == pytest.approx(root(1.0, 1 - share), rel=3e-3)
    pressure = np.linspace(3000, 42000, 300)
    found = np.interp(pressure / 1024, np.arange(65), venting)
    assert found == pytest.approx(root(pressure + ATMOSPHERE, ATMOSPHERE) / 8, rel=4e-3)


# 32 bits.


class Word(int):
    """An integer that must fit a register of the RP2040, whatever is computed of it."""


def _checked(name):
    compute = getattr(int, name)

    def checked(self, other):
        result = compute(self, other)
        assert -(1 << 31) <= result < 1 << 31, f"{int(self)} {name} {int(other)} is beyond 32 bits"
        return Word(result)

    return checked


for _name in ("add", "sub", "mul", "floordiv", "rshift", "lshift", "and", "or"):
    for _side in ("", "r"):
        setattr(Word, f"__{_side}{_name}__", _checked(f"__{_side}{_name}__"))


class Words:
    """A pointer of viper's: reads words, writes into the array."""

    def __init__(self, view):
        self._view = view

    def __getitem__(self, index):
        if isinstance(index, slice):  # a pointer further on
            assert index.start >= 0
            return Words(self._view[index])
        assert index >= 0
        return Word(self._view[index])

    def __setitem__(self, index, value):
        assert index >= 0
        self._view[index] = value


@pytest.fixture
def checked(monkeypatch):
    """The passes of control compute in words that notice when they overflow."""
    for module in (estimate, reference, trajectory, dose):
        ptr32 = module.ptr32
        monkeypatch.setattr(module, "ptr32", lambda buffer, ptr32=ptr32: Words(ptr32(buffer)))


def extreme_tables(chance):
    """What a commit accepts: heights that rise to 14 mm or more, pressures within the limit, air within its own."""
    top = chance.choice([14000, 16000])
    pressures = [0, 42000]
    yield [(1, 42000), (top, 0)]
    yield [(1, 0), (top - 1, 0), (top, 40000)]
    yield [(1, 42000), (2, 0), (top - 400, 42000), (top, 0)]
    yield [(5000, 0), (top - 701, 0), (top, 40000)]  # as steep as its cap
    for _ in range(12):
        heights = sorted(chance.sample(range(1, top), chance.randrange(1, 40)))
        knots = [(height, chance.choice([*pressures, chance.randrange(42001)])) for height in heights]
        yield [*[knot for knot in knots if knot[0] < 13000 or knot[1] <= 40000], (top, chance.randrange(40001))]


@pytest.mark.medium
@pytest.mark.usefixtures("checked")
@pytest.mark.parametrize("seed", range(2))
def test_nothing_overflows_32_bits(rig7, seed):
    """Any reading, any table and any shape that the firmware accepts; the same on MicroPython is in test_identity."""
    chance = random.Random(seed)
    for knots in extreme_tables(chance):
        for bubble in range(7):
            tables = rig7.app.tables
            tables.write_size(bubble, len(knots))
            for index, (height, pressure) in enumerate(knots):
                tables.write_knot(bubble, index, height, pressure)
        assert tables.first_flaw(BOARD) == -1
        tables.swap()
        rig7.app.bubbles.use_tables()
        for _ in range(4):
            rig7.app.commands.show(
                array("i", [chance.choice([0, 14000, chance.randrange(14001)]) for _ in range(7)]),
                0,
                chance.choice([0, 60000]),
            )
            for bubble in range(7):
                rig7.app.bubbles.clear_faults(bubble)
            for _ in range(12):
                rig7.hal.counts = [chance.choice([9, 160, 1500, 2600, 4086, chance.randrange(4096)]) for _ in range(8)]
                rig7.app.tick()
                assert rig7.app.stats.exceptions == 0, "a word was beyond 32 bits"
