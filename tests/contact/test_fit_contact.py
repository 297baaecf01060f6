"""Springs found again from shapes made with them."""

import json

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.cli import main
from bubbleskin.contact.measured import read_shapes
from bubbleskin.errors import InvalidInput

LAYOUT = bs.Layout.grid(1, 3)
PATHS = (
    [[0, 26e3, 0], [25e3, 26e3, 25e3]],
    [[26e3, 0, 25e3], [26e3, 25e3, 25e3]],
    [[27e3, 27e3, 0]],
    [[29e3, 0, 0], [29e3, 24e3, 0]],
)


def made(kz, kxy, kc, rng=None):
    model = bs.CompliantContact(LAYOUT, kz=kz, kxy=kxy, kc=kc)
    for path in PATHS:
        height = model.settle(path).height_mm
        yield bs.Measured(path, height if rng is None else height + rng.normal(0, 0.02, 3))


@pytest.mark.medium
@pytest.mark.parametrize("true", [(10, 50, 300), (14, 60, 220)])
def test_known_springs_are_recovered(true):
    fit = bs.fit_contact(made(*true), LAYOUT, sd_mm=0.005)
    np.testing.assert_allclose([fit.kz, fit.kxy, fit.kc], true, rtol=0.02)
    assert np.abs(fit.residual_mm).max() < 0.01
    assert fit.contact.kc == fit.kc


@pytest.mark.slow
def test_noise_stays_within_what_is_said_of_it():
    true = np.array([14, 60, 220])
    fit = bs.fit_contact(made(*true, np.random.default_rng(1)), LAYOUT, sd_mm=0.02)
    off = np.abs(np.log([fit.kz, fit.kxy, fit.kc] / true))
    assert (off < 3 * np.log(fit.factor)).all()


def test_shapes_that_say_nothing_are_refused_with_what_would():
    alone = [bs.Measured([[25e3, 0, 0]], bs.CompliantContact(LAYOUT).settle([[25e3, 0, 0]]).height_mm)]
    with pytest.raises(InvalidInput, match=r"say nothing of necks and contact: no two bubbles touch.*12 mm"):
        bs.fit_contact(alone, LAYOUT)


SEVEN = bs.Layout.hexagon(1)
SPRINGS = {"kz": 13.0, "kxy": 40.0, "kc": 250.0}


def lifted(bubble):
    """Steps in which one bubble goes first, and is lifted by all others."""
    first = np.arange(7) == bubble
    return [np.where(first, 12.5, 5.0), np.where(first, 12.5, 11.5)]


def sheet(bubbles=(0, 1, 3), walls=1.0):
    """Shapes of a sheet with other springs, whose walls hold `walls` times as much pressure as the table says."""
    model = bs.CompliantContact(SEVEN, **SPRINGS)
    for steps in ([np.full(7, 9.5)], *map(lifted, bubbles)):
        shape = model.settle_sizes(steps)
        alone = model.free_pressure(shape.size_mm)
        yield bs.Measured(steps, shape.height_mm, "size", shape.pressure + (walls - 1.0) * alone)


@pytest.mark.medium
def test_heights_of_held_sizes_tell_ratios_and_say_so():
    fit = bs.fit_contact([bs.Measured(one.steps, one.height_mm, "size") for one in sheet()], SEVEN)
    assert fit.kz / fit.kxy == pytest.approx(13 / 40, rel=0.02)
    assert fit.kc / fit.kxy == pytest.approx(250 / 40, rel=0.05)
    assert fit.open == ("kz", "kxy", "kc")
    assert fit.ratio_factor["kz/kxy"] < 1.1
    assert "other springs change alike" in fit.report()
    assert "Pressures tell the rest" in fit.report()
    model, unseen = bs.CompliantContact(SEVEN, **SPRINGS), [lifted(4)[0], [11.0, 12, 10, 11, 12.5, 11, 10]]
    np.testing.assert_allclose(
        fit.contact.settle_sizes(unseen).height_mm, model.settle_sizes(unseen).height_mm, atol=0.02
    )


@pytest.mark.medium
def test_pressures_tell_each_spring_whatever_the_walls_hold():
    """Walls 4 % stiffer than the table: that is 1 kPa, five times what neighbours add."""
    fit = bs.fit_contact(sheet(walls=1.04), SEVEN)
    for name, true in SPRINGS.items():
        low, high = fit.interval[name]
        assert low < true < high
    assert not fit.open
    assert np.abs(fit.residual_pa).max() < 20


@pytest.mark.medium
def test_pressures_alone_find_what_they_tell_and_name_what_not():
    fit = bs.fit_contact([bs.Measured(one.steps, None, "size", one.pressure_pa) for one in sheet()], SEVEN)
    assert "kc" in fit.open
    assert "kxy" not in fit.open
    assert fit.interval["kxy"][0] < 40 < fit.interval["kxy"][1]
    assert "kc, the contact of two bubbles, is open" in fit.report()
    assert "Measure bubbles that press each other hard" in fit.report()


def test_pressures_need_those_of_the_same_bubbles_alone():
    _, pressed = sheet((0,))
    with pytest.raises(InvalidInput, match="only beside those of the same bubbles alone"):
        bs.fit_contact([bs.Measured(pressed.steps, None, "size", pressed.pressure_pa)], SEVEN)


