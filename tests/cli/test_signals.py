"""Ctrl-C of a terminal: it reaches the whole process group, helpers too."""

import os
import signal
import subprocess
import sys
import threading

import pytest

MICROPYTHON = ["--device", "micropython://wristband7"]
SIM = ["--device", "sim://wristband7?realtime=1"]

VERBS = {
    "monitor": ["monitor", *MICROPYTHON],
    "monitor json": ["monitor", "--json", *SIM],
    "show": ["show", "--all", "8", "--hold", "1e9", *MICROPYTHON],
    "play": ["play", "pulse", "--loops", "0", *MICROPYTHON],
    "play in real time": ["play", "pulse", "--loops", "0", *SIM],
    "demo": ["demo", "--output", os.devnull, "--device", "sim://wristband7?realtime=1"],
}


@pytest.mark.slow
@pytest.mark.timeout(120)
@pytest.mark.parametrize("verb", VERBS)
def test_ctrl_c_ends_with_130_and_no_traceback(verb, start):
    environment = os.environ | {"BUBBLESKIN_LOG": "debug"}
    running = start(*VERBS[verb], stdout=subprocess.DEVNULL, env=environment, start_new_session=True)
    said, open_ = [], threading.Event()

    def listen():
        for line in running.stderr:
            said.append(line)
            if " is open" in line:
                open_.set()

    listener = threading.Thread(target=listen)
    listener.start()
    try:
        assert open_.wait(60), said[-5:]
        open_.clear()
        threading.Event().wait(1.0)
        os.killpg(running.pid, signal.SIGINT)
        assert running.wait(20) == 130
    finally:
        running.kill()
        running.wait()
        listener.join()
        running.stderr.close()
    told = "".join(said)
    assert "Traceback" not in told
    assert said[-1] == "Stopped.\n"
    if verb.startswith("play"):
        assert told.rindex("sent STOP") < told.rindex("sent VENT"), "closed at once, then vented: its MicroPython lives"


FIRST_SECOND = (0.0, 0.05, 0.15, 0.4, 0.7, 1.0)
"""Seconds after which Ctrl-C is pressed: while Python starts, while the command is imported, while its verb imports more."""


@pytest.mark.slow
@pytest.mark.timeout(120)
@pytest.mark.parametrize("verb", ["info", "plan", "plot", "demo"])
@pytest.mark.parametrize("seconds", FIRST_SECOND)
def test_ctrl_c_within_the_first_second(verb, seconds, tmp_path, start):
    arguments = {
        "info": ["info", *SIM],
        "plan": ["plan", "--shape", "dome"],
        "plot": ["plot", "curve"],
        "demo": ["demo", *SIM],
    }
    running = start(*arguments[verb], stdout=subprocess.DEVNULL, cwd=tmp_path)
    threading.Event().wait(seconds)
    running.send_signal(signal.SIGINT)
    said = running.communicate(timeout=60)[1]
    # Where no line of ours stands in it, Python itself was interrupted on its way to us, and nobody can mend that.
    if running.returncode == -signal.SIGINT or ("Traceback" in said and "bubbleskin" not in said):
        assert "ignored" not in said
        return
    assert "Traceback" not in said
    if running.returncode == 0:
        assert seconds >= 0.4, "all was done before"
        return
    assert running.returncode == 130
    assert said.split("\n")[-2:] == ["Stopped.", ""]
    assert said.count("Stopped.") == 1


def test_nothing_that_takes_long_is_imported_before_ctrl_c_is_understood():
    code = "import sys; before = set(sys.modules); import bubbleskin.cli; print(*set(sys.modules) - before)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) - {"types"} == {"bubbleskin", "bubbleskin.cli", "bubbleskin.cli.entry"}
