"""The integers of the tick: against floats, against the SDK's table, and never beyond 32 bits."""

import math
import random
from array import array
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bubble_firmware import boards, control, guard, nominal, table
from bubble_firmware.bubbles import Bubbles
from bubble_protocol import codec, messages
from bubbleskin import Table, YeohBalloon, build_table

BOARD = boards.load("wristband7")
ATMOSPHERE = 101325.0

SCHEMA = [entry[1].upper() for entry in (*messages.MODES, *messages.STATUSES, *messages.FAULTS)]
REPEATED = [name for name in SCHEMA if hasattr(control, name)]


def test_what_control_repeats_of_the_schema_is_the_schemas():
    """It repeats them because MicroPython's compiler folds constants of the same module only."""
    assert {name: getattr(control, name) for name in REPEATED} == {name: getattr(messages, name) for name in REPEATED}
    known = {name: getattr(messages, name) for name in (*SCHEMA, "VENTED") if hasattr(guard, name)}
    assert {name: getattr(guard, name) for name in known} == known
    assert set(SCHEMA) <= {*REPEATED, *known, "IDLE", "HOLDING", "BOOT", "VENTING", "FAULTED"}


def test_what_the_guard_repeats_of_control_is_controls():
    lines = Path(guard.__file__).read_text(encoding="utf-8").split("# From the schema")[0].splitlines()
    names = [line.split(" = const(")[0] for line in lines if " = const(" in line]
    assert len(names) > 15
    assert {name: getattr(guard, name) for name in names} == {name: getattr(control, name) for name in names}


def test_the_guards_rows_do_not_overlap():
    lines = Path(guard.__file__).read_text(encoding="utf-8").splitlines()
    names = [line.split(" = const(")[0] for line in lines if " = const(" in line]
    for first, end in (("WAS_AIR", "GUARD"), ("ALLOWED", "NUMBERS")):
        row = names[names.index(first) : names.index(end) + 1]
        assert [getattr(guard, name) for name in row] == list(range(len(row)))


def test_rows_do_not_overlap():
    """Every place of a bubble's row and of the board's numbers has one name."""
    lines = Path(control.__file__).read_text(encoding="utf-8").splitlines()
    names = [line.split(" = const(")[0] for line in lines if " = const(" in line]
    row = names[names.index("ZERO") : names.index("SETPOINT")]
    places = [getattr(control, name) for name in row]
    assert places == list(range(len(row)))
    record = max(control.SEGMENT, control.MODEL, control.CONTENT, control.SLOPE, control.WEIGHED)
    assert record + 1 == control.SETPOINT - control.HEIGHT
    rest = names[names.index("LOWEST") : names.index("ROW")]
    assert [getattr(control, name) for name in rest] == list(range(control.SETPOINT + record + 1, control.ROW))
    board = names[names.index("N") : names.index("BOARD")]
    assert [getattr(control, name) for name in board] == list(range(control.BOARD))


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
        from bubble_firmware import nominal, table
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


class Weighed:
    """What `weigh` says of any height by a table."""

    def __init__(self, knots):
        tables = table.Tables(BOARD.BUBBLES)
        tables.write_size(0, len(knots))
        for index, (height, pressure) in enumerate(knots):
            tables.write_knot(0, index, height, pressure)
        tables.swap()
        self.bubbles = Bubbles(BOARD, tables)

    def __call__(self, height_um):
        row = self.bubbles._rows
        row[control.HEIGHT] = height_um << 4
        row[control.HEIGHT + control.WEIGHED] = -1
        self.bubbles.decide()
        return [row[control.HEIGHT + place] for place in (control.MODEL, control.CONTENT, control.SLOPE)]


@pytest.mark.parametrize("mu", [30e3, 39.62e3, 50e3], ids=["soft", "nominal", "snap-through"])
def test_air_and_its_slope_are_those_of_a_sphere(mu):
    """pV in µJ and its derivative in µJ/µm, from 5 to 14 mm, against floats and the exact segment."""
    made = build_table(YeohBalloon(mu=mu))
    knots = list(zip(made.height_um.tolist(), made.pressure_pa.tolist(), strict=True))
    weighed = Weighed(knots)
    heights = np.arange(5000, 14000, 7)
    model, content, slope = np.array([weighed(int(height)) for height in heights]).T
    assert (model == made.pressure_at(heights)).all()

    h = heights * 1e-3  # mm
    p = np.interp(heights, made.height_um, made.pressure_pa) + ATMOSPHERE
    segment = np.searchsorted(made.height_um, heights, side="right") - 1
    steep = (np.diff(made.pressure_pa) / np.diff(made.height_um))[segment]  # Pa/µm
    volume = math.pi / 6 * h**3 + BOARD.DEAD_VOLUME_MM3  # mm³; 1 µJ = 1000 Pa mm³
    air = p * volume / 1000
    rise = p * math.pi / 2 * h**2 / 1e6 + volume * steep / 1000
    air_error = np.abs(content / air - 1)
    slope_error = np.abs(slope / 256 / rise - 1)
    print(f"air within {air_error.max():.2e}, slope within {slope_error.max():.2e}")
    assert air_error.max() < 1e-3
    assert slope_error.max() < 5e-3


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
            rig7.app.show(
                array("i", [chance.choice([0, 14000, chance.randrange(14001)]) for _ in range(7)]),
                0,
                chance.choice([0, 60000]),
            )
            rig7.app.bubbles.clear_faults()
            for _ in range(12):
                rig7.hands.counts = [
                    chance.choice([9, 160, 1500, 2600, 4086, chance.randrange(4096)]) for _ in range(8)
                ]
                rig7.app._control()  # not `tick`, which would catch what we look for
