"""A skin and the process that opened it: forks, other threads of a fork, skins that nobody closed."""

import gc
import pickle
import subprocess
import sys
import time

import pytest

import bubbleskin as bs

FORKED = """
import os, sys, threading, warnings
warnings.simplefilter("ignore")  # of forks beside threads
import bubbleskin as bs

skin = bs.connect(sys.argv[1])
skin.show([8.0] * 7, wait=False)
other = bs.connect("sim://wristband7?contact=0")
calls = {
    "show": lambda: skin.show([10.0] * 7, wait=False),
    "state": skin.state,
    "stop": skin.stop,
    "vent": skin.vent,
    "sleep": lambda: skin.sleep(0.01),
    "play": lambda: skin.play(bs.sequences.pulse(skin.layout)),
    "record": lambda: skin.record(os.devnull + ".csv"),
    "telemetry": lambda: next(skin.telemetry()),
    "simulated": other.state,
}
child = os.fork()
if not child:
    for name, call in calls.items():
        try:
            call()
            print("child", name, "was let through", flush=True)
        except bs.LinkError as problem:
            assert str(os.getpid()) in str(problem) and "Nothing was sent" in str(problem), problem
            print("child", name, "refused", flush=True)
    skin.close()
    sys.exit(0)  # with all finalizers: they must not end the parent's connection
assert os.waitpid(child, 0)[1] == 0
for height in (6.0, 7.0):
    skin.show([height] * 7, wait=False)
    print("parent", skin.state().target_mm.tolist())
skin.vent()
print("parent", skin.state().mode)
skin.close()
"""


@pytest.mark.medium
@pytest.mark.timeout(120)
def test_a_fork_sends_nothing_and_its_parent_goes_on(served):
    done = subprocess.run([sys.executable, "-c", FORKED, served.name], capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    child = [line for line in lines if line.startswith("child")]
    assert len(child) == 9
    assert all(line.endswith("refused") for line in child), child
    assert lines[9:] == [f"parent {[6.0] * 7}", f"parent {[7.0] * 7}", "parent venting"]


HELD = """
import os, sys, threading, time, warnings
warnings.simplefilter("ignore")
import bubbleskin as bs

skin = bs.connect(sys.argv[1])
threading.Thread(target=lambda: skin.sleep(1.0), daemon=True).start()  # it holds the lock while this forks
time.sleep(0.2)
child = os.fork()
if not child:
    try:
        skin.state()
    except bs.LinkError:
        os._exit(3)
    os._exit(4)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), skin.state().mode)
skin.close()
"""


@pytest.mark.medium
@pytest.mark.timeout(60)
def test_a_lock_that_another_thread_held_does_not_hang_the_fork(served_port, port):
    done = subprocess.run([sys.executable, "-c", HELD, port.name], capture_output=True, text=True, timeout=50)
    assert done.stdout.split()[:1] == ["3"], done.stderr


def test_a_skin_cannot_be_sent_to_another_process():
    with (
        bs.connect("sim://wristband7?contact=0") as skin,
        pytest.raises(bs.InvalidInput, match="connect in that process"),
    ):
        pickle.dumps(skin)


@pytest.mark.medium
def test_a_skin_that_nobody_closed_says_so(served_port, port):
    skin = bs.connect(port.name)
    assert skin.state()
    del skin
    with pytest.warns(ResourceWarning, match="was not closed"):
        let_go()


def let_go():
    """Collect, and give the thread that keeps links alive the time to let go of one that it just holds."""
    gc.collect()
    time.sleep(0.3)


@pytest.mark.medium
def test_a_closed_skin_says_nothing(served_port, port, recwarn):
    with bs.connect(port.name):
        pass
    let_go()
    assert not [warning for warning in recwarn if warning.category is ResourceWarning]


@pytest.mark.medium
def test_a_port_that_a_fork_has_inherited_is_free_once_the_first_process_has_closed_it(served_port, port):
    script = """
import os, sys, time, warnings
warnings.simplefilter("ignore")
import bubbleskin as bs
skin = bs.connect(sys.argv[1])
there, here = os.pipe()
child = os.fork()
if not child:
    os.write(here, b"!")  # it has let go of its copy: a fork does so before anything else
    time.sleep(5)
    os._exit(0)
os.read(there, 1)
skin.close()
with bs.connect(sys.argv[1]) as again:
    print(again.state().mode)
os.kill(child, 9)
os.waitpid(child, 0)
"""
    done = subprocess.run([sys.executable, "-c", script, port.name], capture_output=True, text=True, timeout=50)
    assert done.returncode == 0, done.stderr
