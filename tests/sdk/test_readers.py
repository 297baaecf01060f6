"""Every reader of files: the dialects it understands, and whatever bytes or structures it is given."""

import json
import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bubbleskin as bs
from bubbleskin.files import parse_json, parse_toml
from bubbleskin.files.tables import parse_table
from bubbleskin.membrane import Calibration, YeohBalloon, build_table
from bubbleskin.sim.trace_file import read as read_trace

READERS = {
    "measurements": (bs.read_csv, "data.csv"),
    "timeline": (bs.Sequence.load, "line.csv"),
    "sequence": (bs.Sequence.load, "sequence.json"),
    "layout": (bs.Layout.from_file, "layout.json"),
    "layout table": (bs.Layout.from_file, "layout.csv"),
    "heightfield table": (bs.shapes.load, "field.csv"),
    "heightfield": (bs.shapes.load, "field.npy"),
    "calibration": (Calibration.load, "tables.toml"),
    "full recording": (read_trace, "trouble.jsonl"),
    "plant": (lambda path: bs.sim.SimulatedBoard("wristband7", contact=False, plant=path), "plant.toml"),
}
GOOD = {
    "measurements": "bubble,step,height [mm],pressure [kPa]\n0,0,6.0,17.9\n1,0,8.0,21.3\n",
    "timeline": "time_s,b0,b1\n0,6,7\n1,8,\n",
    "sequence": json.dumps({"bubbleskin_sequence": 1, "steps": [{"targets_mm": [6, 7], "ramp_s": 1}]}),
    "layout": json.dumps({"pitch_mm": 10, "positions_mm": [[0, 0], [10, 0]]}),
    "layout table": "bubble,x_mm,y_mm\n0,0,0\n1,10,0\n",
    "heightfield table": "6,7\n8,9\n",
}


def good(kind, tmp_path):
    """The bytes of a file that the reader takes."""
    if kind == "heightfield":
        np.save(tmp_path / "good.npy", np.full((2, 3), 6.0))
        return (tmp_path / "good.npy").read_bytes()
    if kind == "plant":
        bs.sim.SimulatedBoard("wristband7", contact=False).write_plant(tmp_path / "good.toml")
        return (tmp_path / "good.toml").read_bytes()
    if kind == "full recording":
        board = bs.sim.SimulatedBoard("wristband7", contact=False)
        board.keep_history()
        recording = board.record(tmp_path / "good.jsonl")
        board.step(0.05)
        recording.close()
        return recording.path.read_bytes()
    if kind == "calibration":
        Calibration("wristband7", (build_table(YeohBalloon(), knots=3),)).save(tmp_path / "good.toml")
        return (tmp_path / "good.toml").read_bytes()
    return GOOD[kind].encode()


def read(kind, data, tmp_path):
    """What the reader makes of these bytes; None where it refuses them in a sentence."""
    make, name = READERS[kind]
    path = tmp_path / name
    path.write_bytes(data)
    try:
        return make(path)
    except bs.InvalidInput as problem:
        said = str(problem)
        if "\n" in said or not said.endswith((".", "?")) or len(said) > 1500:
            raise AssertionError(f"no sentence: {said!r}") from problem
        return None


@pytest.mark.parametrize("kind", READERS)
def test_a_good_file_is_read(kind, tmp_path):
    assert read(kind, good(kind, tmp_path), tmp_path) is not None


@pytest.mark.medium
@pytest.mark.parametrize("kind", READERS)
@settings(max_examples=300)
@given(data=st.data())
def test_bytes_are_read_or_refused(kind, tmp_path_factory, data):
    """Random bytes, and good files with bytes changed, cut out and put in."""
    tmp_path = tmp_path_factory.getbasetemp()
    whole = bytearray(good(kind, tmp_path))
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(whole)))
        until = data.draw(st.integers(at, min(len(whole), at + 12)))
        whole[at:until] = data.draw(st.binary(max_size=12) | st.sampled_from(TOKENS))
    read(kind, bytes(whole), tmp_path)
    read(kind, data.draw(st.binary(max_size=200)), tmp_path)


