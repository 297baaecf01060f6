"""What a board's file must define: everything that is missing or wrong is named in a sentence before anything uses it."""

import pytest

import bubbleskin as bs
from bubbleskin import boards
from bubbleskin.boards.fields import EXPANDER_FIELDS, FIELDS


def refused(path) -> str:
    with pytest.raises(bs.InvalidInput) as caught:
        boards.load(path)
    text = str(caught.value)
    assert text.endswith(".")
    assert "\n" not in text
    return text


@pytest.mark.parametrize("name", boards.NAMES)
def test_every_board_of_ours_is_whole(name):
    assert name == boards.load(name).NAME
    assert boards.own_file(boards.load(name)) is None
    assert len(bs.Layout.of_board(name)) == boards.load(name).BUBBLES


def test_the_names_are_those_of_the_folder_and_one_is_the_default():
    assert {"wristband7", "wristband19"} <= set(boards.NAMES)
    assert "parts" not in boards.NAMES
    assert boards.DEFAULT in boards.NAMES


def test_layouts_of_ours_are_the_hexagons():
    assert bs.Layout.of_board("wristband7") == bs.Layout.hexagon(1)
    assert bs.Layout.of_board("wristband19") == bs.Layout.hexagon(2)
    assert bs.Layout.of_board("wristband19").neighbours == bs.Layout.hexagon(2).neighbours


@pytest.mark.medium
@pytest.mark.parametrize("field", [*FIELDS, *EXPANDER_FIELDS], ids=lambda field: field.name)
def test_a_number_that_is_missing_wrong_or_beyond_is_named(field, pad8):
    whole = pad8.read_text(encoding="utf-8")
    for line, words in (
        (f"del {field.name}", f"does not define {field.name}"),
        (f'{field.name} = "7"', f"has {field.name} = '7'; a whole number is wanted"),
        (f"{field.name} = 7.0", f"has {field.name} = 7.0; a whole number is wanted"),
        (f"{field.name} = True", f"has {field.name} = True; a whole number is wanted"),
        (f"{field.name} = {min(field.allowed) - 1}", f"has {field.name} = {min(field.allowed) - 1}"),
        (f"{field.name} = {max(field.allowed) + 1}", f"has {field.name} = {max(field.allowed) + 1}"),
    ):
        pad8.write_text(f"{whole}\n{line}\n", encoding="utf-8")
        text = refused(pad8)
        assert words in text
        assert str(pad8) in text


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("del NAME", ["does not define NAME"]),
        ("NAME = 7", ["NAME = 7", "small letters"]),
        ('NAME = "Pad 8"', ["NAME = 'Pad 8'", "small letters"]),
        ('NAME = "pad9"', ["NAME = 'pad9'", "called as its file", "'pad8'"]),
        ("del LAYOUT", ["does not define LAYOUT"]),
        ("LAYOUT = LAYOUT[:7]", ["7 pairs in LAYOUT", "BUBBLES = 8"]),
        ("LAYOUT = 8", ["not a tuple of pairs"]),
        ("LAYOUT = ((0.5, 0),) + LAYOUT[1:]", ["not a tuple of pairs"]),
        ("LAYOUT = ((600000, 0),) + LAYOUT[1:]", ["bubble 0 at (600000, 0)", "500000"]),
        ("LAYOUT = LAYOUT[:7] + LAYOUT[:1]", ["bubbles 0 and 7 only 0 µm"]),
        ("PITCH_UM = 20000", ["bubbles 0 and 1 only 12000 µm", "PITCH_UM = 20000"]),
        ("PITCH_UM = 9000", ["no bubbles nearer to each other than 12000 µm", "PITCH_UM = 9000"]),
        ("PRESSURE_MAX_PA = 60000", ["PRESSURE_MAX_PA = 60000 and SUPPLY_PA = 60000"]),
        ("PRESSURE_MAX_PA = 34000", ["HEIGHT_MAX_UM = 14000 takes 34060 Pa"]),
        ("SUPPLY_MAX_PA = 60000", ["SUPPLY_PA = 60000 and SUPPLY_MAX_PA = 60000"]),
        ("HEIGHT_MAX_UM = 5000", ["HEIGHT_REST_UM = 5000 and HEIGHT_MAX_UM = 5000"]),
        ("SENSOR_PA_PER_COUNT = 10", ["PRESSURE_MAX_PA = 42000", "believed up to 39270 Pa"]),
        ("SUPPLY_PA_PER_COUNT = 17", ["SUPPLY_MAX_PA = 75000", "believed up to 66759 Pa"]),
        ("COUNT_LOW = 200", ["COUNT_LOW = 200 and SENSOR_ZERO = 160"]),
        ("VALVE_OPENS_US = 6000", ["VALVE_OPENS_US = 6000", "5000 µs, is the most"]),
        ("TICK_US = 5000", ["TICK_US = 5000", "multiple of 2000"]),
        ('VALVES = "air"', ["VALVES = 'air'", '"pwm" and "pca9685"']),
        ('VALVES = "pwm"', ["8 bubbles", "PWM for 7"]),
        ("del VALVES", ["does not define VALVES"]),
        ("del DRIVERS", ["does not define DRIVERS"]),
        ("DRIVERS = ((0x40, 7),)", ["7 bubbles in DRIVERS", "BUBBLES = 8"]),
        ("DRIVERS = ((0x20, 8),)", ["(32, 8) in DRIVERS", "64 to 127"]),
        ("DRIVERS = ((0x40, 4), (0x40, 4))", ["one chip twice in DRIVERS"]),
        ("CONVERTERS = (17, 8)", ["CONVERTERS = (17, 8)", "tuple of pairs"]),
        ("CONVERTERS = ((17, 9),)", ["(17, 9) in CONVERTERS", "1 to 8"]),
        ("CONVERTERS = ((18, 8),)", ["GPIO 18 twice", "PIN_SCK", "CONVERTERS"]),
        ("CONVERTERS = ((24, 8),)", ["GPIO 24 for CONVERTERS", "does not hand it out"]),
        ("1 / 0", ["line ", "ZeroDivisionError"]),
        ("if", ["line ", "SyntaxError"]),
        ("import nowhere_at_all", ["line ", "ModuleNotFoundError", "nowhere_at_all"]),
    ],
)
def test_what_does_not_fit_together_is_refused_in_a_sentence(line, words, pad8):
    pad8.write_text(f"{pad8.read_text(encoding='utf-8')}\n{line}\n", encoding="utf-8")
    text = refused(pad8)
    for word in words:
        assert word in text


def test_a_file_that_is_not_there_is_named(tmp_path):
    assert "There is no board file" in refused(tmp_path / "none.py")
    assert "wristband7 and wristband19" in refused("none")
    assert "its file" in refused("none")


def test_the_name_of_one_of_ours_is_taken(pad8):
    path = pad8.rename(pad8.with_name("wristband7.py"))
    assert "name of one of our boards" in refused(path)


def test_a_change_of_the_file_is_seen_at_once(pad8):
    assert boards.load(pad8).DEADBAND_UM == 30
    text = pad8.read_text(encoding="utf-8")
    for number in (61, 62, 63):  # as long as each other, within a second
        pad8.write_text(f"{text}DEADBAND_UM = {number}\n", encoding="utf-8")
        assert number == boards.load(pad8).DEADBAND_UM
