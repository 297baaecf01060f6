"""What every public function asks of its arguments, and how it says no: what was given, what is allowed, what to write."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from bubbleskin.errors import InvalidInput

Numbers = TypeVar("Numbers", float, NDArray[np.float64])
"""One number or an array of them: what goes in as one comes out as one."""

_NO_NUMBERS = {
    "b": "yes or no",
    "c": "complex",
    "m": "spans of time",
    "M": "dates",
    "S": "texts",
    "U": "texts",
    "V": "records",
}
"""Kinds of numpy's arrays that would become numbers without anybody noticing what got lost."""
SEED_MAX = 2**32 - 1
_SHOWN = 60
_MOST = 10_000_000
"""Entries that are taken at all: of a heightfield 3000 by 3000, of measurements days."""
_PLACES = 5


def shown(value: Any) -> str:
    """A value in a sentence: short, whatever its `repr` does."""
    try:
        text = " ".join(repr(value).split())
    except Exception:  # 10**5000 has none, and other people's classes have what they have
        text = f"a {type(value).__name__}"
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 1]}…"


def array(name: str, value: Any) -> NDArray[np.float64]:
    """``value`` as a float array of real numbers; nan and inf pass. Masked entries are refused by their places."""
    _refuse_more(name, value)
    if isinstance(value, np.ma.MaskedArray):
        refuse_places(name, "masked", np.ma.getmaskarray(value))
        value = np.ma.getdata(value)
    unit = getattr(value, "units", None) or getattr(value, "unit", None)
    if unit is not None and not isinstance(value, np.ndarray | np.generic):
        raise InvalidInput(f"{name} carries the unit {unit}; convert it, and give its plain numbers.")
    try:
        raw = np.asarray(value)
        if raw.dtype.kind == "O":
            raw = np.array([_real(one) for one in raw.ravel()], dtype=float).reshape(raw.shape)
        no_numbers = _NO_NUMBERS.get(raw.dtype.kind)
        if no_numbers is None:
            return raw.astype(float)
    except OverflowError:
        raise InvalidInput(f"{name} is {shown(value)}, which is beyond every number that can be meant.") from None
    except Exception as error:  # a tensor on another machine, a nested list with a gap: each library raises its own
        why = "" if isinstance(error, TypeError) else f" ({_reason(error)})"
        raise InvalidInput(f"{name} must be a number or an array of numbers, not {shown(value)}{why}.") from None
    raise InvalidInput(f"{name} must be a number or an array of numbers, not {no_numbers}: {shown(value)}.")


def _refuse_more(name: str, value: Any) -> None:
    """Refuse more entries than anything here can mean, before they take memory."""
    try:
        count = len(value)
    except Exception:
        return
    if count > _MOST:
        raise InvalidInput(f"{name} has {count} entries; {_MOST} at most can be meant.")


def _reason(error: Exception) -> str:
    """Why a library could not make an array, in few words."""
    said = " ".join(str(error).split())
    return "its rows differ in length" if "inhomogeneous" in said else said[:_SHOWN].rstrip(".")


def _real(value: Any) -> float:
    """One entry of an array of objects, as a number; None is nan."""
    if value is None or value is np.ma.masked:
        return math.nan
    if isinstance(value, bool | np.bool_ | str | bytes | complex):
        raise TypeError
    return float(value)


def refuse_places(name: str, what: str, where: NDArray[np.bool_]) -> None:
    """Refuse an array some of whose entries are `what`, such as masked, and say which."""
    if not where.any():
        return
    places = [tuple(map(int, place)) for place in np.argwhere(where)]
    said = ", ".join(str(place[0] if len(place) == 1 else place) for place in places[:_PLACES] if place)
    more = f" and {len(places) - _PLACES} more" if len(places) > _PLACES else ""
    raise InvalidInput(
        f"{name} is {what}{' at ' * bool(said)}{said}{more}: nothing is known there. "
        "Give numbers, or, for a heightfield, fill='nearest' to take those of the neighbours."
    )


def finite(name: str, value: Any) -> NDArray[np.float64]:
    """``value`` as a float array; refuse what is not a number, and nan and inf by their place."""
    values = array(name, value)
    bad = ~np.isfinite(values)
    if bad.any():
        where = "" if values.ndim == 0 else f" at index {tuple(int(i) for i in np.argwhere(bad)[0])}"
        raise InvalidInput(f"{name} is {values[bad][0]}{where}, but must be a finite number.")
    return values


def number(name: str, value: Any, low: float = -math.inf, high: float = math.inf, unit: str = "") -> float:
    """``value`` as one finite number from ``low`` to ``high``."""
    if type(value) is float and low <= value <= high and math.isfinite(value):
        return value
    one = _one(name, value)
    if not (math.isfinite(one) and low <= one <= high):
        raise InvalidInput(f"{name} is {with_unit(one, unit)}; {_range(low, high, unit)} is allowed.")
    return one


