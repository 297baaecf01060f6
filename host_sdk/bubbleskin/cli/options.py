"""Options that several verbs share."""

import math
from collections.abc import Callable
from functools import wraps
from typing import Any

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn, TimeElapsedColumn

from bubbleskin import boards, checks
from bubbleskin.errors import InvalidInput
from bubbleskin.sequence.steps import TIMES_MAX


class Board(click.ParamType):
    """A board: the name of one of ours, or the path of a board's file. It becomes a name or an absolute path."""

    name = "board"

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """What help says."""
        return f"[{'|'.join(boards.NAMES)}|FILE.py]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Refuse what is no board."""
        try:
            own = boards.own_file(boards.load(value))
        except InvalidInput as error:
            self.fail(str(error), param, ctx)
        return str(own or value)


class Real(click.ParamType):
    """A number from `low` to `high`, checked as those of the SDK are; `above_zero` leaves 0 out."""

    name = "float"

    def __init__(
        self, low: float = -math.inf, high: float = math.inf, unit: str = "", *, above_zero: bool = False
    ) -> None:
        self.low, self.high, self.unit, self.above_zero = low, high, unit, above_zero

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Refuse what is no number, and numbers beyond the range."""
        name = _name(param)
        number = _number(name, value)
        if self.above_zero:
            return checks.above_zero(name, number, self.high, self.unit)
        return checks.number(name, number, self.low, self.high, self.unit)


class Whole(click.ParamType):
    """A whole number from `low` to `high`, checked as those of the SDK are."""

    name = "integer"

    def __init__(self, low: int, high: int) -> None:
        self.low, self.high = low, high

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Refuse what is no whole number, and numbers beyond the range."""
        name = _name(param)
        return checks.whole(name, _number(name, value), self.low, self.high)


def _name(param: click.Parameter | None) -> str:
    return param.opts[-1] if param else "The number"


def _number(name: str, value: Any) -> float:
    return checks.written(name, value) if isinstance(value, str) else float(value)


SEED = Whole(0, checks.SEED_MAX)
LOOPS = Whole(0, TIMES_MAX)


def progress(console: Console, *columns: ProgressColumn) -> Progress:
    """Bars that go away: for who looks at a terminal, and no line of a file that keeps what was said."""
    return Progress(*columns, console=console, transient=True, disable=not console.is_terminal)


def progress_of_parts(console: Console) -> Progress:
    """`progress` for work of a known number of parts: what is done now, how much of all is done, and the time."""
    percent = TextColumn("{task.percentage:3.0f} %")
    return progress(console, TextColumn("{task.description}"), BarColumn(), percent, TimeElapsedColumn())


device = click.option(
    "--device",
    envvar="BUBBLESKIN_DEVICE",
    metavar="URL",
    show_envvar=True,
    help=f"A port, socket://host:port, sim://{boards.DEFAULT} or micropython://{boards.DEFAULT}. "
    "Default: the only wristband attached.",
)

device_or_simulated = click.option(
    "--device",
    envvar="BUBBLESKIN_DEVICE",
    metavar="URL",
    default=f"sim://{boards.DEFAULT}",
    show_default=True,
    show_envvar=True,
)
"""Of verbs that show something where there is no wristband."""

as_json = click.option("--json", is_flag=True, help="Print JSON, for scripts.")


def gathered(**groups: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Options that belong together reach a verb as one: `gathered(use=Use)` makes its argument `use`, a NamedTuple `Use`."""

    def decorate(verb: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(verb)
        def run(**options: Any) -> Any:
            for name, group in groups.items():
                options[name] = group(**{field: options.pop(field) for field in group._fields})
            return verb(**options)

        return run

    return decorate
