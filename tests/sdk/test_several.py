"""Several wristbands in one script, which begin at the same moment of this computer's clock."""

import time

import pytest

import bubbleskin as bs

RISE = bs.Sequence([bs.Step([8.0] * 7, ramp=0.1)])


def origin(board):
    """By how much a served board's time is ahead of this computer's clock: it may lag behind that for a while, not run ahead."""
    ahead = []
    for _ in range(1000):
        ahead.append(board.time - time.monotonic())
        time.sleep(0.001)
    return max(ahead)


@pytest.mark.medium
def test_two_wristbands_begin_at_the_same_moment(served, served_port):
    with bs.connect(served.name) as one, bs.connect(served_port.name) as other:
        moment = time.monotonic() + 0.5
        for skin in (one, other):
            skin.play(RISE, at=skin.clock.at(moment), wait=False)
        for skin in (one, other):
            while skin.playing().state != "ended":
                skin.sleep(0.02)
        began = []
        for skin, board in ((one, served.board), (other, served_port.board)):
            status = skin.playing()
            assert status.reason == "complete", "a wristband that waits while the script asks the other is not given up"
            began.append(status.begun - origin(board))
        apart = abs(began[0] - began[1])
        lag = one.info.tick  # a busy computer may serve a board late all the time
        assert apart < one.info.tick + lag + one.clock.uncertainty + other.clock.uncertainty
