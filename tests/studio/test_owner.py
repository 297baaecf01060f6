"""The owner of the wristband without any page: what is asked last counts, stop and vent come first, nobody leaves it standing."""

import asyncio
import time

import numpy as np
import pytest

from bubbleskin.errors import InvalidInput
from bubbleskin.sequence import library as sequences
from bubbleskin.studio import owner as owner_module
from bubbleskin.studio.owner import Owner, as_asked, in_real_time

FLAT_MM = 5.4


@pytest.fixture
def with_owner(in_a_loop):
    """`with_owner(use, url, attended)`: what `use(owner)` returns; the owner is closed after it."""

    def run(use, url="sim://wristband7", attended=lambda: True):
        async def whole():
            owner = Owner(attended)
            await owner.open(url)
            try:
                return await use(owner)
            finally:
                await owner.close()

        return in_a_loop(whole())

    return run


async def until(true, seconds=30.0):
    end = time.monotonic() + seconds
    while not true() and time.monotonic() < end:
        await asyncio.sleep(0.01)
    assert true()


def heights(owner):
    return owner.skin.simulated.height_mm


def test_of_many_wishes_the_newest_is_shown(with_owner):
    async def use(owner):
        for height in np.linspace(6, 10, 200):
            owner.ask(np.full(7, height))
        await until(lambda: np.all(heights(owner) > 9.7))
        assert np.all(owner.wanted_mm == 10.0)

    with_owner(use)


def test_one_bubble_is_asked_and_the_others_stay(with_owner):
    async def use(owner):
        await until(lambda: owner.state)
        owner.ask(np.full(7, 8.0))
        owner.ask_one(3, 11.0)
        owner.ask_one(9, 11.0)  # there is none
        await until(lambda: heights(owner)[3] > 10.5)
        assert np.all(np.delete(heights(owner), 3) < 8.6)

    with_owner(use)


def test_stop_drops_what_was_asked(with_owner):
    async def use(owner):
        await until(lambda: owner.state)
        owner.ask(np.full(7, 9.0))
        await owner.stop()
        await asyncio.sleep(0.3)
        assert np.all(heights(owner) < FLAT_MM)
        assert owner.activity == ""

    with_owner(use)


def test_the_end_vents(with_owner):
    async def use(owner):
        owner.ask(np.full(7, 9.0))
        await until(lambda: np.all(heights(owner) > 8.5))
        return owner.skin.simulated

    board = with_owner(use)
    board.step(0.4)  # less than the second after which the wristband would do it by itself
    assert np.all(board.height_mm < FLAT_MM)


@pytest.mark.medium
def test_where_nobody_looks_everything_vents(with_owner, monkeypatch):
    monkeypatch.setattr(owner_module, "GRACE_S", 0.2)
    there = [True]

    async def use(owner):
        owner.ask(np.full(7, 9.0))
        await until(lambda: np.all(heights(owner) > 8.5))
        there.clear()
        await until(lambda: np.all(heights(owner) < FLAT_MM))

    with_owner(use, attended=lambda: bool(there))


@pytest.mark.medium
def test_who_has_it_alone_is_not_disturbed_and_stop_ends_that(with_owner, monkeypatch):
    async def rise(skin):
        await skin.show(np.full(7, 8.0), wait=False)
        try:
            await asyncio.sleep(60)
        finally:
            await skin.vent()

    async def use(owner):
        await until(lambda: owner.state)
        owner.lend(rise, "calibration")
        await until(lambda: np.all(heights(owner) > 7.5))
        told = len(owner.history)
        owner.ask(np.full(7, 11.0))
        assert "calibration has the wristband" in owner.problem
        assert np.all(owner.wanted_mm < 9)
        owner.problem = ""
        owner.begin("terrain")
        assert "calibration has the wristband" in owner.problem
        with pytest.raises(InvalidInput, match="calibration has"):
            owner.play(sequences.pulse(owner.skin.layout), "pulse")
        with pytest.raises(InvalidInput, match="calibration has"):
            owner.lend(rise, "calibration")
        await until(lambda: len(owner.history) > told + 3)
        assert owner.activity == "calibration"
        assert np.all(heights(owner) < 8.5)
        await owner.stop()
        await until(lambda: np.all(heights(owner) < FLAT_MM) and not owner.is_lent)
        owner.ask(np.full(7, 7.0))
        await until(lambda: np.all(heights(owner) > 6.7))
        assert owner.activity == ""

    with_owner(use)


@pytest.mark.medium
def test_who_has_it_alone_is_ended_where_nobody_looks(with_owner, monkeypatch):
    monkeypatch.setattr(owner_module, "GRACE_S", 0.2)
    there = [True]

    async def rise(skin):
        await skin.show(np.full(7, 8.0), wait=False)
        await asyncio.sleep(60)

    async def use(owner):
        await until(lambda: owner.state)
        owner.lend(rise, "calibration")
        await until(lambda: np.all(heights(owner) > 7.5))
        there.clear()
        await until(lambda: np.all(heights(owner) < FLAT_MM) and not owner.is_lent)

    with_owner(use, attended=lambda: bool(there))


def test_a_device_that_is_not_there_is_a_sentence(with_owner):
    async def use(owner):
        assert owner.skin is None
        owner.ask(np.full(7, 9.0))
        await owner.stop()
        return owner.problem

    assert "There is no board 'wristband8'" in with_owner(use, "sim://wristband8")


def test_what_the_wristband_refuses_is_a_sentence(with_owner):
    async def use(owner):
        owner.ask(np.full(7, 99.0))
        await until(lambda: owner.problem)
        return owner.problem

    assert "99" in with_owner(use)


@pytest.mark.parametrize(
    ("url", "played"),
    [
        ("sim://wristband7", "sim://wristband7?realtime=1"),
        ("sim://wristband7?seed=3", "sim://wristband7?seed=3&realtime=1"),
        ("sim://wristband7?realtime=0", "sim://wristband7?realtime=0"),
        ("/dev/ttyACM0", "/dev/ttyACM0"),
        ("socket://lab:7707", "socket://lab:7707"),
    ],
)
def test_simulated_boards_keep_the_wall_clocks_pace(url, played):
    assert in_real_time(url) == played
    assert in_real_time(as_asked(played)) == played


@pytest.mark.slow
def test_neighbours_lift_no_bubble_past_the_limit(with_owner):
    async def use(owner):
        await until(lambda: owner.state)
        away = np.linalg.norm(owner.skin.layout.positions_mm, axis=1)
        for peak in (9.0, 11.0, 12.5, 13.5):
            owner.ask(peak - 0.006 * away**2)
            await asyncio.sleep(1.5)
            assert heights(owner).max() <= owner.skin.info.height_max_mm + 0.4
        assert heights(owner)[0] > 12

    with_owner(use, "sim://wristband19")


@pytest.mark.slow
def test_vent_ends_a_shape_that_is_still_thought_about(with_owner):
    async def use(owner):
        await until(lambda: owner.state)
        owner.ask(np.full(19, 12.0))  # they touch: where they end takes some tenths of a second to reckon
        await asyncio.sleep(0.02)
        begin = time.monotonic()
        await owner.vent()
        assert time.monotonic() - begin < 5.0
        for _ in range(20):
            await asyncio.sleep(0.1)
            assert np.all(heights(owner) < 6.0)

    with_owner(use, "sim://wristband19")
