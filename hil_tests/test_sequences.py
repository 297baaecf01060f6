"""Sequences on the device: each step in its tick, conditions that never come, pause, what ends them, what is refused."""

import math

import numpy as np
import pytest

import bubbleskin as bs

pytestmark = pytest.mark.timeout(240)


def shape(skin, height_mm):
    return np.full(skin.info.bubbles, float(height_mm))


def far(skin):
    """A step that no device settles in so short a time."""
    return bs.Step(shape(skin, 11.0), 0.05, until=bs.Settled(0.05, 0.02, "hold"), name="leap")


def check_schedule(skin, played, sequence):
    """Every step began within one tick of its schedule."""
    due = played.began[0]
    order = list(sequence.unrolled())
    assert played.steps == tuple(order)
    assert played.lost == 0
    for index, began in zip(order, played.began, strict=True):
        assert abs(began - due) <= skin.info.tick + 1e-9
        due += sequence.each[index].shortest
    assert abs(played.ended - due) <= skin.info.tick + 1e-9
    assert due - played.began[0] == pytest.approx(sequence.duration, abs=1e-6)


def test_steps_begin_within_a_tick_of_their_schedule(skin):
    """Times that are no whole ticks, in repeats: nothing adds up."""
    heights = [6.0, 9.5, 7.3]
    ramps = [0.0173, 0.0411, 0.0337]
    steps = [bs.Step(shape(skin, h), ramp, "smooth") for h, ramp in zip(heights, ramps, strict=True)]
    sequence = bs.Sequence([bs.Repeat(steps, 4), bs.Step(None, until=bs.After(0.0511))], loops=2)
    check_schedule(skin, skin.play(sequence), sequence)


@pytest.mark.long
def test_a_start_at_a_device_time(skin):
    at = skin.state().time + 0.3
    sequence = bs.Sequence([bs.Step(shape(skin, 6.0), 0.1)])
    assert skin.play(sequence, at=at, wait=False) is None
    playing = skin.playing()
    assert (playing.state, playing.step) == ("waiting", -1)
    assert skin.state().mode == "idle"
    skin.sleep(0.5)
    playing = skin.playing()
    assert (playing.state, playing.reason, playing.step) == ("ended", "complete", 0)
    assert playing.begun == pytest.approx(at, abs=skin.info.tick)
    with pytest.raises(bs.DeviceRefused, match="has passed"):
        skin.play(sequence, at=at)
    with pytest.raises(bs.InvalidInput, match="at is nan"):
        skin.play(sequence, at=math.nan)


@pytest.mark.long
def test_the_device_follows_the_ramp(skin):
    """The setpoint is what `targets_at` says, at the firmware's own time."""
    sequence = bs.Sequence([bs.Step(shape(skin, 12.0), 0.6, "smooth", bs.After(0.3))])
    skin.play(sequence, wait=False, anyway=True)
    begun = None
    for _ in range(12):
        skin.sleep(0.05)
        state = skin.state()
        begun = skin.playing().begun if begun is None else begun
        if skin.simulated:
            asked = sequence.targets_at(state.time - begun)
            assert np.abs(skin.simulated.alone_mm - asked).max() < 1.0, "on its way"
    skin.sleep(0.4)
    assert skin.state().alone_mm == pytest.approx(shape(skin, 12.0), abs=0.2)


def test_a_condition_that_never_comes_ends_by_its_timeout(skin):
    with pytest.raises(
        bs.DeviceFault, match=r"^Step 0 \(leap\) did not settle within 0.02 s: bubble.* instead of 11.00 mm"
    ) as fault:
        skin.play(bs.Sequence([far(skin), bs.Step(shape(skin, 6.0), 0.1)]))
    assert "its shape is held" in str(fault.value)
    assert skin.playing().reason == "by_timeout"
    assert skin.state().mode == "active"


@pytest.mark.long
@pytest.mark.parametrize(("then", "modes"), [("vent", ("venting", "idle")), ("stop", ("holding",))])
def test_what_follows_a_timeout(skin, then, modes):
    step = bs.Step(shape(skin, 12.5), until=bs.Settled(0.05, 0.02, then))
    with pytest.raises(bs.DeviceFault, match="did not settle"):
        skin.play(bs.Sequence([step]))
    assert skin.state().mode in modes


@pytest.mark.long
def test_after_a_timeout_it_goes_on_and_says_which(skin):
    steps = [bs.Step(shape(skin, 12.5), until=bs.Settled(0.05, 0.02, "go on")), bs.Step(shape(skin, 6.0), 0.1)]
    played = skin.play(bs.Sequence(steps))
    assert played.steps == (0, 1)
    (sentence,) = played.timeouts
    assert sentence.startswith("Step 0 did not settle within 0.02 s: bubble")
    assert played.began[1] - played.began[0] == pytest.approx(0.02, abs=2 * skin.info.tick)


@pytest.mark.long
def test_a_condition_that_comes(skin):
    played = skin.play(bs.Sequence([bs.Step(shape(skin, 10.0), 0.1, until=bs.Settled(0.2, 5.0, "vent"))]))
    assert played.timeouts == ()
    assert 0.1 <= played.ended - played.began[0] < 2.0
    assert np.abs(skin.state().alone_mm - 10.0).max() <= 0.2


