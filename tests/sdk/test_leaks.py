"""Connecting and closing, over and over, and many states: no descriptor, thread, process or file is left, and no memory."""

import gc
import resource
import threading
from pathlib import Path

import pytest

import bubbleskin as bs

PAGE = resource.getpagesize()


def held():
    """Descriptors, threads and child processes of this process."""
    gc.collect()
    children = Path(f"/proc/self/task/{threading.get_native_id()}/children").read_text().split()
    return len(list(Path("/proc/self/fd").iterdir())), threading.active_count(), len(children)


def memory():
    """Bytes that this process occupies."""
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE


def cycles(url, count):
    for _ in range(count):
        with bs.connect(url) as skin:
            skin.show([8.0] * 7, wait=False)


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
    cycles(url, count // 2)  # until the heap is as large as it becomes between two collections
    before, occupied = held(), memory()
    cycles(url, count)
    assert held() == before
    assert memory() - occupied < 2e6


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_hundred_thousand_states_leave_nothing():
    with bs.connect("sim://wristband7?contact=0") as skin:
        for _ in range(2_000):
            skin.state()
        before, occupied = held(), memory()
        for _ in range(100_000):
            skin.state()
        assert held() == before
        assert memory() - occupied < 2e6
