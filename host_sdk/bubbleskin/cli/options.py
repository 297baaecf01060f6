"""Options that several verbs share."""

import click

device = click.option(
    "--device",
    envvar="BUBBLESKIN_DEVICE",
    metavar="URL",
    show_envvar=True,
    help="A port, socket://host:port, sim://wristband7 or micropython://wristband7. Default: the only wristband attached.",
)

as_json = click.option("--json", is_flag=True, help="Print JSON, for scripts.")
