"""From what somebody asks of a simulated board to the plant behind it."""

from dataclasses import asdict, replace
from pathlib import Path
from types import ModuleType
from typing import TypedDict, Unpack

import numpy as np

from bubbleskin import checks
from bubbleskin.contact.model import CompliantContact
from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout
from bubbleskin.sim import plant_file
from bubbleskin.sim.parameters import RUBBERS, PlantParameters, allowed
from bubbleskin.sim.plant import Plant
from bubbleskin.sim.tolerances import draw

_PAPER = PlantParameters.nominal(1)
_MU, _C2, _C3 = (float(figure[0]) for figure in (_PAPER.mu, _PAPER.c2, _PAPER.c3))
SHEETS = {
    "paper": (_MU, _C2, _C3),
    "stiff25": (1.25 * _MU, _C2, _C3),
    "stiff50": (1.50 * _MU, _C2, _C3),
    "ecoflex-00-30": (15.78e3, 91.8, 0.0),
}
"""μ, C2 and C3 in Pa: the display paper's fit, 25 and 50 % stiffer ones that snap through, and Ecoflex 00-30 in tension
(L. Marechal et al., Soft Robotics Materials Database, 2021, fitted with C3 ≥ 0)."""

WHOLE_LEAK = 5.3e-6
"""RTṁ per Pa gauge, m³/s, at which a bubble of the paper's rubber at 12 mm begins to lose all of its air in a second."""


class PlantOptions(TypedDict, total=False):
    """What the plant of a simulated board can be asked to be, besides `seed`, `spread` and `contact`."""

    rubber: str
    """"ideal" (the default): the tables' own curve, no memory. "real": `docs/simulator.md`."""
    sheet: str
    """One of `SHEETS`; "paper" is what the board's tables are made of."""
    springs: float
    """How much the springs of necks, base and contact differ from the nominal: 0.3 for ± 30 %. Without it `spread` says so
    where the rubber is real."""
    atmosphere_kpa: float
    """Pressure of the air outside; 101.325."""
    gas_c: float
    """Temperature of gas and walls; 20."""
    viscosity: float
    """By how much more viscous than the nominal the rubber is; 1."""
    leak: float
    """Share of its air that a bubble at 12 mm loses in a second; 0."""
    parameters: PlantParameters
    """All figures, one entry per bubble, instead of those above and of `spread`."""
    plant: str | Path
    """The same in a file, as of `bubbleskin.sim.plant_file`."""


NUMBERS = {
    "springs": (0.0, 1.0, ""),
    "atmosphere_kpa": (50.0, 120.0, "kPa"),
    "gas_c": (-20.0, 60.0, "°C"),
    "viscosity": (0.05, 20.0, "times the nominal"),
    "leak": (0.0, 0.5, "of its air a second"),
}
"""Limits of each number, and its unit."""

_WHOLE = ("parameters", "plant")


def make_plant(data: ModuleType, seed: int, spread: float, contact: bool, **options: Unpack[PlantOptions]) -> Plant:
    """The bubbles of a board, where its layout says; the rest as of `SimulatedBoard`."""
    n = data.BUBBLES
    parameters = make_parameters(n, seed, spread, **options)
    model = None
    if contact:
        p, layout = parameters, Layout.from_um(data.LAYOUT, data.PITCH_UM)
        kz, kbase, kxy, kc = (float(spring.mean()) for spring in (p.kz_up, p.kz_down, p.kxy, p.kc))
        model = CompliantContact(layout, kz=kz, kbase=kbase, kxy=kxy, kc=kc)
    return Plant(parameters, seed=seed, contact=model)


def make_parameters(n: int, seed: int, spread: float, **options: Unpack[PlantOptions]) -> PlantParameters:
    """The figures of `n` bubbles; `InvalidInput` for what cannot be asked."""
    _check(spread, options)
    if "parameters" in options:
        return _checked(options["parameters"], n)
    if "plant" in options:
        return plant_file.read(options["plant"], n)
    nominal = PlantParameters.nominal(n)
    mu, c2, c3 = SHEETS[options.get("sheet", "paper")]
    asked = {"mu": mu, "c2": c2, "c3": c3, "leak": WHOLE_LEAK * options.get("leak", 0.0)}
    supply = replace(nominal.supply, temperature=273.15 + options.get("gas_c", 20.0))
    if "atmosphere_kpa" in options:
        supply = replace(supply, atmosphere=1e3 * options["atmosphere_kpa"])
    figures = replace(
        nominal,
        **{name: np.full(n, value) for name, value in asked.items()},
        viscosity=options.get("viscosity", 1.0) * nominal.viscosity,
        rubber=options.get("rubber", "ideal"),
        supply=supply,
    )
    return draw(figures, spread, seed, springs=options.get("springs"))


def _check(spread: float, options: PlantOptions) -> None:
    for name in options:
        if name not in PlantOptions.__annotations__:
            raise InvalidInput(f"A plant has no option {name!r}; known are {', '.join(PlantOptions.__annotations__)}.")
    for name, choice in (("rubber", RUBBERS), ("sheet", tuple(SHEETS))):
        checks.one_of(name, options.get(name, choice[0]), choice)
    for name, (least, most, unit) in NUMBERS.items():
        checks.number(name, options.get(name, least), least, most, unit)
    whole = [name for name in _WHOLE if name in options]
    others = [name for name in options if name not in _WHOLE] + ["spread"] * bool(spread)
    if whole and (others or len(whole) > 1):
        raise InvalidInput(f"{whole[0]} says all of the plant; leave out {', '.join(whole[1:] + others)}.")


def _checked(parameters: PlantParameters, n: int) -> PlantParameters:
    checks.instance("parameters", parameters, PlantParameters, "PlantParameters, such as PlantParameters.nominal(7)")
    for name in PlantParameters.each():
        values = np.asarray(getattr(parameters, name))
        if values.shape != (n,):
            raise InvalidInput(
                f"{name} of the plant's parameters has the shape {values.shape}; give {n} numbers, one for each bubble."
            )
        for value in values:
            _refuse(name, value)
    for name, value in asdict(parameters.supply).items():
        _refuse(name, value)
    return parameters


def _refuse(name: str, value: float) -> None:
    may = allowed(name, value)
    if may:
        raise InvalidInput(f"{name} of the plant's parameters is {value}; give {may}.")
