"""The commands of a build: a status line and a log for each, and a lock so that two builds do not meet."""

import fcntl
import os
import re
import subprocess
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from bubbleskin.errors import BubbleskinError

RELEASED = "1744675200"
"""`SOURCE_DATE_EPOCH` of every build: the day MicroPython 1.25.0 came out, so that two builds are the same."""

# These must not reach into the build: a `make` around us hands its own flags down, a shell compiler flags.
CLEARED = [
    "MAKEFLAGS",
    "MFLAGS",
    "MAKELEVEL",
    "CFLAGS",
    "CPPFLAGS",
    "LDFLAGS",
    "CROSS_COMPILE",
    "BUILD",
    "VARIANT",
]


def environment(**settings: str) -> dict[str, str]:
    """The environment of a build: this one's, without what would change the outcome, and `settings`."""
    fixed = {"SOURCE_DATE_EPOCH": RELEASED, "PYTHONDONTWRITEBYTECODE": "1", "LC_ALL": "C.UTF-8", "TZ": "UTC"}
    return {name: value for name, value in os.environ.items() if name not in CLEARED} | fixed | settings


class CommandRunner:
    """Runs the commands of a build, each with a status line and a log of its own in the folder `logs`."""

    def __init__(self, logs: Path) -> None:
        from rich.console import Console  # only a build needs it, and it is most of a cached call's time

        self.console = Console(stderr=True)
        self.logs = logs
        logs.mkdir(parents=True, exist_ok=True)

    def try_run(
        self,
        title: str,
        command: Sequence[str | Path],
        *,
        folder: Path | None = None,
        env: dict[str, str] | None = None,
    ) -> Path | None:
        """Run `command`; the path of its log if it failed, else None."""
        log = self.logs / (re.sub(r"\W+", "-", title.lower()) + ".log")
        started = time.monotonic()
        with self.console.status(f"{title} …"), log.open("wb") as out:
            status = subprocess.run(
                command, cwd=folder, env=env, stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT
            ).returncode
        seconds = time.monotonic() - started
        self.console.print(f"{title}: {'failed' if status else 'done'}, {seconds:.1f} s", highlight=False)
        return log if status else None

    def run(self, title: str, command: Sequence[str | Path], *, env: dict[str, str] | None = None) -> None:
        """Run `command`; if it fails, raise `BubbleskinError` with the end of its log."""
        log = self.try_run(title, command, env=env)
        if log:
            raise BubbleskinError(f"the command “{title}” failed.\n{tail(log)}")


def tail(log: Path) -> str:
    """The last 20 lines of a log, and where the rest is."""
    lines = log.read_text(errors="replace").splitlines()[-20:]
    return "\n".join(f"    {line}" for line in lines) + f"\nThe whole log: {log}\n"


@contextmanager
def locked(path: Path, runner: CommandRunner) -> Iterator[None]:
    """Hold the lock file `path`; a second build waits for the first."""
    with path.open("w") as file:
        with runner.console.status("Waiting for another build of MicroPython …"):
            fcntl.flock(file, fcntl.LOCK_EX)
        yield
