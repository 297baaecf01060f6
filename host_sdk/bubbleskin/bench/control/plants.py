"""Plants to hold heights on: kinds of sheets, and what a calibration knows of each.

Every sheet is drawn by its seed: bubbles, valves and sensors as of `bubbleskin.sim.tolerances`. A calibration leaves errors of
its own, drawn by the same seed: of the wall, of flows and dead times of either valve, of the zero. Nobody measures the sensor's
gain or the volume of the line, so the plant is off by theirs. What trades with a flow (the supply's sensor, the restrictor's
critical ratio) or cannot be seen at all (the neck) is nominal. Tables are of rubber as it was made; it has been stretched since.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bubble_firmware.control.flow import flow_gain
from bubble_firmware.control.table import pressure_top
from bubbleskin import boards
from bubbleskin.device.trim import Trim
from bubbleskin.errors import InvalidInput
from bubbleskin.membrane import Table, YeohBalloon, build_table
from bubbleskin.membrane.balloon import yeoh_pressure
from bubbleskin.sim.parameters import PlantParameters, Supply
from bubbleskin.sim.pneumatics import REFERENCE_TEMPERATURE, RESTRICTOR
from bubbleskin.sim.recipe import PlantOptions, make_parameters
from bubbleskin.sim.tolerances import SPREAD

BOARD = boards.DEFAULT

_STIFFNESS_SD = 0.001  # of μ h0
_WALL_SD = 0.004  # of h0
_FLOW_SD = 0.006
_DEAD_TIME_SD = 50e-6  # s
_LINE_SD = 0.01
_SENSOR_SD = 0.005
_ZERO_SD = 3.0  # Pa
_SHARE = 65536  # of a trim's shares
_WALLS = ("mu", "c2", "c3", "thickness", "radius")
_STIFFEST = (
    0.99  # of the pressure that the board's tables may have at its greatest height: a calibration adds its errors
)
_ATTEMPTS, _ATTEMPT_SEEDS = 100, 1_000_000
_LEAK_UNIT = 16e9  # of a trim's leak in a m³/s per Pa


@dataclass(frozen=True)
class Kind:
    """One row of the table: what the sheets are, and which heights are asked of them."""

    name: str
    plant: PlantOptions
    rms_mm: float | None = None
    """The goal: RMS of true heights at any time; None where it is what it is."""
    pulses: float | None = None
    """The goal: per bubble and second at rest."""
    sheets: float = SPREAD
    """Spread of walls and rubber, where it is less than that of all else: a stiff sheet is near what the board allows."""
    lowest_mm: float = 5.5
    highest_mm: float = 13.0
    calibrated: bool = True
    curve_sd: float | None = None
    """What a calibration finds of how well a table says pressures; None is the board's, with the memory of rubber."""
    leak_known: bool = False
    warm: bool = False
    """Whether the calibration was made at the plant's temperature; else at 20 °C."""
    settled_wrong: float | None = None
    """The goal: share of bubbles that say settled and are more than 0.5 mm off."""


def _real(**options: object) -> PlantOptions:
    return PlantOptions(rubber="real", **options)  # type: ignore[typeddict-item]


KINDS = (
    Kind("paper's sheet, ideal rubber", PlantOptions(), 0.05, 0.5, curve_sd=0.01),
    Kind("real rubber", _real(), 0.12, 1.0),
    Kind("μ × 1.25, real rubber", _real(sheet="stiff25"), 0.20, 2.0, sheets=0.03),
    Kind("μ × 1.5, real rubber", _real(sheet="stiff50"), 0.20, 2.0, sheets=0.005),
    Kind("Ecoflex 00-30, real rubber", _real(sheet="ecoflex-00-30"), 0.25, 2.0),
    Kind("viscosity × 3, real rubber", _real(viscosity=3.0), 0.12),
    Kind("80 kPa atmosphere", _real(atmosphere_kpa=80.0), 0.15),
    Kind("105 kPa atmosphere", _real(atmosphere_kpa=105.0), 0.15),
    Kind("0 °C, calibrated there", _real(gas_c=0.0), 0.15, warm=True),
    Kind("0 °C, calibrated at 20 °C", _real(gas_c=0.0), 0.15),
    Kind("40 °C, calibrated at 20 °C", _real(gas_c=40.0), 0.15),
    Kind("leak 1 %/s, known", _real(leak=0.01), 0.15, leak_known=True),
    Kind("leak 1 %/s, unknown", _real(leak=0.01), 0.15),
    Kind("nobody has calibrated, ideal rubber", PlantOptions(), calibrated=False, settled_wrong=0.01),
    Kind("nobody has calibrated, real rubber", _real(), calibrated=False, settled_wrong=0.01),
)
REAL = KINDS[1]
"""On which longer ways are gone, too."""


class Sheet(NamedTuple):
    """Bubbles of one board, and what is known of each; without a calibration `tables` and `trim` are None."""

    kind: Kind
    seed: int
    parameters: PlantParameters
    tables: list[Table] | None
    trim: Trim | None


