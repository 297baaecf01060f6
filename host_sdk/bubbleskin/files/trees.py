"""JSON and TOML: nested values, with the place of a mistake by line and column."""

import json
import tomllib
from typing import Any

from bubbleskin.checks import shown
from bubbleskin.errors import InvalidInput


def parse_json(text: str, where: str) -> Any:
    """The values in a JSON text; `where` is how sentences call it."""
    try:
        return json.loads(text, object_pairs_hook=_once, parse_constant=_constant)
    except json.JSONDecodeError as error:
        raise InvalidInput(f"{where} is not JSON: {error.msg} in line {error.lineno}, column {error.colno}.") from None
    except RecursionError:
        raise InvalidInput(f"{where} is not JSON that can be meant: it is nested too deep.") from None
    except ValueError as error:
        raise InvalidInput(f"{where} is not JSON: {error}.") from None


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """The values in a TOML text; `where` is how sentences call it."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InvalidInput(f"{where} is not readable: it is nested too deep.") from None
    except Exception as error:  # dates and numbers beyond Python's raise what they like
        raise InvalidInput(f"{where} is not readable: {str(error).rstrip('.') or type(error).__name__}.") from None


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object; a key that stands in it twice means two things."""
    made = dict(pairs)
    if len(made) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise ValueError(f"{shown(twice)} stands twice in one object")
    return made


def _constant(name: str) -> float:
    raise ValueError(f"{name} is no number of JSON")
