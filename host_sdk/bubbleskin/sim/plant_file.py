"""A plant as a file: every figure of every bubble, to be read, changed by hand, and given to a simulated board.

TOML, all in SI units and by the names of `PlantParameters` and `Supply`:

    rubber = "real"
    [supply]
    atmosphere = 84000.0
    [bubbles]
    mu = [39620.0, 41200.0, …]     # one for each bubble,
    viscosity = 900.0              # or one for all
    [wiring]                       # only what is wired wrongly, as of `bubbleskin.sim.wiring`
    tubes = [[1, 4]]

What a file leaves out is nominal. `write` leaves out nothing, and `read` of what it wrote is the same to the last bit.
"""

import json
import math
from dataclasses import asdict, fields
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from bubbleskin.checks import shown
from bubbleskin.errors import InvalidInput
from bubbleskin.files import parse_toml, read_text, write_text
from bubbleskin.sim.parameters import RUBBERS, PlantParameters, Supply, allowed
from bubbleskin.sim.wiring import NAMES, RIGHT, Wiring

_SECTIONS = ("rubber", "supply", "bubbles", "wiring")


def write(path: str | Path, parameters: PlantParameters, about: str = "", wiring: Wiring = RIGHT) -> None:
    """Write `parameters` and `wiring` to the file `path`; `about` goes into its first line. Raises `InvalidInput`."""
    lines = [
        f"# {about or 'The plant of a simulated wristband'}: SI units, one number for each bubble; docs/simulator.md"
    ]
    lines += [f'rubber = "{parameters.rubber}"', "", "[supply]"]
    lines += [f"{name} = {_text(value)}" for name, value in asdict(parameters.supply).items()]
    lines += ["", "[bubbles]"]
    for name in PlantParameters.each():
        lines.append(f"{name} = [{', '.join(map(_text, getattr(parameters, name)))}]")
    if not wiring.right:
        lines += ["", "[wiring]"]
        lines += [f"{name} = {_toml(getattr(wiring, name))}" for name in wiring.said]
    write_text(path, "\n".join(lines) + "\n", "the plant")


def read(path: str | Path, n: int) -> PlantParameters:
    """The plant in the file `path`, of `n` bubbles; `InvalidInput` says where it is wrong and what may stand there."""
    said = _said(path)
    rubber = said.get("rubber", RUBBERS[0])
    if rubber not in RUBBERS:
        raise InvalidInput(f"The plant {path} has rubber = {shown(rubber)}; choose one of {', '.join(RUBBERS)}.")
    supply = _section(path, said, "supply", [f.name for f in fields(Supply)])
    bubbles = _section(path, said, "bubbles", PlantParameters.each())
    nominal = PlantParameters.nominal(n)
    figures: dict[str, Any] = {name: getattr(nominal, name) for name in PlantParameters.each()}
    figures |= {name: _numbers(path, name, value, n) for name, value in bubbles.items()}
    return PlantParameters(
        **figures, supply=Supply(**{name: _number(path, name, value) for name, value in supply.items()}), rubber=rubber
    )


def read_wiring(path: str | Path, n: int) -> Wiring:
    """How the board of `n` bubbles in the file `path` is wired; without a section [wiring] as it should be."""
    found = _section(path, _said(path), "wiring", list(NAMES))
    for name, value in found.items():
        shape = "a text" if name == "estop" else "a list of texts" if name == "dead" else "a list of pairs"
        if not _is_shaped(name, value):
            raise InvalidInput(f"The plant {path} has {name} = {shown(value)} in [wiring]; give {shape}.")
    return Wiring(**{name: _tuples(value) for name, value in found.items()}).checked(n)


def _is_shaped(name: str, value: Any) -> bool:
    if name == "estop":
        return isinstance(value, str)
    if name == "dead":
        return isinstance(value, list) and all(isinstance(one, str) for one in value)
    return isinstance(value, list) and all(isinstance(pair, list) and len(pair) == 2 for pair in value)


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def _toml(value: Any) -> str:
    return f"[{', '.join(map(_toml, value))}]" if isinstance(value, tuple) else json.dumps(value)


def _said(path: str | Path) -> dict[str, Any]:
    said = parse_toml(read_text(path, "the plant"), f"The plant {path}")
    for name in said:
        if name not in _SECTIONS:
            _unknown(path, name, "at its top", _SECTIONS)
    return said


def _section(path: str | Path, said: dict[str, Any], section: str, known: list[str]) -> dict[str, Any]:
    found = said.get(section, {})
    if not isinstance(found, dict):
        raise InvalidInput(
            f"The plant {path} has {section} as a figure; write [{section}] on a line, and its figures below it."
        )
    for name in found:
        if name not in known:
            _unknown(path, name, f"in [{section}]", known)
    return found


def _text(value: float) -> str:
    return repr(float(value))


def _unknown(path: str | Path, name: str, where: str, known: Any) -> NoReturn:
    near = get_close_matches(name, known, 1)
    may = f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}."
    raise InvalidInput(f"The plant {path} has {shown(name)} {where}, which nothing there is called; {may}")


def _numbers(path: str | Path, name: str, value: Any, n: int) -> np.ndarray:
    if not isinstance(value, list):
        return np.full(n, _number(path, name, value))
    if len(value) != n:
        raise InvalidInput(
            f"The plant {path} has {len(value)} numbers for {name}; give {n}, one for each bubble, or one for all."
        )
    return np.array([_number(path, name, one) for one in value])


def _number(path: str | Path, name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InvalidInput(f"The plant {path} has {name} = {shown(value)}, which is not a number.")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    may = allowed(name, number)
    if may:
        raise InvalidInput(f"The plant {path} has {name} = {shown(value)}; give {may}.")
    return number
