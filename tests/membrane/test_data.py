"""Files of measurements: units are needed and understood, bad rows are named by line."""

import numpy as np
import pytest

from bubbleskin.errors import InvalidInput
from bubbleskin.membrane import BadRowWarning, read_csv, simulate_sheet, write_csv


def written(tmp_path, text):
    path = tmp_path / "data.csv"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "header",
    [
        "height [mm],pressure [kPa]",
        "height_mm,pressure_kpa",
        "Height (mm), Pressure (kPa)",
        "height [mm]\tpressure [kPa]",
        "height [mm];pressure [kPa]",
    ],
)
def test_units_stand_in_the_header(tmp_path, header):
    separator = next(c for c in ";\t," if c in header)
    found = read_csv(written(tmp_path, f"# measured on a Tuesday\n\n{header}\n8.5{separator}21.4\n"))
    assert (found.height[0], found.pressure[0]) == (pytest.approx(8.5e-3), pytest.approx(21.4e3))


@pytest.mark.parametrize(
    ("unit", "value"),
    [("Pa", 21400), ("kPa", 21.4), ("hPa", 214), ("bar", 0.214), ("mbar", 214), ("MPa", 0.0214), ("psi", 3.10381)],
)
def test_units_of_pressure(tmp_path, unit, value):
    found = read_csv(written(tmp_path, f"height [µm],pressure [{unit}]\n8500,{value}\n"))
    assert found.pressure[0] == pytest.approx(21.4e3, rel=1e-5)
    assert found.height[0] == pytest.approx(8.5e-3)


def test_all_columns(tmp_path):
    text = "note,bubble,step,height [mm],height_sd [um],pressure [kPa],pressure_sd [Pa]\nx,3,7,8,50,21,150\n"
    found = read_csv(written(tmp_path, text))
    assert (found.bubble[0], found.step[0]) == (3, 7)
    assert (found.height_sd[0], found.pressure_sd[0]) == (pytest.approx(50e-6), 150)


def test_decimal_comma_between_semicolons(tmp_path):
    found = read_csv(written(tmp_path, "height [mm];pressure [kPa]\n8,5;21,4\n"))
    assert (found.height[0], found.pressure[0]) == (pytest.approx(8.5e-3), pytest.approx(21.4e3))


def test_there_and_back(tmp_path):
    made, _ = simulate_sheet(3, seed=1)
    write_csv(tmp_path / "sheet.csv", made, comments=["simulated"])
    found = read_csv(tmp_path / "sheet.csv")
    np.testing.assert_allclose(found.height, made.height, atol=0.51e-6)
    np.testing.assert_allclose(found.pressure, made.pressure, atol=0.51)
    np.testing.assert_array_equal(found.bubble, made.bubble)
    np.testing.assert_array_equal(found.step, made.step)
    assert found.bubbles == [0, 1, 2]
    assert len(found.of(2)) == len(found) // 3


ROWS = "height [mm],pressure [kPa]\n8,21\nabc,21\n8,\n-8,21\n8\n8,nan\n9,22\n"


def test_bad_rows_are_named_by_line(tmp_path):
    with pytest.raises(InvalidInput) as refusal:
        read_csv(written(tmp_path, ROWS))
    said = str(refusal.value)
    assert "5 bad rows" in said
    for reason in (
        "line 3: height is 'abc', not a number",
        "line 4: pressure is missing",
        "line 5: height is -8, but must be above zero",
        "line 6: 1 cells under 2 headings",
        "line 7: pressure is nan",
    ):
        assert reason in said


def test_bad_rows_can_be_left_out(tmp_path):
    with pytest.warns(BadRowWarning, match="line 3"):
        found = read_csv(written(tmp_path, ROWS), skip_bad_rows=True)
    np.testing.assert_allclose(found.height, [8e-3, 9e-3])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("height,pressure\n8,21\n", r"'height' has no unit.*'height \[mm\]'"),
        ("height [mm],pressure [furlong]\n8,21\n", "'furlong'.*no unit of pressure"),
        ("height [mm],pressure [mPa]\n8,21\n", "'mPa'"),
        ("height [mm]\n8\n", r"one column of pressure.*'pressure \[kPa\]'"),
        ("height [mm],height [m],pressure [kPa]\n8,8,1\n", "it has 2"),
        ("8.0,21.0\n8.1,21.1\n", "one column of height"),
        ("# nothing\n", "holds no measurements"),
        ("height [mm],pressure [kPa]\n", "no usable row"),
        ("bubble,height [mm],pressure [kPa]\n1.5,8,21\n", "bubble is 1.5, not a whole number"),
    ],
)
def test_unusable_files_are_refused_in_a_sentence(tmp_path, text, says):
    with pytest.raises(InvalidInput, match=says) as refusal:
        read_csv(written(tmp_path, text))
    assert str(refusal.value).endswith(".")


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(InvalidInput, match="No such file"):
        read_csv(tmp_path / "nowhere.csv")
    path = tmp_path / "picture.csv"
    path.write_bytes(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR")
    with pytest.raises(InvalidInput, match="not text"):
        read_csv(path)