TOKENS = [
    b"nan", b"inf", b"1e999", b"9" * 400, b"9" * 5000, b'"',
    b"[" * 2000, b"{" * 2000, b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b";", b"\t",
    b",", b"\n", b"\r", b"-1", b"1_000", b"#", b"\\ud800",
    b"true", b"null", b"0x10", b"'", b"=", b"1979-05-27", b"\xc2\xb2", b"sep=;\n",
    b"PK\x03\x04", b"\xfd7zXZ\0", b"\x1f\x8b", b"A" * 200_000,
]  # fmt: skip

VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=8)
    | st.sampled_from([10**400, "\ud800"]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)


@pytest.mark.medium
@pytest.mark.parametrize("kind", ["sequence", "layout"])
@settings(max_examples=400)
@given(data=st.data())
def test_structures_are_read_or_refused(kind, tmp_path_factory, data):
    """Good structures in which any value is another one."""
    whole = json.loads(GOOD[kind])
    places = list(_places(whole))
    holder, key = data.draw(st.sampled_from(places))
    holder[key] = data.draw(VALUES)
    read(kind, json.dumps(whole).encode("utf-8", "surrogatepass"), tmp_path_factory.getbasetemp())


def _places(value):
    for key in value if isinstance(value, dict) else range(len(value)):
        yield value, key
        if isinstance(value[key], dict | list):
            yield from _places(value[key])


@pytest.mark.medium
@settings(max_examples=300)
@given(st.text(max_size=300))
def test_any_text_is_parsed_or_refused(text):
    for parse in (parse_json, parse_toml, parse_table):
        try:
            parse(text, "it")
        except bs.InvalidInput as problem:
            assert str(problem).startswith("it ")  # noqa: PT017 - a refusal is one of two good outcomes


def test_a_header_that_claims_ten_gigabytes_allocates_nothing(tmp_path):
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (40000, 40000), }".ljust(117) + b"\n"
    claim = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header
    tracemalloc.start()
    assert read("heightfield", claim, tmp_path) is None
    assert tracemalloc.get_traced_memory()[1] < 5e6
    tracemalloc.stop()


@pytest.mark.medium
def test_a_file_without_end_is_not_read_for_ever(tmp_path):
    (tmp_path / "field.csv").symlink_to("/dev/zero")
    with pytest.raises(bs.InvalidInput, match="more than 64 MB"):
        bs.shapes.load(tmp_path / "field.csv")


