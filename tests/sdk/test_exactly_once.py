"""The SDK's link against the firmware's session, joined in memory by a line that fails: exactly once, or told."""

import contextlib
import importlib.util
import sys
from pathlib import Path

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

import bubbleskin as bs
from bubble_firmware.link.server import Server
from bubble_protocol.schema import messages
from bubbleskin.link.link import Link, run_sync
from bubbleskin.link.send_window import Request
from bubbleskin.sim import Impairment, LossyTransport

TOOLS = Path(__file__).parents[2] / "tools/stress"


def tool(name):
    """A program of `tools/` as a module."""
    spec = importlib.util.spec_from_file_location(name, TOOLS / f"{name}.py")
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


soak = tool("soak")


@pytest.mark.promise("exactly-once")
@pytest.mark.medium
@pytest.mark.parametrize("commands", [2_000, pytest.param(10_000, marks=pytest.mark.slow)])
def test_thousands_of_commands_over_a_line_that_fails(commands):
    result = soak.soak(commands, seed=3)
    assert result.problems == []
    assert len(result.journals) > commands // 3000
    assert result.told.count(soak.APPLIED) > 0.9 * commands
    assert min(count for kind, count in result.impairments.items() if kind != "stall") > commands // 1000


def test_a_device_that_forgets_replies_would_be_found_out(monkeypatch):
    """The check can fail: without the replies kept, what comes twice is applied twice."""

    take = Server.take

    def forgetful(self, message_id, number):
        if message_id != messages.HELLO:
            self.window.expected = number
        take(self, message_id, number)

    monkeypatch.setattr(Server, "take", forgetful)
    assert any("twice" in problem for problem in soak.soak(300, seed=3).problems)


class ExactlyOnce(RuleBasedStateMachine):
    """Requests are made, time passes, the line fails and the board restarts, in any order.

    The model: every SHOW has a number of its own; the firmware's journal of each boot holds none of them twice and
    all in order; one that was answered is there, one that was told not to have been applied is not.
    """

    @initialize(seed=st.integers(0, 1000))
    def begin(self, seed):
        self.device = soak.Device()
        impairment = Impairment(drop=0.2, duplicate=0.1, flip=0.05, reorder=0.1, truncate=0.05, split=0.1)
        self.line = LossyTransport(self.device, impairment, seed=seed)
        self.line.on = False
        self.link = Link(self.line, 1.0)
        run_sync(self.link.hello())
        self.requests = []

    @rule(count=st.integers(1, 12))
    def show(self, count):
        """Requests are made, and nobody waits for them yet."""
        for _ in range(count):
            number = len(self.requests)
            heights = [(number // soak.BASE,), (number % soak.BASE,), *[(6000,)] * 5]
            request = Request("SHOW", (0,), heights, self.device.now() + 1.0, 1.0)
            self.link.window.submit(request)
            self.requests.append(request)

    @rule(name=st.sampled_from(["STOP", "VENT"]))
    def urgent(self, name):
        self.link.window.submit(Request(name, (), (), self.device.now() + 1.0, 1.0))

    @rule()
    def call(self):
        with contextlib.suppress(bs.LinkError, bs.Overtaken):
            run_sync(self.link.call("STATE"))

    @rule(seconds=st.sampled_from([0.005, 0.02, 0.1, 0.5, 1.5]))
    def wait(self, seconds):
        run_sync(self.link.wait(self.device.now() + seconds))

    @rule(on=st.booleans())
    def fail(self, on):
        self.line.on = on

    @rule()
    def restart(self):
        self.device.reset()

    @rule()
    def another_session(self):
        try:
            run_sync(self.link.hello())
        except bs.WrongDevice:
            assert self.line.on, "nothing but the line can be in the way"

    @invariant()
    def exactly_once(self):
        if not hasattr(self, "device"):
            return
        journals = [list(journal) for journal in self.device.journals]
        for journal in journals:
            assert journal == sorted(set(journal))
        applied = [number for journal in journals for number in journal]
        assert len(set(applied)) == len(applied)
        for number, request in enumerate(self.requests):
            if request.reply and request.reply.id != messages.ERROR:
                assert number in applied
            elif request.done and not getattr(request.error, "outcome_unknown", False):
                assert number not in applied

    def teardown(self):
        """In the end the line is good, and everything is decided."""
        if not hasattr(self, "device"):
            return
        self.line.on = False
        for _ in range(3):
            self.call()
        run_sync(self.link.wait(self.device.now() + 2.0))
        assert all(request.done for request in self.requests if request.sends)
        run_sync(self.link.call("STATE"))
        self.exactly_once()


TestExactlyOnce = pytest.mark.medium(ExactlyOnce.TestCase)
TestExactlyOnce.settings = settings(max_examples=8, stateful_step_count=25, deadline=None)


@pytest.mark.slow
class TestExactlyOnceAtLength(ExactlyOnce.TestCase):
    settings = settings(max_examples=40, stateful_step_count=40, deadline=None)
