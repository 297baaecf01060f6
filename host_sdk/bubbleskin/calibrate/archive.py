"""The file of a calibration: JSON, its raw data by bubble and tick as whole numbers, and what was found of them.

Only the raw data is read again. What it claims to be is held against what a wristband can say before anything is fitted.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from bubbleskin import checks, files
from bubbleskin.calibrate.measure import Measured
from bubbleskin.calibrate.nominal import Nominal
from bubbleskin.calibrate.trace import Trace
from bubbleskin.errors import InvalidInput

Floats = NDArray[np.float64]

FORMAT = 1
_WHAT = "the calibration"
_TICKS_LEAST, _TICKS_MOST = 8, 20_000
_TRACES_MOST = 32
_BUBBLES_MOST = 64
_PA_MOST, _US_MOST = 200_000.0, 100_000.0
_SIGNALS = ("pressure_pa", "fill_us", "vent_us")


class Read(NamedTuple):
    """What stands in a file."""

    board: str
    nominal: Nominal
    atmosphere_kpa: float
    zero_counts: tuple[int, ...]
    measured: Measured
    sizes: dict[int, tuple[float, float]]


def text(
    board: str,
    nominal: Nominal,
    atmosphere_kpa: float,
    zero_counts: tuple[int, ...],
    measured: Measured,
    sizes: Mapping[int, tuple[float, float]],
    found: Any,
) -> str:
    """The file's text; `found` is for people."""
    head = {
        "bubbleskin_calibration": FORMAT,
        "board": board,
        "atmosphere_kpa": atmosphere_kpa,
        "zero_counts": list(zero_counts),
        "zero_pa": [round(float(zero), 3) for zero in measured.zero_pa],
        "device_s": measured.device_s,
        "nominal": nominal._asdict(),
        "sizes": {str(bubble): list(size) for bubble, size in sizes.items()},
        "found": found,
    }
    lines = [f"{json.dumps(key)}: {json.dumps(value, ensure_ascii=False)}" for key, value in head.items()]
    traces = ",\n".join(_trace_text(trace) for trace in measured.traces)
    return "{\n" + ",\n".join(lines) + ',\n"traces": [\n' + traces + "\n]\n}\n"


def _trace_text(trace: Trace) -> str:
    facts: dict[str, Any] = {
        "bubbles": list(trace.bubbles),
        "tick_s": trace.tick_s,
        "fitted_from": trace.fitted_from,
        "lost": trace.lost,
        "faults": {str(bubble): list(names) for bubble, names in trace.faults.items()},
        "others_pa": {str(bubble): round(pressure) for bubble, pressure in trace.others_pa.items()},
        "supply_pa": np.rint(trace.supply_pa).astype(int).tolist(),
    }
    facts |= {name: np.rint(getattr(trace, name)).astype(int).T.tolist() for name in _SIGNALS}
    return "{" + ",\n".join(f"{json.dumps(key)}: {json.dumps(value)}" for key, value in facts.items()) + "}"


def read(path: str | Path) -> Read:
    """What `text` made; `InvalidInput` says where a file is wrong."""
    name = f"The calibration {path}"
    tree = files.parse_json(files.read_text(path, _WHAT), name)
    if not isinstance(tree, dict) or tree.get("bubbleskin_calibration") != FORMAT:
        raise InvalidInput(f"{name} is none of this version; make it with `bubbleskin calibrate --output FILE`.")
    try:
        return _read(tree)
    except KeyError as missing:
        raise InvalidInput(f"{name} has no {missing.args[0]}; it is not whole. Calibrate again.") from None
    except InvalidInput as error:
        raise InvalidInput(f"{name}: {error}") from None


def _read(tree: dict[str, Any]) -> Read:
    zeros = _list("zero_counts", tree["zero_counts"], _BUBBLES_MOST)
    count = len(zeros)
    traces = tuple(_trace(one, count) for one in _list("traces", tree["traces"], _TRACES_MOST))
    together = [bubble for trace in traces for bubble in trace.bubbles]
    if len(set(together)) != len(together):
        raise InvalidInput("a bubble stands in two traces.")
    return Read(
        board=checks.text("board", tree["board"]),
        nominal=_nominal(tree["nominal"]),
        atmosphere_kpa=checks.number("atmosphere_kpa", tree["atmosphere_kpa"], 50.0, 120.0, "kPa"),
        zero_counts=tuple(checks.whole("zero_counts", zero, 0, 65535) for zero in zeros),
        measured=Measured(
            traces,
            _numbers("zero_pa", tree["zero_pa"], (count,), -_PA_MOST, _PA_MOST),
            checks.number("device_s", tree["device_s"], 0.0, 1e6, "s"),
        ),
        sizes={key: _size(value) for key, value in _by_bubble("sizes", tree["sizes"], count)},
    )