DIALECTS = {
    "plain": "height [mm],pressure [kPa]\n6.0,17.9\n8.0,21.3\n",
    "quotes": '"height [mm]","pressure [kPa]"\n"6.0","17.9"\n"8.0","21.3"\n',
    "semicolons": "height [mm];pressure [kPa]\n6,0;17,9\n8,0;21,3\n",
    "tabs": "height [mm]\tpressure [kPa]\n6,0\t17,9\n8,0\t21,3\n",
    "decimal commas in quotes": 'height [mm],pressure [kPa]\n"6,0","17,9"\n"8,0","21,3"\n',
    "sep=": "sep=;\nheight [mm];pressure [kPa]\n6,0;17,9\n8,0;21,3\n",
    "a row of units": "height,pressure\nmm,kPa\n6.0,17.9\n8.0,21.3\n",
    "units in both": "height [mm],pressure [kPa]\nmm,kPa\n6.0,17.9\n8.0,21.3\n",
    "trailing blanks": "height [mm],pressure [kPa],,\n6.0,17.9,,\n8.0,21.3,,\n,,,\n,,,\n\n",
    "micrometres": "height [µm];pressure [hPa]\n6000;179\n8000;213\n",
    "carriage returns": "height [mm],pressure [kPa]\r\n6.0,17.9\r\n8.0,21.3\r\n",
    "old carriage returns": "height [mm],pressure [kPa]\r6.0,17.9\r8.0,21.3\r",
}


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "utf-16", "utf-16-le", "utf-16-be"])
@pytest.mark.parametrize("dialect", DIALECTS)
def test_dialects_of_measurements(tmp_path, dialect, encoding):
    found = read("measurements", DIALECTS[dialect].encode(encoding), tmp_path)
    assert found.height == pytest.approx([6e-3, 8e-3])
    assert found.pressure == pytest.approx([17.9e3, 21.3e3])


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le"])
@pytest.mark.parametrize(("mark", "point"), [(",", "."), (";", ","), ("\t", ","), (";", ".")])
def test_dialects_of_the_other_tables(tmp_path, encoding, mark, point):
    def written(*rows):
        return "\n".join(mark.join(row.replace(".", point) for row in cells.split()) for cells in rows).encode(encoding)

    line = read("timeline", written("time_s b0 b1", "0 6.5 7", "1 7 8.5"), tmp_path)
    assert [step.targets_mm for step in line.steps] == [(6.5, 7), (7, 8.5)]
    turned = read("timeline", written("time_s b1 b0", "0 7 6.5"), tmp_path)
    assert turned.steps[0].targets_mm == (6.5, 7), "a column is the bubble that it names"
    layout = read("layout table", written("bubble x_mm y_mm", "1 10.5 0", "0 0 0"), tmp_path)
    assert layout.positions_mm.tolist() == [[0, 0], [10.5, 0]]
    assert layout.pitch_mm == 10.5
    assert read("heightfield table", written("6.5 7", "8 9.5"), tmp_path).tolist() == [[6.5, 7], [8, 9.5]]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("height [mm],pressure [kPa]\n6,0,17,9\n", "decimal commas, part the columns by semicolons"),
        ("height [mm];pressure [kPa]\n1.234,5;17,9\n", "write thousands without a mark"),
        ("height [mm];pressure [kPa]\n6,0;17.9\n", "decimal comma and 17.9 in line 2 a point. Write all with points"),
        ("height [mm],pressure [kPa]\nm,kPa\n6.0,17.9\n", "the unit is 'mm' in the header and 'm' here; keep one"),
        ('height [mm],pressure [kPa]\n"6.0,17.9\n', "line 2"),
    ],
)
def test_what_could_mean_two_things_is_refused_with_what_to_write(tmp_path, text, says):
    (tmp_path / "x.csv").write_text(text)
    with pytest.raises(bs.InvalidInput, match=says):
        bs.read_csv(tmp_path / "x.csv")


@pytest.mark.medium
def test_numbers_are_identity_from_the_file_on(tmp_path):
    sheet = Path("docs/data/sheet.csv").read_text()
    (tmp_path / "gap.csv").write_text("\n".join(line for line in sheet.splitlines() if not line.startswith("3,")))
    measured = bs.read_csv(tmp_path / "gap.csv")
    assert measured.bubbles == [0, 1, 2, 4, 5, 6]
    fit = bs.fit_sheet(measured.bubble, measured.height, measured.pressure)
    with pytest.raises(bs.InvalidInput, match="bubble 3 of 7 has no measurements"):
        fit.balloons  # noqa: B018
    rows = [line.split(",", 1) for line in sheet.splitlines() if line[:1].isdigit()]
    head = next(line for line in sheet.splitlines() if line.startswith("bubble"))
    (tmp_path / "ones.csv").write_text("\n".join([head, *(f"{int(number) + 1},{rest}" for number, rest in rows)]))
    ones = bs.read_csv(tmp_path / "ones.csv")
    with pytest.raises(bs.InvalidInput, match="read it with first=1"):
        bs.fit_sheet(ones.bubble, ones.height, ones.pressure).balloons  # noqa: B018
    said = bs.read_csv(tmp_path / "ones.csv", first=1)
    assert said.bubbles == list(range(7))
    assert len(bs.fit_sheet(said.bubble, said.height, said.pressure).balloons) == 7
