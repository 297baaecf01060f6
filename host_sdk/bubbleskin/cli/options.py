"""Options that several verbs share."""

from collections.abc import Callable
from functools import wraps
from typing import Any

import click

device = click.option(
    "--device",
    envvar="BUBBLESKIN_DEVICE",
    metavar="URL",
    show_envvar=True,
    help="A port, socket://host:port, sim://wristband7 or micropython://wristband7. Default: the only wristband attached.",
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
