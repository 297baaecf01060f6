"""A sweep on one process, on two, and on two workers of a local Dask cluster: seconds, and whether rows are the same. And killed.

python tools/report/sweeps.py [--sheets 200]      # some two minutes on two cores that do nothing else

*CPU*: seconds of all processors together, workers and what starts them: twice as fast is only what needs no more of it. The sweep
that is killed is `bubbleskin sweep` on two processes, ended by SIGKILL after a quarter of its rows, and asked for again.
"""

import argparse
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import bubbleskin as bs
from bubbleskin.sweeps.workers import processes

STUDY = 'name = "sheets"\ntask = "reach"\nseeds = {sheets}\n[plant]\nspread = 0.1\nrubber = "real"\n[options]\nhold_s = 5.0\n'
GOAL = 1.8
"""Times as fast as one process, on two."""
WAIT_S = 3600.0


@contextmanager
def dask() -> Iterator[Executor]:
    """A scheduler and two workers on this computer, without a dashboard, and as docs/sweeps.md says to start workers."""
    os.environ |= {
        "DASK_DISTRIBUTED__ADMIN__TICK__INTERVAL": "1s",
        "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False",
    }
    from distributed import Client, LocalCluster  # which reads them now

    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, protocol="tcp") as cluster,
        Client(cluster) as client,
    ):
        yield client.get_executor()


def cpu_s() -> float:
    """Processor seconds of this process and of all that it has waited for."""
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def timed(study: Path, start: Callable[[], Any]) -> tuple[list[dict[str, Any]], float, float]:
    """Rows, seconds of the sweep, and processor seconds with what starts and ends its workers.

    A cluster's workers are there before it begins, and have not imported anything of ours; processes start with it.
    """
    spent = cpu_s()
    with start() as executor:
        begun = time.perf_counter()
        rows = bs.sweep(study, executor)
        seconds = time.perf_counter() - begun
    return rows, seconds, cpu_s() - spent


def killed_and_resumed(study: Path, sheets: int) -> tuple[int, int, list[dict[str, Any]]]:
    """How many rows were kept when it was killed, how many of them were lost or told otherwise, and all rows in the end."""
    out = study.with_name("rows.csv")
    partial = out.with_suffix(".partial.jsonl")
    command = [sys.executable, "-m", "bubbleskin", "sweep", str(study), "-o", str(out), "--workers", "2", "--json"]
    first = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    until = time.monotonic() + WAIT_S
    while not partial.exists() or len(partial.read_text("utf-8").splitlines()) <= sheets // 4:
        if first.poll() is not None or time.monotonic() > until:
            sys.exit("The sweep that was to be killed has ended before, or does not get on.")
        time.sleep(0.02)
    os.killpg(first.pid, signal.SIGKILL)
    first.wait()
    lines = partial.read_text("utf-8").splitlines(keepends=True)[1:]
    kept = [json.loads(line) for line in lines if line.endswith("\n")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    rows = json.loads(done.stdout)["rows"]
    return len(kept), sum(row not in rows for row in kept), rows


def main() -> None:
    """Run them all, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sheets", type=int, default=200)
    sheets = parser.parse_args().sheets
    ways: dict[str, Callable[[], Any]] = {
        "one process": lambda: processes(1),
        "two processes": lambda: processes(2),
        "Dask, two workers": dask,
    }
    print(
        f"{sheets} sheets, {os.cpu_count()} cores\n\n| on | seconds | times one process | CPU, s | rows |\n|---|---|---|---|---|"
    )
    expected, alone, good = [], 0.0, True
    with tempfile.TemporaryDirectory() as folder:
        study = Path(folder) / "study.toml"
        study.write_text(STUDY.format(sheets=sheets), encoding="utf-8")
        for name, start in ways.items():
            rows, seconds, spent = timed(study, start)
            expected, alone = expected or rows, alone or seconds
            said = "the same" if rows == expected else "NOT the same"
            print(f"| {name} | {seconds:.1f} | {alone / seconds:.2f} | {spent:.1f} | {said} |", flush=True)
            good = good and rows == expected and (rows is expected or alone / seconds >= GOAL)
        kept, lost, rows = killed_and_resumed(study, sheets)
    good = good and rows == expected and not lost
    end = "the same" if rows == expected else "NOT the same"
    print(f"\nKilled with {kept} rows of {sheets}: {lost} of them lost, and {end} rows in the end.")
    print(f"{'All' if good else 'Not all'} of it holds: the same rows, {GOAL} times one process, none lost.")
    sys.exit(not good)


if __name__ == "__main__":
    main()
