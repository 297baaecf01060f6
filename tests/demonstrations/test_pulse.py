"""The pulse as a notification."""

import io

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.demonstrations.pulse import pulse, pulse_per_line


@pytest.mark.parametrize("rate_hz", [0.1, 0.25, 0.5])
def test_rate_and_depth_are_what_they_say(layout, rate_hz):
    sequence = pulse(layout, rate_hz=rate_hz, depth_mm=4, loops=3)
    assert sequence.duration == pytest.approx(3 / rate_hz, abs=0.05), "times are whole ms"
    heights = sequence.targets_at(np.linspace(1 / rate_hz, sequence.duration, 500))
    assert np.ptp(heights) == pytest.approx(4, abs=1e-6)


def test_the_librarys_pulse_keeps_its_shares_at_another_rate(layout):
    """Rise, rest and one of the ring: 0.8, 0.4 and 0.25 of 3.9 s."""
    slow = bs.sequences.pulse(layout, rate_hz=0.1)
    assert slow.each[0].ramp == pytest.approx(0.8 / 3.9 * 10, abs=1e-3)
    assert slow.each[0].until.seconds == pytest.approx(0.4 / 3.9 * 10, abs=1e-3)
    assert slow.each[3].ramp == pytest.approx(0.25 / 3.9 * 10, abs=1e-3)


@pytest.mark.parametrize(("what", "words"), [({"rate_hz": 0}, "rate_hz is 0"), ({"depth_mm": -1}, "depth_mm is -1")])
def test_what_cannot_be_meant_is_refused(layout, what, words):
    with pytest.raises(bs.InvalidInput, match=words):
        pulse(layout, **what)


def test_every_line_is_felt_once(skin):
    """True heights prove that the bubbles moved, and that they are let down after it."""
    sequence = pulse(skin.layout, rate_hz=1, loops=1)
    felt = []
    begin = skin.simulated.time
    for batch in pulse_per_line(skin, io.StringIO("one\ntwo\r\nthree\n"), sequence):
        felt.append(batch)
        assert skin.simulated.height_mm.max() > 9, "the ring is still up: it has only begun to vent"
        assert skin.simulated.time - begin >= len(felt)
    assert [line for batch in felt for line in batch] == ["one", "two", "three"]
    skin.sleep(1)
    assert skin.simulated.height_mm.max() < 5.3


def test_no_line_is_no_pulse(skin):
    assert list(pulse_per_line(skin, io.StringIO(""), pulse(skin.layout))) == []
    assert skin.simulated.height_mm.max() < 5.1


@pytest.mark.medium
def test_the_command_pulses_per_line(command, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.StringIO("a mail\n"))
    status, out, err = command(
        "demo", "pulse", "--rate", "1", "--loops", "1", "--per-line", "--device", "sim://wristband7"
    )
    assert (status, out, err) == (0, "Felt: a mail\n", "")
    assert "without end" in command("demo", "pulse", "--loops", "0", "--per-line")[2]
