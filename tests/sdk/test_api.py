"""What `import bubbleskin` gives: its names, and how its objects look at a prompt."""

import subprocess
import sys

import numpy as np
import pytest

import bubbleskin as bs


@pytest.mark.medium
def test_dir_lists_the_public_names_and_nothing_else():
    assert dir(bs) == sorted(bs.__all__)
    assert not [name for name in dir(bs) if name.startswith("_")]
    for name in bs.__all__:
        assert getattr(bs, name) is not None


def test_a_name_that_there_is_not():
    with pytest.raises(AttributeError, match="no attribute 'conect'"):
        bs.conect  # noqa: B018 - what a user mistypes


def test_a_star_import_gives_the_same_names():
    names = {}
    exec("from bubbleskin import *", names)
    assert set(bs.__all__) == names.keys() - {"__builtins__"}


HEAVY = ("scipy", "numba", "matplotlib")


def imported(code: str) -> list[str]:
    """Which of `HEAVY` a Python has imported that ran `code`; what else it prints goes before the list."""
    code = f"import sys\n{code}\nprint(*[name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.splitlines()[-1].split()


def test_a_script_that_only_shows_heights_does_not_wait_for_the_physics():
    assert imported("import bubbleskin") == []


@pytest.mark.slow
def test_help_does_not_wait_for_the_physics():
    assert (
        imported("from bubbleskin.cli.command import main\ntry:\n    main(['--help'])\nexcept SystemExit:\n    pass")
        == []
    )
    assert imported("import bubbleskin\nbubbleskin.YeohBalloon()") == []
    assert imported("from scipy import optimize") == ["scipy"]


@pytest.mark.medium
def test_python_m_bubbleskin_is_the_command():
    command = [sys.executable, "-m", "bubbleskin", "--help"]
    assert "Usage: bubbleskin" in subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_shapes_are_public():
    layout = bs.Layout.hexagon()
    assert bs.shapes.dome(layout)[0] == 12.0
    assert bs.shapes.plane(layout).max() == 12.0
    assert not bs.shapes.flat(layout).any()


def test_what_a_device_tells_reads_at_a_prompt():
    with bs.connect("sim://wristband7?contact=0") as skin:
        assert repr(skin) == "<Skin sim://wristband7: 7 bubbles>"
        assert repr(skin.info) == "<Info wristband7: 7 bubbles up to 14 mm, firmware 0.1.0, tick 5 ms>"
        assert repr(skin.health()) == "<Health idle, no fault of the board, supply 60.0 kPa, self-test not_run>"
        assert repr(skin.layout) == "<Layout of 7 bubbles, 10 mm apart>"
        assert repr(skin.trim()).startswith("<Trim of 7 bubbles: zero 160 counts, opens in 1200 µs")
        assert repr(skin.stored()) == "<StoreInfo factory, generation 0, 0 of 16384 bytes, slots blank and blank>"
        assert repr(skin.read_tables()[0]).startswith("<Table of 64 knots, 5 to 14 mm, up to ")
        assert repr(skin.tick_histogram()).endswith(" ticks in bins of 100 µs>")
        state = skin.show(np.full(7, 5.0))
        assert repr(state).startswith("<State at 0.")
        assert repr(state).endswith(" s: active, 5.00, 5.00, 5.00, 5.00, 5.00, 5.00, 5.00 mm, settled>")
        skin.show(np.full(7, 10.0))
        skin.simulated.inject("pop_off", 3, 1.0)
        skin.sleep(0.2)
        assert repr(skin.state()).endswith(" mm, bubble 3: leak>")
        (fault,) = skin.fault_log()
        assert repr(fault).startswith("<Fault 1: leak of bubble 3 at 0.")
        report = skin.play(bs.Sequence([bs.Step([6.0] * 7, 0.2, name="up")]))
        assert repr(report) == "<PlaybackReport 1 steps in 0.200 s, 0 timeouts>"
        assert repr(skin.playing()) == "<PlaybackStatus ended: complete, step 0 (up)>"
    assert repr(skin) == "<Skin sim://wristband7: 7 bubbles, closed>"


def test_a_state_of_many_bubbles_gives_the_range():
    with bs.connect("sim://wristband19?contact=0") as skin:
        assert repr(skin.state()).endswith(" s: idle, 5.00 to 5.00 mm, settled>")


def test_what_the_host_makes_reads_at_a_prompt(tmp_path):
    layout = bs.Layout.hexagon()
    balloon = bs.YeohBalloon()
    table = bs.build_table(balloon)
    calibration = bs.Calibration("wristband7", (table,) * 7)
    height = np.linspace(6e-3, 13e-3, 30)
    assert repr(layout) == "<Layout of 7 bubbles, 10 mm apart>"
    assert repr(bs.sequences.pulse(layout)) == "<Sequence 'pulse', 8 steps, 7 bubbles, 11.7 s>"
    assert repr(table) == f"<Table of 64 knots, 5 to 14 mm, up to {table.pressure_pa.max() / 1000:.2f} kPa>"
    assert repr(calibration) == f"<Calibration of a wristband7: 7 tables, CRC-32 {calibration.crc32:08x}>"
    fit = bs.fit_yeoh(height, balloon.pressure_at_height(height), radius=2.5e-3, thickness=1e-3, wall="thin")
    assert repr(fit) == "<YeohFit of 30 points: mu 39.62 kPa, C2 417.3 Pa, C3 60.65 Pa>"
    contact = bs.CompliantContact(layout)
    shape = contact.settle([np.full(7, 1e4)])
    assert repr(contact) == "<CompliantContact of 7 bubbles>"
    assert repr(bs.RigidContact(layout)) == "<RigidContact of 7 bubbles>"
    assert repr(shape).startswith("<Shape of 7 bubbles, 5.")
    plan = bs.plan(np.full(7, 8.0), layout, contact=contact)
    assert repr(plan).startswith("<Plan for 7 bubbles: 1 steps, all within reach, off by 0.")
