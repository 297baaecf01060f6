"""Connecting and closing, over and over, and many states: no descriptor, thread, process or file is left, and no memory."""

import gc
import threading
import tracemalloc
from pathlib import Path

import pytest

import bubbleskin as bs


def held():
    """Descriptors, threads and child processes of this process."""
    gc.collect()
    children = Path(f"/proc/self/task/{threading.get_native_id()}/children").read_text().split()
    return len(list(Path("/proc/self/fd").iterdir())), threading.active_count(), len(children)


def memory():
    """Bytes of all objects. What the process occupies rises and falls by megabytes with when the collector runs."""
    gc.collect()
    return tracemalloc.get_traced_memory()[0]


@pytest.fixture(autouse=True)
def _traced():
    tracemalloc.start()
    yield
    tracemalloc.stop()


def cycles(url, count):
    for _ in range(count):
        with bs.connect(url) as skin:
            skin.show([8.0] * 7, wait=False)
            skin.vent()  # nothing for the next one to be told of: pytest keeps what is logged


TARGETS = {
    "sim": ("sim://wristband7?contact=0", 500),
    "port": ("", 500),
    "micropython": ("micropython://wristband7?contact=0", 100),
}


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("target", TARGETS)
def test_connecting_and_closing_leaves_nothing(request, target):
    url, count = TARGETS[target]
    if target == "port":
        request.getfixturevalue("served_port")
        url = request.getfixturevalue("port").name
    cycles(url, 20)
    before, occupied = held(), memory()
    cycles(url, count)
    assert held() == before
    assert memory() - occupied < 100e3


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_many_states_leave_nothing():
    with bs.connect("sim://wristband7?contact=0&history=0") as skin:  # what a history keeps grows up to its limit
        for _ in range(500):
            skin.state()
        before, occupied = held(), memory()
        for _ in range(20_000):
            skin.state()
        assert held() == before
        assert memory() - occupied < 100e3