def _size(value: Any) -> tuple[float, float]:
    factor, sd = _numbers("sizes", value, (2,), 0.0, 2.0)
    return checks.number("sizes", float(factor), 0.5, 2.0), checks.number("sizes", float(sd), 1e-6, 2.0)


def _nominal(tree: Any) -> Nominal:
    if not isinstance(tree, dict) or set(tree) != set(Nominal._fields):
        raise InvalidInput(f"nominal must have exactly {', '.join(Nominal._fields)}.")
    values = {key: checks.number(key, value, 1e-6, 1e9) for key, value in tree.items()}
    if not values["rest_mm"] < values["height_max_mm"] or not values["critical_ratio"] < 1.0:
        raise InvalidInput("nominal is of no board: heights rise from rest, and a critical ratio is below 1.")
    return Nominal(**values)


def _trace(tree: Any, count: int) -> Trace:
    if not isinstance(tree, dict):
        raise InvalidInput(f"a trace is {checks.shown(tree)}; it has names and values.")
    bubbles = tuple(checks.whole("bubbles", one, 0, count - 1) for one in _list("bubbles", tree["bubbles"], count))
    ticks = len(_list("supply_pa", tree["supply_pa"], _TICKS_MOST))
    if ticks < _TICKS_LEAST or not bubbles:
        raise InvalidInput(
            f"a trace has {len(bubbles)} bubbles and {ticks} readings; one and {_TICKS_LEAST} are the least."
        )
    signals = {
        name: _numbers(name, tree[name], (len(bubbles), ticks), -_PA_MOST, _US_MOST if "us" in name else _PA_MOST).T
        for name in _SIGNALS
    }
    return Trace(
        bubbles=bubbles,
        tick_s=checks.number("tick_s", tree["tick_s"], 1e-4, 1.0, "s"),
        supply_pa=_numbers("supply_pa", tree["supply_pa"], (ticks,), -_PA_MOST, _PA_MOST),
        fitted_from=checks.whole("fitted_from", tree["fitted_from"], 0, _TICKS_MOST),
        lost=checks.whole("lost", tree["lost"], 0, _TICKS_MOST),
        faults={
            key: tuple(checks.text("faults", one) for one in _list("faults", names, 64))
            for key, names in _by_bubble("faults", tree["faults"], count)
        },
        others_pa={
            key: checks.number("others_pa", value, -_PA_MOST, _PA_MOST)
            for key, value in _by_bubble("others_pa", tree["others_pa"], count)
        },
        **signals,
    )


def _list(name: str, value: Any, most: int) -> list[Any]:
    if not isinstance(value, list) or len(value) > most:
        raise InvalidInput(f"{name} is {checks.shown(value)}; a list of at most {most} is due.")
    return value


def _by_bubble(name: str, value: Any, count: int) -> list[tuple[int, Any]]:
    if not isinstance(value, dict):
        raise InvalidInput(f"{name} is {checks.shown(value)}; something for each bubble is due.")
    known = {str(bubble): bubble for bubble in range(count)}
    for key in value:
        if key not in known:
            raise InvalidInput(f"{name} names the bubble {checks.shown(key)}; there are {count}, from 0 on.")
    return [(known[key], one) for key, one in value.items()]


def _numbers(name: str, value: Any, shape: tuple[int, ...], low: float, high: float) -> Floats:
    found = checks.finite(name, value)
    if found.shape != shape:
        _refuse_shape(name, found.shape, shape)
    if found.size and (found.min() < low or found.max() > high):
        raise InvalidInput(f"{name} is from {found.min():g} to {found.max():g}; {low:g} to {high:g} is allowed.")
    return found


def _refuse_shape(name: str, shape: tuple[int, ...], due: tuple[int, ...]) -> NoReturn:
    raise InvalidInput(f"{name} has the shape {shape}; {due} is due.")
