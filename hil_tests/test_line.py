"""A line that garbles, repeats and loses: each request is applied once, as it was asked, or not at all."""

import threading

import numpy as np
import pytest

import bubbleskin as bs

pytestmark = pytest.mark.timeout(60)


@pytest.fixture
def line(skin, monkeypatch):
    """The line to the wristband, which does to the bytes of the next write what a test wants."""
    return Line(skin, monkeypatch)


class Line:
    """`line.spoil = f`: the next write sends f(data) instead of data. `line.sent`: the last write, as it was meant."""

    def __init__(self, skin, monkeypatch):
        transport = skin.link.transport
        self.send = transport.write
        self.spoil = None
        self.sent = b""
        monkeypatch.setattr(transport, "write", self._write)

    def _write(self, data):
        self.sent, spoil = bytes(data), self.spoil
        self.spoil = None
        data = spoil(bytes(data)) if spoil else data
        if data:
            self.send(data)


def flipped(place):
    """`data` with one bit of the byte at `place` turned over, a share of its length; no byte becomes a frame's end."""

    def spoil(data):
        at = round(place * (len(data) - 3)) + 1
        spoiled = data[at] ^ 2
        return data[:at] + bytes([spoiled or 3]) + data[at + 1 :]

    return spoil


@pytest.mark.promise("exactly-once")
@pytest.mark.parametrize(
    "place", [0.3, pytest.param(0.5, marks=pytest.mark.long), pytest.param(0.8, marks=pytest.mark.long)]
)
def test_a_garbled_show_is_not_applied_but_sent_again(skin, line, place):
    n = skin.info.bubbles
    bad = skin.health().frames_bad
    line.spoil = flipped(place)
    skin.show(np.full(n, 6.5), wait=False)
    assert skin.state().target_mm == pytest.approx(6.5)
    assert skin.health().frames_bad == bad + 1


@pytest.mark.promise("exactly-once")
@pytest.mark.long
def test_a_show_that_is_lost_is_sent_again(skin, line):
    n = skin.info.bubbles
    line.spoil = lambda data: b""
    skin.show(np.full(n, 6.5), wait=False)
    assert skin.state().target_mm == pytest.approx(6.5)


@pytest.mark.promise("exactly-once")
def test_a_show_that_comes_again_later_is_not_applied_again(skin, line):
    n = skin.info.bubbles
    skin.show(np.full(n, 6.0), wait=False)
    old = line.sent
    skin.show(np.full(n, 7.5), wait=False)
    line.send(old)
    skin.sleep(0.1)
    assert skin.state().target_mm == pytest.approx(7.5)


@pytest.mark.promise("exactly-once")
@pytest.mark.long
def test_a_vent_that_comes_again_later_does_not_end_a_show(skin, line):
    n = skin.info.bubbles
    skin.vent()
    old = line.sent
    skin.show(np.full(n, 6.0), wait=False)
    line.send(old)
    skin.sleep(0.1)
    assert skin.state().mode == "active"


@pytest.mark.promise("no-frame")
@pytest.mark.long
def test_what_is_no_frame_is_left_out(skin, line):
    n = skin.info.bubbles
    noise = np.random.default_rng(1).integers(0, 256, 400, np.uint8).tobytes()
    line.spoil = lambda data: noise + b"\0" + data
    skin.show(np.full(n, 6.5), wait=False)
    assert skin.state().target_mm == pytest.approx(6.5)
    assert skin.state().mode == "active"


@pytest.mark.promise("no-frame")
@pytest.mark.long
@pytest.mark.parametrize("place", np.linspace(0.2, 0.8, 7).tolist())
def test_an_answer_that_is_garbled_is_not_believed(skin, monkeypatch, place):
    transport = skin.link.transport
    read, spoiled = transport.read, []

    def garbled(timeout):
        data = read(timeout)
        if len(data) > 40 and not spoiled:  # the state's answer, not a PING's
            at = round(place * (len(data) - 2))
            spoiled.append(data)
            return data[:at] + bytes([data[at] ^ 64 or 1]) + data[at + 1 :]
        return data

    before = skin.state()
    monkeypatch.setattr(transport, "read", garbled)
    state = skin.state()
    assert spoiled
    assert state.height_mm == pytest.approx(before.height_mm, abs=0.02)
    assert state.pressure_kpa == pytest.approx(before.pressure_kpa, abs=0.3)
    assert state.target_mm == pytest.approx(before.target_mm, abs=1e-6)
    assert (state.status, state.faults) == (before.status, before.faults)


@pytest.mark.promise("restart-told")
@pytest.mark.not_on("board", "a real wristband's power is not cut")
@pytest.mark.long
def test_a_restart_that_nobody_asked_for_is_told(skin):
    skin.show(np.full(skin.info.bubbles, 6.0))
    boot = skin.info.boot_id
    skin.simulated.reset()
    with pytest.raises(bs.DeviceRestarted):
        skin.show(np.full(skin.info.bubbles, 7.0))
    assert skin.info.boot_id != boot
    assert skin.state().mode in ("idle", "boot")


@pytest.mark.promise("sessions")
@pytest.mark.long
def test_requests_of_another_session_are_not_heard(target, skin, line):
    """A frame kept from before a new greeting belongs to nobody."""
    n = skin.info.bubbles
    skin.show(np.full(n, 6.0), wait=False)
    old = line.sent
    at_once(skin.link.hello())
    skin.vent()
    line.send(old)
    skin.sleep(0.1)
    assert skin.state().mode in ("venting", "idle")


