"""A host that is killed, in every verb that runs on: nothing of it is left, and the next honest program is served and told."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import pandas as pd
import pytest

import bubbleskin as bs

RUN = [sys.executable, "-m", "bubbleskin"]
LEAVES_A_SHAPE = {
    "show": ["show", "--all", "8", "--hold", "1e6"],
    "show, on its way": ["show", "--all", "9.5", "--over", "60"],
    "play": ["play", "pulse", "--loops", "0"],  # its bubbles touch: where they end is reckoned before it begins
    "demo": ["demo", "--output", "demo.png"],
}
LEAVES_NOTHING = {
    "monitor": ["monitor"],
    "monitor json": ["monitor", "--json"],
    "monitor record": ["monitor", "--record", "states.csv"],
}

pytestmark = pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="what a process holds is told by Linux")


@pytest.fixture(scope="module")
def board():
    """A board served by a process of its own: its URL, and the process."""
    command = [*RUN, "sim", "--port", "0", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        try:
            yield json.loads(server.stdout.readline())["device"], server
        finally:
            server.terminate()


@contextmanager
def host(arguments, folder, until=" is open"):
    """A verb that runs on, once it has a connection."""
    environment = os.environ | {"BUBBLESKIN_LOG": "debug", "TMPDIR": str(folder)}
    process = subprocess.Popen(
        [*RUN, *arguments], cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    there = threading.Event()

    def listen():
        for line in process.stderr:
            if until in line:
                there.set()

    listener = threading.Thread(target=listen)
    listener.start()
    try:
        assert there.wait(60)
        yield process
    finally:
        process.kill()
        process.wait()
        listener.join()
        process.stderr.close()


def descriptors(process):
    return sorted(str(link.readlink()).split(":")[0] for link in Path(f"/proc/{process.pid}/fd").iterdir())


def children(pid):
    found = []
    for task in Path(f"/proc/{pid}/task").iterdir():
        for child in map(int, (task / "children").read_text().split()):
            found += [child, *children(child)]
    return found


def alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def soon(condition, seconds=5.0):
    until = time.monotonic() + seconds
    while not condition() and time.monotonic() < until:
        time.sleep(0.02)
    return condition()


@pytest.mark.slow
@pytest.mark.timeout(120)
@pytest.mark.parametrize("verb", [*LEAVES_A_SHAPE, *LEAVES_NOTHING])
def test_the_next_program_is_served_and_told(board, tmp_path, caplog, verb):
    url, server = board
    with bs.connect(url) as skin:
        skin.vent()
    assert soon(lambda: "socket" in descriptors(server))
    before = descriptors(server)
    arguments = (LEAVES_A_SHAPE | LEAVES_NOTHING)[verb]
    with host([*arguments, "--device", url], tmp_path) as process:
        time.sleep(6.0 if verb == "play" else 1.0)
        assert process.poll() is None
        helpers = children(process.pid)
        process.send_signal(signal.SIGKILL)
        process.wait()
        caplog.clear()
        with bs.connect(url) as skin:  # at once: within the second after which it would vent
            told = [record.getMessage() for record in caplog.records if "A shape stands on" in record.getMessage()]
            assert len(told) == (verb in LEAVES_A_SHAPE)
            assert verb in LEAVES_A_SHAPE or skin.state().mode == "idle"
            skin.show([7.0] * 7, over=0.1)
            skin.vent()
    assert soon(lambda: not any(map(alive, helpers)))
    assert soon(lambda: descriptors(server) == before), (before, descriptors(server))
    left = {path.name for path in tmp_path.iterdir()}
    if verb == "monitor record":
        assert left == {"states.csv"}
        text = (tmp_path / "states.csv").read_text()
        rows = pd.read_csv(tmp_path / "states.csv", comment="#")
        assert len(rows) >= 5
        assert text.endswith("\n"), "whole rows"
    else:
        assert left == set()


@pytest.mark.slow
@pytest.mark.timeout(120)
@pytest.mark.parametrize("verb", ["show", "monitor"])
def test_its_micropython_goes_with_it(tmp_path, verb):
    arguments = (LEAVES_A_SHAPE | LEAVES_NOTHING)[verb]
    with host([*arguments, "--device", "micropython://wristband7?contact=0"], tmp_path) as process:
        helpers = children(process.pid)
        assert len(helpers) == 1
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert soon(lambda: not any(map(alive, helpers)))
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.timeout(120)
@pytest.mark.parametrize("options", [["--port", "0"], []])
def test_a_killed_server_leaves_its_program_with_a_sentence(tmp_path, options):
    command = [*RUN, "sim", "--micropython", "--json", *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        url = json.loads(server.stdout.readline())["device"]
        helpers = children(server.pid)
        assert len(helpers) == 1
        with bs.connect(url, timeout=1.0) as skin:
            server.kill()
            server.wait()
            with pytest.raises(bs.LinkError, match=r"\.$"):
                list(skin.telemetry(50))
        assert soon(lambda: not any(map(alive, helpers)))
