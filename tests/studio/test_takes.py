"""The recorder without any page: when a recording ends, what stays of it, and what it is to look at one."""

import asyncio
from dataclasses import replace

import numpy as np
import pytest

from bubbleskin.studio import recorder as recorder_module
from bubbleskin.studio.owner import Owner
from bubbleskin.studio.recorder import Recorder


@pytest.fixture
def with_recorder(in_a_loop):
    """`with_recorder(use, folder)`: what `use(recorder, owner)` returns."""

    def run(use, folder=None):
        async def whole():
            owner = Owner()
            recorder = Recorder(owner, folder)
            await owner.open("sim://wristband7")
            try:
                return await use(recorder, owner)
            finally:
                await owner.close()
                await recorder.close()

        return in_a_loop(whole())

    return run


async def some(recorder, states=4):
    take = recorder.current
    while len(take.states) < states:
        await asyncio.sleep(0.01)
    return take


@pytest.mark.medium
def test_it_ends_where_the_wristband_changes_or_restarts_and_where_it_is_long(with_recorder, monkeypatch):
    async def use(recorder, owner):
        assert recorder.start() == ""
        first = await some(recorder)
        await owner.open("sim://wristband19")
        assert recorder.takes == {1: first}
        assert recorder.current is None
        recorder.start()
        second = await some(recorder)
        second.states[-1] = replace(second.states[-1], time=1e6)
        while recorder.current:
            await asyncio.sleep(0.01)
        assert "restarted" in owner.note
        second.states.pop()
        monkeypatch.setattr(recorder_module, "TAKE_MOST_S", 0.2)
        recorder.start()
        third = recorder.current
        while recorder.current:
            await asyncio.sleep(0.01)
        assert third.seconds == pytest.approx(0.2, abs=0.06)
        monkeypatch.setattr(recorder_module, "ALL_MOST_S", 0.2)
        assert "delete one" in recorder.start()

    with_recorder(use)


def test_files_go_with_the_run_or_stay_in_the_folder(with_recorder, tmp_path):
    async def use(recorder, owner):
        recorder.start()
        await some(recorder)
        recorder.end()
        assert recorder.file(recorder.shown.path.name)
        return recorder.folder

    assert not with_recorder(use).exists()
    assert with_recorder(use, tmp_path) == tmp_path
    (kept,) = tmp_path.iterdir()
    assert kept.read_text().splitlines()[-1].count(",") > 7 * 5


def test_a_moment_is_the_last_state_before_it(with_recorder):
    async def use(recorder, owner):
        assert (recorder.start(), recorder.start()) == ("", ""), "it goes on"
        await some(recorder, 6)
        recorder.end()
        take = recorder.shown
        since = np.array([state.time - take.states[0].time for state in take.states])
        for index, seconds in enumerate(since):
            assert (take.index(seconds), take.index(seconds + 0.03)) == (index, index)
        assert (take.index(-5.0), take.index(1e9)) == (0, len(since) - 1)
        recorder.seek(1e9)
        assert recorder.at_s == take.seconds
        recorder.look(77)
        assert recorder.shown is take

    with_recorder(use)


def test_without_a_wristband_there_is_nothing_to_record(in_a_loop):
    async def use():
        recorder = Recorder(Owner())
        said = recorder.start()
        await recorder.close()
        return said

    assert "No wristband" in in_a_loop(use())