@pytest.mark.long
def test_pause_and_resume(skin):
    sequence = bs.Sequence([bs.Step(shape(skin, 12.0), 0.6), bs.Step(None, until=bs.After(0.1))])
    skin.play(sequence, wait=False, anyway=True)
    skin.sleep(0.3)
    skin.pause()
    skin.sleep(0.4)
    playing = skin.playing()
    assert (playing.state, playing.step) == ("paused", 0)
    held = skin.state().alone_mm
    assert (held < 11.5).all()
    assert (held > 6.0).all()
    skin.sleep(0.2)
    assert np.abs(skin.state().alone_mm - held).max() < 0.3
    skin.resume()
    skin.sleep(0.6)
    assert skin.playing().reason == "complete"
    assert np.abs(skin.state().alone_mm - 12.0).max() <= 0.2


@pytest.mark.long
@pytest.mark.parametrize("end", ["show", "stop", "vent"])
def test_what_ends_a_sequence(skin, end):
    skin.play(bs.Sequence([bs.Step(shape(skin, 9.0), 0.05), bs.Step(shape(skin, 6.0), 0.05)], loops=0), wait=False)
    skin.sleep(0.2)
    assert skin.playing().state == "playing"
    if end == "show":
        skin.show(shape(skin, 8.0), wait=False)
    else:
        getattr(skin, end)()
    playing = skin.playing()
    assert (playing.state, playing.reason) == ("ended", "cancelled")
    assert skin.state().mode == {"show": "active", "stop": "holding", "vent": "venting"}[end]
    with pytest.raises(bs.DeviceRefused, match="its sequence is ended"):
        skin.pause()


@pytest.mark.long
def test_another_sequence_takes_over(skin):
    skin.play(bs.Sequence([bs.Step(shape(skin, 12.0), 0.2)], loops=0), wait=False)
    skin.sleep(0.1)
    played = skin.play(bs.Sequence([bs.Step(shape(skin, 6.0), 0.1)]))
    assert played.steps == (0,)
    assert played.timeouts == ()


@pytest.mark.long
def test_progress_is_told(skin):
    told = []
    sequence = bs.Sequence([bs.Step(shape(skin, 6.0), 0.05, name="up"), bs.Step(shape(skin, 7.0), 0.05)], loops=2)
    skin.play(sequence, progress=told.append)
    assert [(one.step, one.name, one.begun_steps, one.steps) for one in told if one.state == "playing"] == [
        (0, "up", 1, 4),
        (1, "", 2, 4),
        (0, "up", 3, 4),
        (1, "", 4, 4),
    ]


OTHERS = {
    "another board": (
        lambda n: bs.Sequence([bs.Step([6.0] * n, 1)], board="wristband91"),
        "is for a wristband91; this is a",
    ),
    "another number of bubbles": (lambda n: bs.Sequence([bs.Step([6.0] * (n + 1), 1)]), r"is for \d+ bubbles"),
    "another layout": (
        lambda n: bs.Sequence([bs.Step([6.0] * n, 1)], layout=bs.Layout.grid(1, n)),
        "another layout: it wants bubble",
    ),
    "too high": (
        lambda n: bs.Sequence([bs.Step([6.0] * n, 1), bs.Step([20.0] * n, 1, name="up")]),
        r"Step 1 \(up\): .* above the limit",
    ),
    "too short": (lambda n: bs.Sequence([bs.Step([6.0] * n, 0.001)]), "Step 0 takes 1 ms; a step takes a tick"),
    "no sequence": (lambda n: 17, "17 cannot be played"),
    "no file": (lambda n: "nowhere.json", "Cannot read the sequence nowhere.json"),
}


@pytest.mark.long
@pytest.mark.parametrize("other", OTHERS)
def test_what_this_device_cannot_play_is_refused_before_a_byte_is_sent(skin, other):
    make, sentence = OTHERS[other]
    before = skin.health()
    with pytest.raises(bs.InvalidInput, match=sentence):
        skin.play(make(skin.info.bubbles))
    assert skin.health().frames_good == before.frames_good + 1


def choreography(skin, seconds, each=0.1):
    """Ten different shapes a second."""
    n = skin.info.bubbles
    rng = np.random.default_rng(4)
    count = round(seconds / each)
    return bs.Sequence([bs.Step(rng.uniform(5.5, 9.5, n).round(3), each) for _ in range(count)])


@pytest.mark.long
@pytest.mark.slow
def test_sixty_seconds_fit_the_memory(skin):
    sequence = choreography(skin, 60)
    before = skin.state().time
    skin.play(sequence, wait=False)  # all of it is there: nobody needs to stay
    assert skin.state().time - before < 5
    skin.sleep(61)
    playing = skin.playing()
    assert (playing.state, playing.reason, playing.step) == ("ended", "complete", len(sequence.each) - 1)
    assert playing.begun == pytest.approx(playing.begun, abs=skin.info.tick)


@pytest.mark.long
@pytest.mark.slow
def test_a_longer_one_streams_without_a_gap(skin):
    sequence = choreography(skin, 60, 0.02)
    with pytest.raises(bs.InvalidInput, match="wait=True"):
        skin.play(sequence, wait=False)
    check_schedule(skin, skin.play(sequence), sequence)