def _one(name: str, value: Any) -> float:
    """``value`` as one number; nan and inf pass."""
    values = array(name, value)
    if values.size != 1:
        raise InvalidInput(f"{name} must be one number, not {values.size} of them.")
    return float(values.item())


def above_zero(name: str, value: Any, high: float = math.inf, unit: str = "") -> float:
    """``value`` as one finite number above zero, up to ``high``."""
    one = _one(name, value)
    if not (math.isfinite(one) and 0 < one <= high):
        up_to = "" if high == math.inf else f", up to {with_unit(high, unit)}"
        raise InvalidInput(f"{name} is {with_unit(one, unit)}; it must be above zero{up_to}.")
    return one


def written(name: str, text: str) -> float:
    """The number that ``text`` is; infinite where it is beyond what a number can be, which no range takes."""
    try:
        if text.isascii() and "_" not in text:
            return float(text)
    except ValueError:
        pass
    point = f"; write {text.replace(',', '.')}" if text.count(",") == 1 else ""
    raise InvalidInput(f"{name} is {shown(text)}, which is not a number{point}.")


def whole(name: str, value: Any, low: int, high: int, unit: str = "") -> int:
    """``value`` as one whole number from ``low`` to ``high``."""
    if type(value) is int:
        one = value
    elif isinstance(value, np.integer) and not isinstance(value, np.timedelta64):  # which numpy counts among them
        one = int(value)
    else:
        real = number(name, value)
        one = round(real)
        if real != one:
            raise InvalidInput(f"{name} is {shown(value)}, but must be a whole number.")
    if not low <= one <= high:
        raise InvalidInput(f"{name} is {shown(one)}{' ' * bool(unit)}{unit}; {_range(low, high, unit)} is allowed.")
    return one


def positive(name: str, value: Any, unit: str) -> NDArray[np.float64]:
    """``value`` as a float array of finite numbers above zero."""
    values = finite(name, value)
    if np.any(values <= 0):
        raise InvalidInput(f"{name} is {np.min(values):g}{' ' * bool(unit)}{unit}, but must be above zero.")
    return values


def one_of(name: str, value: Any, allowed: Sequence[str]) -> str:
    """``value`` where it is one of the words ``allowed``."""
    if not isinstance(value, str) or value not in allowed:
        raise InvalidInput(f"{name} is {shown(value)}, but must be one of {', '.join(map(repr, allowed))}.")
    return value


def text(name: str, value: Any) -> str:
    """``value`` where it is a text."""
    if not isinstance(value, str):
        raise InvalidInput(f"{name} is {shown(value)}; give a text.")
    return value


def flag(name: str, value: Any) -> bool:
    """``value`` where it is True or False: a text would count as True, even 'no'."""
    if not isinstance(value, bool | np.bool_):
        raise InvalidInput(f"{name} is {shown(value)}; give True or False.")
    return bool(value)


def instance(name: str, value: Any, kind: type | tuple[type, ...], say: str) -> Any:
    """``value`` where it is of this kind; ``say``: what to give instead, such as 'a Layout'."""
    if not isinstance(value, kind):
        raise InvalidInput(f"{name} is {shown(value)}; give {say}.")
    return value


def function(name: str, value: Any, say: str) -> Any:
    """``value`` where it can be called; ``say``: what to give instead, such as 'a function of one number'."""
    if not callable(value):
        raise InvalidInput(f"{name} is {shown(value)}; give {say}.")
    return value


def several(name: str, value: Any, say: str) -> list[Any]:
    """The entries of ``value`` where it has some and is no text; ``say``: what to give instead."""
    if isinstance(value, str | bytes | dict) or not isinstance(value, Iterable):
        raise InvalidInput(f"{name} is {shown(value)}; give {say}.")
    _refuse_more(name, value)
    return list(value)


def like(given: Numbers, result: Any) -> Numbers:
    """``result`` as a float if ``given`` was a scalar, else as the array that it is."""
    same: Any = float(result) if np.ndim(given) == 0 else result
    return same


def with_unit(value: float, unit: str) -> str:
    """A number and its unit."""
    number = str(value) if isinstance(value, int) else f"{value:g}"
    return f"{number} {unit}" if unit else number


def _range(low: float, high: float, unit: str) -> str:
    """What is allowed, such as '0 to 60 s'."""
    if (low, high) == (-math.inf, math.inf):
        return "any finite number"
    if high == math.inf:
        return f"{with_unit(low, unit)} or more"
    if low == -math.inf:
        return f"up to {with_unit(high, unit)}"
    return f"{with_unit(low, '')} to {with_unit(high, unit)}"
