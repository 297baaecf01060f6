"""The command itself: its verbs, and how errors become one line and an exit status."""

import contextlib
import logging
import os
import sys
from collections.abc import Iterator
from typing import Any

import click

from bubbleskin.cli import (
    bench,
    bring_up,
    calibrate,
    demonstrations,
    device,
    doctor,
    firmware,
    fit_contact,
    flash,
    hil,
    inject,
    membrane,
    monitor,
    plan,
    play,
    plot,
    replay,
    sim,
    store,
    studio,
    sweep,
)
from bubbleskin.errors import BubbleskinError, InvalidInput

LOG = "BUBBLESKIN_LOG"
"""Environment variable: how much the link tells on standard error."""
LOG_LEVELS = ("debug", "info", "warning", "error")


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="bubbleskin")
def bubbleskin() -> None:
    """Heights in, shapes out: wristbands of inflatable bubbles, real and simulated."""


for _command in (
    *demonstrations.commands,
    *device.commands,
    *doctor.commands,
    *play.commands,
    *plan.commands,
    *monitor.commands,
    *replay.commands,
    *store.commands,
    *sim.commands,
    *studio.commands,
    *membrane.commands,
    *fit_contact.commands,
    *calibrate.commands,
    *bring_up.commands,
    *inject.commands,
    *plot.commands,
    *bench.commands,
    *firmware.commands,
    *flash.commands,
    *hil.commands,
    *sweep.commands,
):
    bubbleskin.add_command(_command)


def main(arguments: list[str] | None = None) -> Any:
    """Run the command. A user's mistake is one line and exit status 2, a device's failure 1, no tracebacks.

    Ctrl-C ends with status 130, once the verb has left its device as it promises.
    """
    try:
        with _logging():
            status = bubbleskin.main(arguments, prog_name="bubbleskin", standalone_mode=False)
        sys.stdout.flush()  # here, where somebody still says what went wrong
        sys.exit(status if isinstance(status, int) else 0)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        sys.exit(2)
    except click.ClickException as error:
        _end(f"{error.format_message()} See `{_path(error)} --help`.", 2)
    except click.Abort as error:
        if isinstance(error.__cause__, EOFError):  # click takes a library's for the end of the user's input
            _end("A file or an input has ended too early.", 2)
        _end("Stopped.", 130)
    except KeyboardInterrupt:
        _end("Stopped.", 130)
    except InvalidInput as error:
        _end(str(error), 2)
    except BubbleskinError as error:
        _end(str(error), 1)
    except BrokenPipeError:  # whoever read our output has gone
        _drop_output()
        sys.exit(1)
    except OSError as error:
        _drop_output()
        _end(f"The output cannot be written: {error.strerror or error}. What was written before is whole.", 1)


def _drop_output() -> None:
    """Let what is still to be written to standard output go nowhere: Python would try again at its end, and complain."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


@contextlib.contextmanager
def _logging() -> Iterator[None]:
    """Write what the link does to standard error, as much of it as `BUBBLESKIN_LOG` asks for."""
    level = os.environ.get(LOG, "").lower()
    if level and level not in LOG_LEVELS:
        raise InvalidInput(f"{LOG} is {os.environ[LOG]!r}; give one of {', '.join(LOG_LEVELS)}, or leave it unset.")
    if not level:
        yield
        return
    logger = logging.getLogger("bubbleskin")
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    logger.addHandler(handler)
    logger.setLevel(level.upper())
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(logging.NOTSET)


def _end(sentence: str, status: int) -> None:
    exec("")  # an interrupted `exec` of any library would make Python end by SIGINT after all; the next one undoes it
    click.echo(" ".join(sentence.split()), err=True)
    sys.exit(status)


def _path(error: click.ClickException) -> str:
    context = getattr(error, "ctx", None)
    return context.command_path if context else "bubbleskin"
