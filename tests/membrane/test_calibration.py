"""The calibration file: the same tables again, a diff that reads well, damage that is noticed."""

import difflib

import pytest

from bubbleskin.errors import InvalidInput
from bubbleskin.membrane import Calibration, Table, YeohBalloon, compare_tables

BALLOONS = [YeohBalloon(mu=38e3), YeohBalloon(mu=60e3), YeohBalloon(wall="thick", surface="inner")]


@pytest.fixture
def calibration():
    return Calibration.build("wristband7", BALLOONS, source='sheet "A" of May, µ by fit\n', height_mm=(5, 14))


def test_there_and_back(calibration, tmp_path):
    calibration.save(tmp_path / "a.toml")
    found = Calibration.load(tmp_path / "a.toml")
    assert found.tables == calibration.tables
    assert (found.board, found.source) == (calibration.board, calibration.source)
    assert [table.balloon for table in found.tables] == BALLOONS
    assert found.crc32 == calibration.crc32
    assert found.differences(calibration) == []
    assert found.to_text() == calibration.to_text()


def test_tables_without_constants(tmp_path):
    bare = Calibration("board", (Table([5000, 9000], [0, 21000]),))
    assert Calibration.from_text(bare.to_text()).tables == bare.tables


def test_a_moved_knot_is_one_line_of_diff_and_a_sentence(calibration):
    table = calibration.tables[1]
    pressure = table.pressure_pa.copy()
    pressure[20] += 37
    moved = Calibration(
        calibration.board,
        (calibration.tables[0], Table(table.height_um, pressure, table.balloon, table.range_um), calibration.tables[2]),
        calibration.source,
    )
    changed = [
        line
        for line in difflib.unified_diff(calibration.to_text().splitlines(), moved.to_text().splitlines(), n=0)
        if line.startswith("+ ") or line.startswith("+[") or line.startswith("+  [")
    ]
    assert changed == [f"+  [{table.height_um[20]}, {pressure[20]}],"]
    (said,) = calibration.differences(moved)
    assert said == f"bubble 1: at most +37 Pa apart, at {table.height_um[20] / 1000:.3f} mm"
    assert compare_tables(calibration.tables, moved.tables) == [said]
    assert calibration.crc32 != moved.crc32


def test_other_differences_are_said(calibration):
    other = Calibration("wristband19", calibration.tables[:2])
    assert calibration.differences(other) == ["board: wristband7 here, wristband19 there", "bubbles: 3 here, 2 there"]
    short = Calibration.build("wristband7", BALLOONS, source="", knots=50)
    assert "64 knots here, 50 there" in calibration.differences(short)[0]


def test_edited_knots_need_the_checksum_taken_out(calibration):
    text = calibration.to_text()
    h, p = calibration.tables[0].height_um[5], calibration.tables[0].pressure_pa[5]
    edited = text.replace(f"[{h}, {p}]", f"[{h}, {p + 1}]", 1)
    with pytest.raises(InvalidInput, match="delete the line crc32"):
        Calibration.from_text(edited)
    unsigned = "\n".join(line for line in edited.splitlines() if not line.startswith("crc32"))
    assert Calibration.from_text(unsigned).tables[0].pressure_pa[5] == p + 1


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda t: t.replace("schema = 1", "schema = 9"), "schema 9"),
        (lambda t: t.replace("[[bubble]]", "[[bubble"), "not readable"),
        (lambda t: t.split("[[bubble]]")[0], r"no \[\[bubble\]\]"),
        (lambda t: t.replace("number = 1", "number = 2"), "where 1 is due stands 2"),
        (lambda t: t.replace("[5000, 0],", "[5000],", 1), "bubble 0: "),
        (lambda t: t.replace("[5000, 0],", "[99999, 0],", 1), "bubble 0: heights must rise"),
    ],
)
def test_damaged_files_are_refused_in_a_sentence(calibration, change, says):
    with pytest.raises(InvalidInput, match=says):
        Calibration.from_text(change(calibration.to_text()), name="a.toml")


def test_missing_and_unwritable_files(calibration, tmp_path):
    with pytest.raises(InvalidInput, match="No such file"):
        Calibration.load(tmp_path / "nowhere.toml")
    with pytest.raises(InvalidInput, match="cannot be written"):
        calibration.save(tmp_path / "nowhere" / "a.toml")
    with pytest.raises(InvalidInput, match="no bubble 7"):
        calibration.table(7)
