"""`bubbleskin sweep`: a study's task on many simulated wristbands."""

import json as jsonlib
import logging
import sys
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path

import click
from rich.console import Console
from rich.table import Table

from bubbleskin.cli.options import Whole, as_json, progress_of_parts
from bubbleskin.errors import BubbleskinError, InvalidInput

_FILE = click.Path(dir_okay=False, path_type=Path)
_WORKERS_MAX = 1024


@click.command()
@click.argument("study", type=_FILE)
@click.option(
    "-o",
    "--output",
    type=_FILE,
    help="Write all rows to a .csv or .parquet file; a sweep that was stopped goes on there.",
)
@click.option("--picture", type=_FILE, help="Draw what came out: png, svg or pdf.")
@click.option("--workers", type=Whole(1, _WORKERS_MAX), help="Processes.  [default: one for each core]")
@click.option("--scheduler", metavar="ADDRESS", help="Run on the workers of a Dask cluster, such as tcp://host:8786.")
@as_json
def sweep(
    study: Path, output: Path | None, picture: Path | None, workers: int | None, scheduler: str | None, json: bool
) -> int:
    """Run the task of STUDY, a .toml file, on each of its simulated wristbands. Status 1 where it failed on one.

    Rows are kept as they come, beside the output: Ctrl-C, and the same command goes on from there.
    """
    from bubbleskin.sweeps.run import describe
    from bubbleskin.sweeps.run import sweep as run
    from bubbleskin.sweeps.study import Study

    if workers and scheduler:
        raise InvalidInput("--workers are processes of this computer, --scheduler has its own; give one of them.")
    if "" not in sys.path:
        sys.path.insert(0, "")  # a task of the folder that one is in; a script that is installed has only its own
    asked = Study.load(study)
    with _executor(workers, scheduler) as executor, progress_of_parts(Console(stderr=True)) as bar:
        task = bar.add_task(asked.name, total=None)
        rows = run(
            asked, executor, out=output, progress=lambda done, all_: bar.update(task, completed=done, total=all_)
        )
    failed = [row for row in rows if row["error"]]
    if json:
        click.echo(jsonlib.dumps({"name": asked.name, "rows": rows, "figures": describe(rows)}, indent=2))
    else:
        table = Table(
            "figure", "mean", "median", "most", title=f"{asked.name}: {len(rows)} wristband{'s' * (len(rows) != 1)}"
        )
        for name, figures in describe(rows).items():
            table.add_row(name, *(f"{figures[kind]:.4g}" for kind in ("mean", "median", "most")))
        if table.rows:
            Console().print(table)
        for row in failed[:3]:
            click.echo(f"Point {row['point']}: {row['error']}", err=True)
        if failed:
            click.echo(f"The task failed on {len(failed)} of {len(rows)} wristbands.", err=True)
    if picture:
        from bubbleskin.plot.save import save
        from bubbleskin.plot.sweep import draw

        save(draw(rows, asked.name), picture)
    for path in (output, picture):
        if path:
            click.echo(f"wrote {path}", err=True)
    return 1 if failed else 0


@contextmanager
def _executor(workers: int | None, scheduler: str | None) -> Iterator[Executor | None]:
    """What runs it; None is left to the sweep."""
    if scheduler:
        with _dask(scheduler) as executor:
            yield executor
    elif workers:
        from bubbleskin.sweeps.workers import processes

        with processes(workers) as executor:
            yield executor
    else:
        yield None


@contextmanager
def _dask(address: str) -> Iterator[Executor]:
    try:
        from distributed import Client
    except ImportError:
        raise InvalidInput("--scheduler needs Dask: pip install 'bubbleskin[dask]'.") from None
    try:
        client = Client(address, timeout="10s")
    except (OSError, ValueError) as error:
        raise BubbleskinError(
            f"No Dask scheduler answers at {address}: {error}. Start one with `dask scheduler`."
        ) from None
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(
            logging.CRITICAL
        )  # that its scheduler has gone it says with tracebacks, after we have
    with client:
        yield client.get_executor()


commands = [sweep]
