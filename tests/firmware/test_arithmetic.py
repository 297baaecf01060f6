"""The integers of the tick: against floats, against the SDK's table, and never beyond 32 bits."""

import math
import random
from array import array
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bubble_firmware import boards
from bubble_firmware.control import curve, nominal, table
from bubble_firmware.control import step as control
from bubble_firmware.control.bubbles import Bubbles
from bubble_firmware.safety import fault_monitor
from bubble_protocol import codec
from bubble_protocol.schema import faults, modes, statuses
from bubbleskin import Table, YeohBalloon, build_table

BOARD = boards.load("wristband7")
ATMOSPHERE = 101325.0

SCHEMA = [entry[1].upper() for entry in (*modes.MODES, *statuses.STATUSES, *faults.FAULTS)]
REPEATED = [name for name in SCHEMA if hasattr(control, name)]


def test_what_control_repeats_of_the_schema_is_the_schemas():
    """It repeats them because MicroPython's compiler folds constants of the same module only."""
    said = {**vars(modes), **vars(statuses), **vars(faults)}
    assert {name: getattr(control, name) for name in REPEATED} == {name: said[name] for name in REPEATED}
    known = {name: said[name] for name in SCHEMA if hasattr(fault_monitor, name)}
    assert {name: getattr(fault_monitor, name) for name in known} == known
    assert set(SCHEMA) <= {*REPEATED, *known, "IDLE", "HOLDING", "BOOT", "VENTING", "FAULTED"}


def test_what_the_guard_repeats_of_control_is_controls():
    lines = Path(fault_monitor.__file__).read_text(encoding="utf-8").split("# From the schema")[0].splitlines()
    names = [line.split(" = const(")[0] for line in lines if " = const(" in line]
    assert len(names) > 15
    assert {name: getattr(fault_monitor, name) for name in names} == {name: getattr(control, name) for name in names}


def test_the_guards_rows_do_not_overlap():
    lines = Path(fault_monitor.__file__).read_text(encoding="utf-8").splitlines()
    names = [line.split(" = const(")[0] for line in lines if " = const(" in line]
    for first, end in (("WAS_AIR", "GUARD"), ("ALLOWED", "NUMBERS")):
        row = names[names.index(first) : names.index(end) + 1]
        assert [getattr(fault_monitor, name) for name in row] == list(range(len(row)))


def test_rows_do_not_overlap():
    """Every place of a bubble's row and of the board's numbers has one name."""
    lines = Path(control.__file__).read_text(encoding="utf-8").splitlines()
    names = [line.split(" = const(")[0] for line in lines if " = const(" in line]
    row = names[names.index("ZERO") : names.index("SETPOINT")]
    places = [getattr(control, name) for name in row]
    assert places == list(range(len(row)))
    record = max(control.SEGMENT, control.SLOPE, control.MODEL, control.CONTENT)
    assert record + 1 == control.SETPOINT - control.HEIGHT
    rest = names[names.index("START") : names.index("ROW")]
    assert [getattr(control, name) for name in rest] == list(range(control.SETPOINT + record + 1, control.ROW))
    board = names[names.index("N") : names.index("BOARD")]
    assert [getattr(control, name) for name in board] == list(range(control.BOARD))
    assert control.ROOTS == control.BOARD
    assert len(curve.roots(128)) == 2 * (control.STEPS + 1) == control.ROWS - control.ROOTS
    knot = [getattr(control, name) for name in ("H", "A", "P", "S", "R", "KNOT")]
    assert knot == [getattr(curve, f"_{name}") for name in ("H", "A", "P", "S", "R", "KNOT")] == list(range(6))


def test_the_state_is_in_the_schemas_order():
    """`gather` fills in the repeated fields of STATE by place."""
    names = [field[0] for field in codec.BY_NAME["STATE_REPLY"].repeated]
    assert names == ["height_um", "pressure_pa", "target_um", "status", "faults"]


# Tables.


def packed(heights, pressures):
    return bytearray(np.stack([heights, pressures], axis=1).astype("<u2").tobytes())


@st.composite
def any_table(draw):
    heights = sorted(draw(st.sets(st.integers(1, 16000), min_size=2, max_size=64)))
    pressures = draw(st.lists(st.integers(0, 42000), min_size=len(heights), max_size=len(heights)))
    return Table(np.array(heights), np.array(pressures))


@settings(max_examples=40)
@given(any_table(), st.lists(st.integers(0, 20000), max_size=30), st.integers(0, 3))
def test_a_tables_pressure_is_the_sdks(mine, heights, first):
    knots = bytearray(4 * first) + packed(mine.height_um, mine.pressure_pa)
    for height in [*heights, *mine.height_um.tolist()]:
        assert table.pressure_at(knots, first, len(mine), height) == mine.pressure_at(height)


def test_on_micropython_too(micropython):
    said = micropython(
        """
        from bubble_firmware.control import nominal, table
        knots = bytearray(b"".join(h.to_bytes(2, "little") + p.to_bytes(2, "little") for h, p in nominal.KNOTS))
        total = 0
        for height in range(4000, 15000):
            total = (total * 31 + table.pressure_at(knots, 0, len(nominal.KNOTS), height)) % 1000003
        print(total)
        """
    )
    mine = Table(*np.array(nominal.KNOTS).T)
    total = 0
    for height in range(4000, 15000):
        total = (total * 31 + mine.pressure_at(height)) % 1000003
    assert int(said) == total


# Air.


