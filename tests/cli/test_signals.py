"""Ctrl-C of a terminal: it reaches the whole process group, helpers too."""

import os
import signal
import subprocess
import sys
import threading

import pytest

RUN = [sys.executable, "-m", "bubbleskin"]
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
def test_ctrl_c_ends_with_130_and_no_traceback(verb):
    environment = os.environ | {"BUBBLESKIN_LOG": "debug"}
    running = subprocess.Popen(
        RUN + VERBS[verb],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a shell's background job ignores it
    )
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
