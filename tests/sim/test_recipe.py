"""What a simulated board can be asked for, in URLs, as arguments and as a file."""

from dataclasses import asdict, replace

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.sim import SimulatedBoard, plant_file
from bubbleskin.sim.parameters import PlantParameters, Supply
from bubbleskin.sim.recipe import make_parameters
from bubbleskin.sim.tolerances import IDEAL, REAL, SPRINGS, SUPPLY, draw

REAL_7 = replace(PlantParameters.nominal(7), rubber="real")


def same(one, other):
    assert one.supply == other.supply
    assert one.rubber == other.rubber
    for name in PlantParameters.each():
        assert np.array_equal(getattr(one, name), getattr(other, name)), name


# --- spread ---


def test_everything_that_differs_has_its_tolerance():
    named = [row.name for row in (*IDEAL, *REAL, *SPRINGS)]
    # What is left of one bubble is its history.
    assert sorted([*named, "conditioned"]) == sorted(PlantParameters.each())
    alike = {"relief_range", "polytropic", "critical_ratio", "sensor_offset", "atmosphere", "temperature"}
    assert {row.name for row in SUPPLY} | alike == set(asdict(Supply()))
    assert all(row.meaning for row in (*IDEAL, *REAL, *SPRINGS, *SUPPLY))


@pytest.mark.parametrize("row", [*IDEAL, *REAL, *SPRINGS], ids=lambda row: row.name)
def test_real_rubber_fills_every_tolerance_and_keeps_it(row):
    nominal = replace(PlantParameters.nominal(2000), rubber="real")
    some = draw(nominal, 0.1, seed=3)
    middle, drawn = getattr(nominal, row.name)[0], getattr(some, row.name)
    if row.absolute:
        low, high = max(middle - row.absolute, row.least), middle + row.absolute
    else:
        low, high = middle / (1 + row.share) if row.factor else middle * (1 - row.share), middle * (1 + row.share)
    margin = 0.01 * (high - low)
    assert low * (1 - 1e-12) <= drawn.min() < low + margin
    assert high - margin < drawn.max() <= high * (1 + 1e-12)
    assert not np.array_equal(drawn, getattr(draw(nominal, 0.1, seed=4), row.name))
    assert np.array_equal(getattr(nominal, row.name), getattr(draw(nominal, 0.0, seed=3), row.name))


def test_a_large_spread_leaves_figures_that_can_be():
    wide = draw(REAL_7, 0.5, seed=1)
    with SimulatedBoardOf(parameters=wide) as board:
        assert board.plant.parameters is wide


def test_the_same_seed_has_the_same_walls_in_both_rubbers():
    ideal, real = (make_parameters(7, 5, 0.1, rubber=rubber) for rubber in ("ideal", "real"))
    for row in IDEAL:
        assert np.array_equal(getattr(ideal, row.name), getattr(real, row.name))
    assert ideal.supply.sensor_offset == real.supply.sensor_offset
    same(ideal, PlantParameters.spread(7, 0.1, 5))
    assert not np.array_equal(ideal.c3, real.c3)


def test_springs_are_spread_by_themselves():
    real, ideal = (make_parameters(7, 5, 0.0, springs=0.3, rubber=rubber) for rubber in ("real", "ideal"))
    assert np.ptp(real.kz_up) > 1.0
    assert np.ptp(ideal.kz_up) == 0.0
    assert ideal.kz_up[0] != 10.0
    for figures in (real, ideal):
        for name, middle in (("kz_up", 10.0), ("kz_down", 3000.0), ("kxy", 50.0), ("kc", 300.0)):
            assert np.all((getattr(figures, name) <= 1.3 * middle) & (getattr(figures, name) >= middle / 1.3))
    same(replace(real, **{row.name: getattr(REAL_7, row.name) for row in SPRINGS}), REAL_7)
    assert np.array_equal(make_parameters(7, 5, 0.1, springs=0.0, rubber="real").kc, REAL_7.kc)


# --- options ---


class SimulatedBoardOf:
    """A simulated wristband7, closed again."""

    def __init__(self, **options):
        self.board = SimulatedBoard("wristband7", contact=False, **options)

    def __enter__(self):
        return self.board

    def __exit__(self, *_):
        self.board.close()


