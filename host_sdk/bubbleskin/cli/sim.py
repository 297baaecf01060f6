"""`bubbleskin sim`: serve a simulated wristband to other programs."""

from pathlib import Path
from typing import NamedTuple

import click
from rich.console import Console

from bubbleskin import boards
from bubbleskin.cli.options import SEED, Board, Real, Whole, as_json, gathered


class _Plant(NamedTuple):
    """What the plant is to be."""

    seed: int
    spread: float
    rubber: str | None
    plant: str | None


@click.command()
@click.argument("board", type=Board(), default=boards.DEFAULT)
@click.option(
    "--port",
    type=Whole(0, 65535),
    help="Serve on this TCP port of this machine (0: a free one) instead of a pseudo-terminal.",
)
@click.option("--seed", type=SEED, default=0, show_default=True, help="Seed of sensor noise and spread.")
@click.option("--spread", type=Real(), default=0.0, show_default=True, help="How much parts differ: 0.1 for ± 10 %.")
@click.option("--rubber", type=click.Choice(["ideal", "real"]), help="What the bubbles are made of.  [default: ideal]")
@click.option("--plant", type=click.Path(), help="The plant, from a file that `skin.simulated.write_plant` wrote.")
@click.option("--micropython", is_flag=True, help="Run the firmware in a real MicroPython.")
@click.option(
    "--record",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Record all that reaches the firmware to a .jsonl file, for `bubbleskin replay`.",
)
@as_json
@gathered(plant=_Plant)
def sim(board: str, port: int | None, plant: _Plant, micropython: bool, record: Path | None, json: bool) -> None:
    """Serve a simulated BOARD, by its name or the path of its file, in real time, until Ctrl-C.

    Any program can open it with pyserial: at the pseudo-terminal or the socket:// URL that is printed. One has it at a
    time; on a TCP port another one is told so, and gets it once the first has gone or said nothing for a second.
    """
    from bubbleskin.sim import open_board
    from bubbleskin.sim.serve import PtyEnd, TcpEnd, serve

    scheme = "micropython" if micropython else "sim"
    options = {name: str(value) for name, value in plant._asdict().items() if value is not None}
    transport, simulated = open_board(scheme, board, options)
    recording = None
    try:
        recording = simulated.record(record) if record else None
        end = PtyEnd() if port is None else TcpEnd(port)
        try:
            if json:
                click.echo(f'{{"device": "{end.name}", "board": "{board}"}}')
            else:
                Console().print(f"{board} is served at [bold]{end.name}[/bold]. Ctrl-C ends it.", highlight=False)
            for _ in serve(simulated, end):
                pass
        finally:
            end.close()
    finally:
        if recording:
            recording.close()
        transport.close()


commands = [sim]