def bubbles_with(knots):
    """A board's bubbles, the first one with a table of its own; and its curve, (knots, numbers of a knot)."""
    tables = table.Tables(BOARD.BUBBLES)
    tables.write_size(0, len(knots))
    for index, (height, pressure) in enumerate(knots):
        tables.write_knot(0, index, int(height), int(pressure))
    tables.swap()
    bubbles = Bubbles(BOARD, tables)
    size = bubbles._rows[control.LAST] // 4 // control.KNOT + 2
    return bubbles, np.array(bubbles._curves[: size * control.KNOT]).reshape(size, control.KNOT)


def air(height_um, pressure):
    """pV of sphere and line, µJ."""
    volume = math.pi / 6 * (height_um * 1e-3) ** 3 + BOARD.DEAD_VOLUME_MM3
    return (pressure + ATMOSPHERE) * volume / 1000


TABLES = {
    name: build_table(YeohBalloon(mu=mu)) for name, mu in (("soft", 30e3), ("nominal", 39.62e3), ("snap-through", 50e3))
} | {"sparse": Table(np.array([5000, 5500, 9000, 14000]), np.array([0, 20000, 21000, 36000]))}


@pytest.mark.parametrize("name", TABLES)
def test_a_curve_says_of_the_table_what_a_sphere_holds(name):
    """pV in µJ and its slope in µJ/µm, from 5 to 14 mm, against floats and the exact segment."""
    made = TABLES[name]
    _, knots = bubbles_with(list(zip(made.height_um, made.pressure_pa, strict=True)))
    h = knots[:, control.H] / 16
    assert np.diff(h).max() <= 1024
    assert set(made.height_um) <= set(h)
    assert np.abs(knots[:, control.P] - np.interp(h, made.height_um, made.pressure_pa)).max() <= 1

    heights = np.arange(5000.0, 14000.0, 7.0)
    exact = air(heights, np.interp(heights, made.height_um, made.pressure_pa))
    slope = np.diff(knots[:, control.A]) / np.diff(h)
    off = np.abs(np.interp(heights, h, knots[:, control.A]) - exact) / slope[np.searchsorted(h, heights, "right") - 1]
    print(f"{name}: air within {off.max():.1f} µm of height")
    assert off.max() < (35 if name == "sparse" else 6)
    assert knots[:-1, control.S] == pytest.approx(256 * slope, rel=1e-3)
    assert knots[:-1, control.R] == pytest.approx(2**28 / knots[:-1, control.S], abs=1)


def test_air_rises_whatever_the_table():
    for knots in extreme_tables(random.Random(0)):
        _, made = bubbles_with(knots)
        assert (np.diff(made[:, control.H]) > 0).all()
        assert (np.diff(made[:, control.A]) > 0).all()
        assert made[:, control.A].max() < control.AIR_MAX
        assert len(made) <= curve.KNOTS_MAX


@pytest.mark.parametrize("name", ["soft", "nominal", "sparse"])
def test_pressure_is_read_back_as_the_tables_height(name):
    """At rest the sensor alone says how high a bubble is: within what its counts resolve, where there is one height."""
    made = TABLES[name]
    bubbles, _ = bubbles_with(list(zip(made.height_um, made.pressure_pa, strict=True)))
    counts = array("H", [BOARD.SENSOR_ZERO] * (BOARD.BUBBLES + 1))
    for step in range(0, int(made.pressure_pa.max()) // BOARD.SENSOR_PA_PER_COUNT, 7):
        counts[0] = BOARD.SENSOR_ZERO + step
        for _ in range(9):
            bubbles.step(counts, 60000, modes.IDLE)
        pressure = step * BOARD.SENSOR_PA_PER_COUNT
        assert (
            bubbles._rows[control.HEIGHT] / 16
            == pytest.approx(np.interp(pressure, made.pressure_pa, made.height_um), abs=8 if name == "sparse" else 4)
            or name == "soft"
        )


@pytest.mark.parametrize("critical", [77, 128])
def test_roots_are_those_of_iso_6358(critical):
    b = critical / 256
    filling, venting = np.array(curve.roots(critical)).reshape(2, control.STEPS + 1)

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
    """`control` computes in words that notice when they overflow."""
    ptr16, ptr32 = control.ptr16, control.ptr32
    monkeypatch.setattr(control, "ptr16", lambda buffer: Words(ptr16(buffer)))
    monkeypatch.setattr(control, "ptr32", lambda buffer: Words(ptr32(buffer)))


def extreme_tables(chance):
    """What a commit accepts: heights that rise to 14 mm or more, pressures within the limit."""
    top = chance.choice([14000, 16000])
    pressures = [0, 42000]
    yield [(1, 42000), (top, 0)]
    yield [(1, 0), (top - 1, 0), (top, 42000)]
    yield [(1, 42000), (2, 0), (top - 400, 42000), (top, 0)]
    yield [(5000, 0), (top - 701, 0), (top, 42000)]  # as steep as its cap
    for _ in range(12):
        heights = sorted(chance.sample(range(1, top), chance.randrange(1, 40)))
        yield [(height, chance.choice([*pressures, chance.randrange(42001)])) for height in [*heights, top]]


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
        assert tables.first_flaw(BOARD.HEIGHT_MAX_UM, BOARD.PRESSURE_MAX_PA) == -1
        tables.swap()
        rig7.app.bubbles.use_tables()
        for _ in range(4):
            rig7.app.commands.show(
                array("i", [chance.choice([0, 14000, chance.randrange(14001)]) for _ in range(7)]),
                0,
                chance.choice([0, 60000]),
            )
            rig7.app.bubbles.clear_faults()
            for _ in range(12):
                rig7.hal.counts = [chance.choice([9, 160, 1500, 2600, 4086, chance.randrange(4096)]) for _ in range(8)]
                rig7.app._control()  # not `tick`, which would catch what we look for
