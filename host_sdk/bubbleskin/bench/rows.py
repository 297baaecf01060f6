"""One measured figure."""

from typing import NamedTuple


class Row(NamedTuple):
    """What was measured, its figure and unit, and the target as text, empty where there is none."""

    name: str
    figure: float
    unit: str
    target: str = ""