@pytest.mark.medium
@pytest.mark.parametrize("seed", range(2))
def test_a_wristband_of_unknown_springs_is_predicted_in_shapes_that_were_not_measured(seed):
    """Against the plant's truth; heights are known to 0.05 mm, pressures as its sensors tell them."""
    url, rng = f"sim://wristband7?springs=0.3&seed={seed}", np.random.default_rng(seed)

    def played(steps):
        with bs.connect(url) as skin:
            skin.play(bs.Sequence([bs.Step(list(step), ramp=1.0, until=bs.After(0.5)) for step in steps]), anyway=True)
            return skin.simulated.height_mm, 1e3 * skin.state().pressure_kpa

    shapes = []
    for bubble in (0, 1, 3):
        true, pressure = played(lifted(bubble))
        shapes.append(bs.Measured(lifted(bubble), true + rng.normal(0, 0.05, 7), "size", pressure))
    fit = bs.fit_contact(shapes, SEVEN)
    unseen = [lifted(5)[0], np.array([11.0, 12.0, 10.5, 11.0, 12.0, 12.5, 11.0])]
    true, _ = played(unseen)
    np.testing.assert_allclose(fit.contact.settle_sizes(unseen).height_mm, true, atol=0.12)


TABLE = """shape,step,bubble,sent [mm],height [mm],pressure [kPa]
1,1,0,12.5,,
1,2,1,11.5,11.5,25.1
1,2,2,11.5,,
2,1,2,12,12,
"""


def test_a_table_of_shapes_is_read(tmp_path):
    path = tmp_path / "shapes.csv"
    path.write_text(TABLE)
    one, other = read_shapes(path, LAYOUT)
    assert one.held == "size"
    np.testing.assert_array_equal(one.steps, [[12.5, 0, 0], [12.5, 11.5, 11.5]])
    np.testing.assert_array_equal(one.height_mm, [np.nan, 11.5, np.nan])
    np.testing.assert_array_equal(one.pressure_pa, [np.nan, 25100, np.nan])
    np.testing.assert_array_equal(other.steps, [[0, 0, 12]])
    path.write_text("shape;step;bubble;held [kPa];height [mm]\n0;0;1;25,5;11,9\n")
    (held,) = read_shapes(path, LAYOUT)
    assert held.held == "pressure"
    np.testing.assert_array_equal(held.steps, [[0, 25500, 0]])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "first row must be shape, step, bubble"),
        ("bubble,height [mm]\n0,9\n", "first row must be shape, step, bubble"),
        ("shape,step,bubble,sent [mm],height [mm]\n", "no shapes below"),
        ("shape,step,bubble,sent [mm],height [mm]\n1,1,7,9,9\n", "line 2 is of bubble 7; the layout has 0 to 2"),
        ("shape,step,bubble,sent [mm],height [mm]\n1,1,0.5,9,9\n", "must be a whole number"),
        ("shape,step,bubble,sent [mm],height [mm]\n1,1,0,nine,9\n", "not a number"),
        ("shape,step,bubble,sent [mm],height [mm]\n1,1,0,,9\n", "not a number"),
        ("shape,step,bubble,sent [mm],height [mm]\n1,1,0,9\n", "line 2"),
    ],
)
def test_a_table_with_a_mistake_is_named_by_its_place(tmp_path, text, words):
    path = tmp_path / "shapes.csv"
    path.write_text(text)
    with pytest.raises(InvalidInput, match=words):
        read_shapes(path, LAYOUT)


@pytest.mark.medium
def test_the_verb_fits_a_table_and_a_plan_uses_it(tmp_path, capsys):
    lines = ["shape,step,bubble,sent [mm],height [mm],pressure [kPa]"]
    for number, one in enumerate(sheet()):
        if len(one.steps) > 1:
            lines += [f"{number},1,{i},{size}" + ",," for i, size in enumerate(one.steps[0])]
        told = zip(one.steps[-1], one.height_mm, one.pressure_pa, strict=True)
        lines += [f"{number},2,{i},{size},{h:.3f},{p / 1e3:.4f}" for i, (size, h, p) in enumerate(told)]
    table, springs = tmp_path / "shapes.csv", tmp_path / "springs.json"
    table.write_text("\n".join(lines))
    noises = "--height-noise-mm", "0.01", "--pressure-noise-kpa", "0.01"
    assert verb("fit-contact", str(table), *noises, "-o", str(springs)) == 0
    assert "kz, a neck, upwards: " in capsys.readouterr().out
    loaded = bs.CompliantContact.from_file(springs, SEVEN)
    assert loaded.kz / loaded.kxy == pytest.approx(13 / 40, rel=0.02)
    assert verb("plan", "13.97", *["12"] * 6, "--contact", str(springs), "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    wide = bs.plan([13.97] + [12.0] * 6, SEVEN)
    assert facts["high_mm"][0] - facts["low_mm"][0] < 0.7 * (wide.high_mm - wide.low_mm)[0]
    assert verb("plan", "13.5", *["11.5"] * 6, "--contact", str(table)) == 2
    assert "is not a file of springs" in capsys.readouterr().err


def verb(*arguments):
    with pytest.raises(SystemExit) as end:
        main(list(arguments))
    return end.value.code


def test_nonsense_is_refused():
    with pytest.raises(InvalidInput, match="at least one shape"):
        bs.fit_contact([], LAYOUT)
    with pytest.raises(InvalidInput, match="has 2 and 3"):
        bs.fit_contact([bs.Measured([[1, 1]], [5, 5, 5])], LAYOUT)
    with pytest.raises(InvalidInput, match="at least one height"):
        bs.fit_contact([bs.Measured([[1, 1, 1]], [np.nan] * 3)], LAYOUT)
