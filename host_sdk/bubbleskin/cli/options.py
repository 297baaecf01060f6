"""Options that several verbs share."""

from collections.abc import Callable
from functools import wraps
from typing import Any

import click

from bubbleskin import boards
from bubbleskin.errors import InvalidInput


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


device = click.option(
    "--device",
    envvar="BUBBLESKIN_DEVICE",
    metavar="URL",
    show_envvar=True,
    help=f"A port, socket://host:port, sim://{boards.DEFAULT} or micropython://{boards.DEFAULT}. "
    "Default: the only wristband attached.",
)

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