@pytest.mark.parametrize(
    ("option", "value", "name", "expected"),
    [
        ("sheet", "stiff25", "mu", 1.25 * 39.62e3),
        ("sheet", "stiff50", "mu", 1.5 * 39.62e3),
        ("sheet", "ecoflex-00-30", "c3", 0.0),
        ("viscosity", "3", "viscosity", 900.0),
        ("leak", "0.01", "leak", 5.3e-8),
        ("atmosphere_kpa", "84", "atmosphere", 84e3),
        ("gas_c", "40", "temperature", 313.15),
        ("rubber", "real", "rubber", "real"),
    ],
)
def test_an_option_is_what_it_says_in_a_url_and_as_an_argument(option, value, name, expected):
    def found(parameters):
        return getattr(parameters, name) if hasattr(parameters, name) else getattr(parameters.supply, name)

    with bs.connect(f"sim://wristband7?contact=0&{option}={value}") as skin:
        said = found(skin.simulated.plant.parameters)
    number = value if option in ("sheet", "rubber") else float(value)
    with SimulatedBoardOf(**{option: number}) as board:
        given = found(board.plant.parameters)
    for one in (said, given):
        assert one == expected if isinstance(expected, str) else one == pytest.approx(expected)


@pytest.mark.parametrize("rubber", ["ideal", "real"])
def test_a_leak_of_one_per_cent_a_second_takes_that_of_a_full_bubble(rubber):
    with SimulatedBoardOf(rubber=rubber, leak=0.01) as board:
        plant = board.plant
        plant.rest_at(12.0)
        before = plant.air
        for _ in range(20):
            plant.advance(5e-3, np.zeros(7), np.zeros(7))
        assert 1 - plant.air / before == pytest.approx(0.001, rel=0.01)


def test_warm_gas_flows_faster_where_the_rubber_is_ideal_too():
    """By volume, as √T through an orifice; both plants agree on the first dose, but that one counts pV and the other mass."""
    doses = {}
    for rubber in ("ideal", "real"):
        for gas in (20.0, 40.0):
            with SimulatedBoardOf(rubber=rubber, gas_c=gas) as board:
                plant = board.plant
                plant.rest_at(10.0)
                before = plant.air
                plant.advance(5e-3, np.full(7, 3e-3), np.zeros(7))
                doses[rubber, gas] = float((plant.air - before)[0])
    warm = np.sqrt(313.15 / 293.15)
    assert doses["ideal", 40.0] / doses["ideal", 20.0] == pytest.approx(warm, rel=2e-3)
    assert doses["real", 40.0] / doses["real", 20.0] == pytest.approx(1 / warm, rel=2e-3)
    assert doses["real", 20.0] == pytest.approx(doses["ideal", 20.0], rel=0.02)


@pytest.mark.parametrize("rubber", ["ideal", "real"])
def test_sensors_are_gauges_at_any_altitude(rubber):
    with SimulatedBoardOf(rubber=rubber, atmosphere_kpa=84.0) as board:
        counts = np.mean([board.plant.sense() for _ in range(50)], axis=0)
        assert counts == pytest.approx(160.0, abs=3.0)
        assert board.plant.supply_pa == pytest.approx(60e3)
        board.plant.rest_at(10.0)
        assert board.plant.pressure_pa == pytest.approx(22.6e3, rel=1e-3)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("rubber=wood", "rubber is 'wood', but must be one of 'ideal', 'real'."),
        ("sheet=steel", "sheet is 'steel', but must be one of 'paper', 'stiff25'"),
        ("gas_c=warm", "gas_c of sim://wristband7 is 'warm', which is not a number"),
        ("gas_c=400", "gas_c is 400 °C; -20 to 60 °C is allowed."),
        ("atmosphere_kpa=nan", "atmosphere_kpa is nan kPa; 50 to 120 kPa is allowed."),
        ("viscosity=0", "viscosity is 0 times the nominal; 0.05 to 20 times the nominal is allowed."),
        ("leak=-1", "leak is -1 of its air a second; 0 to 0.5 of its air a second is allowed."),
        ("springs=2", "springs is 2; 0 to 1 is allowed."),
        ("parameters=3", "has the option 'parameters'; known are seed,"),
        ("plant=nowhere.toml", "Cannot read the plant nowhere.toml: No such file or directory."),
        ("plant=nowhere.toml&spread=0.1&leak=0.1", "plant says all of the plant; leave out leak, spread."),
    ],
)
def test_what_cannot_be_asked_is_a_sentence(options, said):
    with pytest.raises(bs.InvalidInput) as caught:
        bs.connect(f"sim://wristband7?{options}")
    assert said in str(caught.value)


def test_an_argument_that_is_none_is_a_sentence():
    with pytest.raises(bs.InvalidInput, match="A plant has no option 'rubbber'; known are rubber, sheet"):
        SimulatedBoardOf(rubbber="real")


