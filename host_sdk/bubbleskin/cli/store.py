"""`bubbleskin store`: what a wristband keeps without power."""

import dataclasses
import json as jsonlib

import click
from rich.console import Console
from rich.table import Table

from bubbleskin.cli.options import as_json, device
from bubbleskin.connecting import connect
from bubbleskin.errors import InvalidInput


@click.command()
@click.option("--save", is_flag=True, help="Keep the tables, trim and settings that are in use.")
@click.option("--reset", is_flag=True, help="Forget what is kept; use what the firmware was made with.")
@device
@as_json
def store(save: bool, reset: bool, device: str | None, json: bool) -> None:
    """Say what the wristband keeps without power; keep what is in use, or forget it. Both only while it is vented."""
    if save and reset:
        raise InvalidInput("Say one of --save and --reset: what is saved would be forgotten at once.")
    with connect(device) as skin:
        info = skin.save() if save else skin.factory_reset() if reset else skin.stored()
        in_use = skin.health().tables_crc
    facts = dataclasses.asdict(info) | {"tables_in_use": in_use, "tables_saved": in_use == info.tables_crc}
    if json:
        click.echo(jsonlib.dumps(facts, indent=2))
        return
    table = Table(show_header=False, box=None)
    for name, value in facts.items():
        shown = f"{value:08x}" if name in ("tables_crc", "tables_in_use") else value
        if isinstance(value, tuple):
            shown = f"{value[0]} in a, {value[1]} in b"
        table.add_row(name.replace("_", " "), str(shown))
    Console().print(table)


commands = [store]