def at_once(coroutine):
    """The result of a coroutine of a link without an event loop: it never waits for anyone."""
    try:
        coroutine.send(None)
    except StopIteration as end:
        return end.value
    raise AssertionError("it waits for an event loop")


def raw_show(skin, micrometres, over_ms=0):
    """SHOW as the host would never send it."""
    at_once(skin.link.call("SHOW", (over_ms,), [(height,) for height in micrometres]))


@pytest.mark.promise("height-refused", "refused-not-applied")
@pytest.mark.parametrize("bubble", [pytest.param(0, marks=pytest.mark.long), -1])
def test_the_wristband_refuses_what_is_too_high_for_one_bubble_whichever(skin, bubble):
    skin.show(np.full(skin.info.bubbles, 6.0))
    heights = np.full(skin.info.bubbles, 6000)
    heights[bubble] = round(skin.info.height_max_mm * 1000) + 1
    with pytest.raises(bs.DeviceRefused):
        raw_show(skin, heights.tolist())
    state = skin.state()
    assert state.target_mm == pytest.approx(6.0)
    assert state.mode == "active"


@pytest.mark.promise("refused-not-applied")
@pytest.mark.long
@pytest.mark.parametrize("by", [-1, 1])
def test_the_wristband_refuses_heights_for_another_number_of_bubbles(skin, by):
    with pytest.raises(bs.BubbleskinError):
        raw_show(skin, [6000] * (skin.info.bubbles + by))
    assert skin.state().mode in ("venting", "idle")


@pytest.mark.long
def test_the_wristband_refuses_a_ramp_that_is_too_long(skin):
    with pytest.raises(bs.DeviceRefused):
        raw_show(skin, [6000] * skin.info.bubbles, over_ms=60001)
    assert skin.state().mode in ("venting", "idle")


@pytest.mark.long
def test_a_new_session_has_not_subscribed_to_what_another_has(skin):
    at_once(skin.link.call("SUBSCRIBE", (10,)))
    at_once(skin.link.hello())
    skin.link.telemetry.clear()
    skin.sleep(0.5)
    assert not skin.link.telemetry


@pytest.mark.long
def test_a_show_at_its_limits_is_taken(skin):
    raw_show(skin, [round(skin.info.height_max_mm * 1000)] * skin.info.bubbles, over_ms=60000)
    assert skin.state().mode == "active"


@pytest.mark.promise("kept-alive")
@pytest.mark.long
def test_a_script_that_thinks_keeps_its_shape(skin):
    """Longer than the wristband waits for a silent host: the link is kept alive without anybody calling."""
    skin.show(np.full(skin.info.bubbles, 6.0))
    told = len(skin.fault_log())
    skin.sleep(2 * skin.settings()["deadman_vent"].value)
    assert skin.state().mode == "active"
    assert len(skin.fault_log()) == told


@pytest.mark.promise("silent-device")
@pytest.mark.long
def test_no_answer_is_told_in_time_and_may_have_been_applied(skin, line, monkeypatch):
    with monkeypatch.context() as cut:
        cut.setattr(skin.link.transport, "write", lambda data: None)
        with pytest.raises(bs.LinkError) as caught:
            skin.show(np.full(skin.info.bubbles, 6.5), wait=False)
    assert isinstance(caught.value, bs.DeviceSilent)
    assert caught.value.outcome_unknown
    assert skin.state().mode in ("idle", "venting"), "nothing of it has come"


@pytest.mark.promise("restart-told")
@pytest.mark.long
@pytest.mark.not_on("board", "a restart of a real board ends its port: done by hand, see docs/store.md")
def test_a_restart_is_told_and_nothing_is_sent_again(skin):
    skin.show(np.full(skin.info.bubbles, 6.0))
    skin.restart()
    skin.sleep(2.0)
    assert skin.state().mode in ("boot", "venting", "idle"), "the shape has gone with the restart"


@pytest.mark.promise("threads")
@pytest.mark.long
def test_threads_share_a_skin(skin):
    n, wrong = skin.info.bubbles, []

    def work(number):
        try:
            for turn in range(5):
                skin.show(np.full(n, 6.0 + number / 10 + turn / 100), wait=False)
                if np.ptp(skin.state().target_mm) > 1e-3:
                    wrong.append("a mixture of two shapes")
        except bs.BubbleskinError as error:
            wrong.append(str(error))

    threads = [threading.Thread(target=work, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []


@pytest.mark.promise("memory")
@pytest.mark.not_on("sim", "CPython's heap says nothing about MicroPython's")
def test_requests_leave_the_heap_as_it_is(skin, record_property):
    def free():
        return skin.health().heap_free

    n = skin.info.bubbles
    for _ in range(3):  # what is made once has been made
        skin.show(np.full(n, 6.0), wait=False)
        before = free()
    for _ in range(30):
        skin.show(np.full(n, 6.0), wait=False)
        with pytest.raises(bs.DeviceRefused):
            raw_show(skin, [round(skin.info.height_max_mm * 1000) + 1] * n)
    used = before - free()
    record_property("heap used by 60 requests, bytes (at most 1024)", used)
    assert used <= 1024
