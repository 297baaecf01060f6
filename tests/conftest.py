"""What all tests share: the real MicroPython, and how hypothesis looks for counterexamples."""

import os
import signal
import subprocess
import sys
from textwrap import dedent

import pytest
from hypothesis import settings

from bubbleskin.errors import BubbleskinError
from bubbleskin.sim.micropython import HEAP, source_path
from bubbleskin.toolchain.interpreter import find_micropython

NEEDS_MORE_THAN_CI_HAS = ("a full disk is simulated by Linux",)
"""Reasons for which a test may be skipped where everything it needs should be there; any other is a failure in CI."""


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport():
    """No test is skipped in CI without anybody seeing it."""
    return _judged((yield))


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report():
    """Nor is a whole module."""
    return _judged((yield))


def _judged(report):
    if os.environ.get("CI") and report.skipped and not hasattr(report, "wasxfail"):
        reason = str(report.longrepr[2] if isinstance(report.longrepr, tuple) else report.longrepr)
        if not any(allowed in reason for allowed in NEEDS_MORE_THAN_CI_HAS):
            report.outcome = "failed"
            report.longrepr = f"In CI nothing may be skipped, but: {reason}"
    return report


# The same examples on every run, and no deadline: a busy machine is not a failure. `make check` takes the first of them.
settings.register_profile(
    "house", deadline=None, derandomize=True, max_examples=int(os.environ.get("BUBBLESKIN_EXAMPLES", "100"))
)
settings.load_profile("house")


@pytest.fixture
def command(capsys, monkeypatch):
    """Run `bubbleskin` in this process; returns exit status, standard output and standard error."""
    monkeypatch.delenv("BUBBLESKIN_DEVICE", raising=False)
    monkeypatch.setenv("COLUMNS", "160")

    def run(*arguments):
        from bubbleskin.cli.command import main

        with pytest.raises(SystemExit) as end:
            main(list(map(str, arguments)))
        out, err = capsys.readouterr()
        return end.value.code, out, err

    return run


@pytest.fixture(scope="session")
def start():
    """`start(verb, …)`: `bubbleskin` as a process that Ctrl-C ends; a shell's background job would have it ignored."""

    def run(*arguments, stdout=subprocess.PIPE, **options):
        return subprocess.Popen(
            [sys.executable, "-m", "bubbleskin", *map(str, arguments)],
            stdout=stdout,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
            **options,
        )

    return run


@pytest.fixture(scope="session")
def micropython(tmp_path_factory):
    """`run(script, stdin="", timeout=60)`: what a script prints in the real MicroPython, with the board's heap.

    The script finds `bubble_protocol` and `bubble_firmware`. Where it fails, the test fails with what it said.
    """
    try:
        interpreter = find_micropython()
    except BubbleskinError as problem:
        if os.environ.get("CI"):
            pytest.fail(str(problem))
        pytest.skip(str(problem))
    folder = tmp_path_factory.mktemp("micropython")

    def run(script: str, stdin: str = "", timeout: float = 60.0) -> str:
        path = folder / "script.py"
        # All on the first line, so that line numbers in a traceback are the script's plus one.
        path.write_text(
            f"import gc, sys; gc.threshold(16384); sys.path[:] = {source_path()!r}\n{dedent(script).lstrip()}",
            encoding="utf-8",
        )
        done = subprocess.run(
            [interpreter, "-X", f"heapsize={HEAP}", path],
            input=stdin,
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
        )
        if done.returncode:
            pytest.fail(f"MicroPython ended with status {done.returncode}:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
        return done.stdout

    return run


@pytest.fixture
def record_property(record_property):
    """pytest's own, for numbers of numpy too: reports go from process to process in words that know none."""
    return lambda name, value: record_property(name, float(value))