def sheet(kind: Kind, seed: int) -> Sheet:
    """The sheet of this kind that this seed draws."""
    board = boards.load(BOARD)
    n = board.BUBBLES
    parameters = make_parameters(n, seed, SPREAD, **kind.plant)
    if not kind.calibrated:
        return Sheet(kind, seed, parameters, None, None)
    rng = np.random.default_rng((seed, *b"calibration"))
    nominal = PlantParameters.nominal(n)
    supply = parameters.supply
    walls: dict[str, Any] = _walls(kind, n, seed)
    parameters = replace(
        parameters,
        **walls,
        sensor_gain=1.0 + rng.normal(0.0, _SENSOR_SD, n),
        node_volume=nominal.node_volume,
        tube_volume=nominal.tube_volume + (nominal.node_volume + nominal.tube_volume) * rng.normal(0.0, _LINE_SD, n),
        critical_ratio=nominal.critical_ratio,
        neck=nominal.neck,
        leak=make_parameters(n, seed, 0.0, **kind.plant).leak,
        supply=replace(supply, sensor_gain=Supply.sensor_gain, sensor_offset=Supply.sensor_offset),
    )
    trim, rest = _trim(kind, parameters, rng)
    return Sheet(kind, seed, parameters, _tables(parameters, rest, rng), trim)


def _walls(kind: Kind, n: int, seed: int) -> dict[str, NDArray[np.float64]]:
    """Figures of walls and rubber; what is too stiff for the board's tables is drawn again."""
    board = boards.load(BOARD)
    walls: dict[str, NDArray[np.float64]] = {}
    stiff = np.ones(n, bool)
    for attempt in range(_ATTEMPTS):
        drawn = make_parameters(n, seed + attempt * _ATTEMPT_SEEDS, kind.sheets, **kind.plant)
        walls = {name: np.where(stiff, getattr(drawn, name), walls.get(name, 0.0)) for name in _WALLS}
        pressure = yeoh_pressure(0.5e-6 * board.HEIGHT_MAX_UM / walls["radius"], **walls)
        stiff = pressure > _STIFFEST * pressure_top(board)
        if not stiff.any():
            return walls
    raise InvalidInput(f"{_ATTEMPTS} draws gave no sheet that {BOARD} can have of {kind.name}: it is too stiff.")


def _trim(kind: Kind, p: PlantParameters, rng: np.random.Generator) -> tuple[Trim, NDArray[np.float64]]:
    """The trim, and what its whole counts leave of each zero, Pa."""
    board = boards.load(BOARD)
    n = len(p.mu)
    offset = p.sensor_offset + rng.normal(0.0, _ZERO_SD, n)
    zero = np.rint(board.SENSOR_ZERO + offset / board.SENSOR_PA_PER_COUNT).astype(int)
    warm = np.sqrt(p.supply.temperature / REFERENCE_TEMPERATURE) if kind.warm else 1.0

    def flow(conductance: NDArray[np.float64]) -> NDArray[np.int64]:
        known = conductance * warm / RESTRICTOR * (1.0 + rng.normal(0.0, _FLOW_SD, n))
        return np.rint(flow_gain(board) * known).astype(int)

    def dead_us(time: NDArray[np.float64]) -> NDArray[np.int64]:
        return np.rint(1e6 * np.maximum(time + rng.normal(0.0, _DEAD_TIME_SD, n), 0.0)).astype(int)

    trim = Trim(
        zero=zero,
        opens_us=dead_us(p.fill_opening),
        closes_us=dead_us(p.fill_closing),
        flow_gain=flow(p.fill_conductance),
        vent_opens_us=dead_us(p.vent_opening),
        vent_closes_us=dead_us(p.vent_closing),
        vent_flow_gain=flow(p.vent_conductance),
        flow_sd=np.full(n, round(_FLOW_SD * _SHARE)),
        curve_sd=None if kind.curve_sd is None else np.full(n, round(kind.curve_sd * _SHARE)),
        leak=np.rint(_LEAK_UNIT * p.leak).astype(int) if kind.leak_known else None,
    )
    return trim, offset - (zero - board.SENSOR_ZERO) * board.SENSOR_PA_PER_COUNT


def _tables(p: PlantParameters, rest: NDArray[np.float64], rng: np.random.Generator) -> list[Table]:
    wall = p.thickness * (1.0 + rng.normal(0.0, _WALL_SD, len(p.mu)))
    mu = p.mu * p.thickness / wall * (1.0 + rng.normal(0.0, _STIFFNESS_SD, len(p.mu)))
    figures = zip(mu, p.c2, p.c3, wall, p.radius, rest, strict=True)
    return [_table(YeohBalloon(mu=m, c2=c2, c3=c3, thickness=h, radius=r), off) for m, c2, c3, h, r, off in figures]


def _table(balloon: YeohBalloon, rest: float) -> Table:
    table = build_table(balloon)
    return Table(table.height_um, np.maximum(np.rint(table.pressure_pa + rest), 0).astype(int))


def kind_named(name: str) -> Kind:
    """The kind of that name."""
    for kind in KINDS:
        if kind.name == name:
            return kind
    raise InvalidInput(f"There are no plants called {name!r}; there are {', '.join(kind.name for kind in KINDS)}.")