@pytest.mark.parametrize(
    ("figures", "said"),
    [
        ({"mu": np.full(3, 4e4)}, "mu of the plant's parameters has the shape (3,); give 7 numbers"),
        (
            {"viscosity": np.array([300.0] * 6 + [0.0])},
            "viscosity of the plant's parameters is 0.0; give a finite number, more than 0.",
        ),
        (
            {"supply": Supply(volume=np.nan)},
            "volume of the plant's parameters is nan; give a finite number, more than 0.",
        ),
    ],
)
def test_parameters_that_cannot_be_are_a_sentence(figures, said):
    with pytest.raises(bs.InvalidInput) as caught:
        SimulatedBoardOf(parameters=replace(REAL_7, **figures))
    assert said in str(caught.value)


# --- files ---


def test_a_plant_that_is_written_and_read_again_is_the_same_to_the_last_bit(tmp_path):
    path = tmp_path / "my.toml"
    wild = draw(replace(REAL_7, supply=Supply(relief_pressure=np.inf, atmosphere=84e3)), 0.3, seed=9, springs=0.5)
    for figures in (wild, PlantParameters.nominal(7)):
        plant_file.write(path, figures)
        same(plant_file.read(path, 7), figures)


def test_a_board_writes_its_truth_and_another_has_it(tmp_path):
    def after(url, seconds):
        with bs.connect(url) as skin:
            skin.show(np.linspace(6, 12, 7), wait=False)
            skin.sleep(seconds)
            skin.simulated.write_plant(tmp_path / f"{seconds}.toml")
            return skin.simulated.height_mm

    first = after("sim://wristband7?seed=4&spread=0.1&rubber=real&sheet=stiff25", 0.0)
    url = f"sim://wristband7?seed=4&plant={tmp_path}/0.0.toml"
    assert np.array_equal(after(url, 0.0), first)
    whole = after("sim://wristband7?seed=4&spread=0.1&rubber=real&sheet=stiff25", 1.0)
    assert np.array_equal(after(url, 1.0), whole)
    # Later, the file tells what the walls have been through.
    worn = plant_file.read(tmp_path / "1.0.toml", 7).conditioned
    assert worn.max() > 1.5


def test_what_a_file_leaves_out_is_nominal_and_one_number_is_for_all(tmp_path):
    path = tmp_path / "short.toml"
    path.write_text('rubber = "real"\n[bubbles]\nviscosity = 900\n[supply]\natmosphere = 84000.0\n')
    expected = replace(REAL_7, viscosity=np.full(7, 900.0), supply=Supply(atmosphere=84e3))
    same(plant_file.read(path, 7), expected)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("rubber = ideal", "is not readable: "),
        ('rubber = "wood"', "has rubber = 'wood'; choose one of ideal, real."),
        ("mu = 3", "has 'mu' at its top, which nothing there is called; "),
        ("supply = 3", "has supply as a figure; write [supply] on a line, and its figures below it."),
        (
            "[bubbles]\nviscositty = 3",
            "has 'viscositty' in [bubbles], which nothing there is called; did you mean viscosity?",
        ),
        ("[supply]\nviscosity = 3", "has 'viscosity' in [supply], which nothing there is called; "),
        ("[bubbles]\nmu = [1.0, 2.0]", "has 2 numbers for mu; give 7, one for each bubble, or one for all."),
        ('[bubbles]\nmu = "soft"', "has mu = 'soft', which is not a number."),
        (f"[bubbles]\nmu = {10**400}", "a finite number"),
        ("[bubbles]\nmu = true", "has mu = True, which is not a number."),
        ("[bubbles]\nmu = -1.0", "has mu = -1.0; give a finite number, more than 0."),
        ("[bubbles]\nleak = -1.0", "has leak = -1.0; give a finite number, 0 or more."),
        ("[bubbles]\nmullins = 1.0", "has mullins = 1.0; give a number from 0 to less than 1."),
        ("[bubbles]\nneck = nan", "has neck = nan; give a finite number."),
        ("[supply]\nvolume = inf", "has volume = inf; give a finite number, more than 0."),
    ],
)
def test_a_wrong_file_is_a_sentence(text, said, tmp_path):
    path = tmp_path / "wrong.toml"
    path.write_text(text)
    with pytest.raises(bs.InvalidInput) as caught:
        bs.connect(f"sim://wristband7?plant={path}")
    assert str(caught.value).startswith(f"The plant {path} ")
    assert said in str(caught.value)


def test_parameters_that_are_none_are_a_sentence():
    with pytest.raises(bs.InvalidInput, match="parameters is 3; give PlantParameters"):
        SimulatedBoard(parameters=3)


def test_what_is_no_text_and_where_nothing_can_be_written_is_a_sentence(tmp_path):
    path = tmp_path / "picture.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(bs.InvalidInput, match="is not text, so it is not the plant"):
        plant_file.read(path, 7)
    with pytest.raises(bs.InvalidInput, match=r"The plant .* cannot be written: No such file"):
        plant_file.write(tmp_path / "no" / "where.toml", REAL_7)
