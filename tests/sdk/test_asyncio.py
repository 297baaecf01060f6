"""The SDK in an event loop: simulated boards and real ports, tasks side by side, waits that are cancelled."""

import asyncio
import contextlib

import numpy as np
import pytest

import bubbleskin as bs

pytestmark = pytest.mark.timeout(30)


def run(coroutine, seconds=10.0):
    """Run it, for so many seconds of the wall clock at most; errors that nobody heard are the test's failure."""
    unheard = []

    async def bounded():
        asyncio.get_running_loop().set_exception_handler(lambda loop, context: unheard.append(context))
        async with asyncio.timeout(seconds):
            return await coroutine

    result = asyncio.run(bounded())
    assert not unheard
    return result


@pytest.fixture(params=["sim", "realtime", "port"])
def url(request):
    """A simulated board in virtual time, one in real time, and one behind a port in real time."""
    if request.param == "port":
        return request.getfixturevalue("served_port").name
    return "sim://wristband7" + ("?realtime=1" if request.param == "realtime" else "")


@pytest.mark.medium
def test_a_script_in_asyncio(url):
    async def script():
        async with await bs.aconnect(url) as skin:
            assert skin.info.board == "wristband7"
            assert len(skin.layout) == 7
            state = await skin.show(np.linspace(9, 12, 7))
            assert state.height_mm == pytest.approx(np.linspace(9, 12, 7), abs=0.2)
            assert (await skin.health()).exceptions == 0
            assert await skin.faults() == {}
            times = []
            async for state in skin.telemetry(50):
                times.append(state.time)
                if len(times) == 10:
                    break
            assert np.diff(times) == pytest.approx(0.02)
            await skin.stop()
            assert (await skin.state()).mode == "holding"
            await skin.vent()

    run(script())


@pytest.mark.medium
def test_telemetry_and_show_side_by_side(url):
    async def script():
        seen = []

        async def watch(skin):
            async for state in skin.telemetry(50):
                seen.append(state)

        async with await bs.aconnect(url) as skin:
            watching = asyncio.create_task(watch(skin))
            for height in (9.5, 11.0, 10.0):
                state = await skin.show(np.full(7, height))
                assert state.height_mm == pytest.approx(height, abs=0.2)
            watching.cancel()
            with pytest.raises(asyncio.CancelledError):
                await watching
            skin.link.telemetry.clear()
            await skin.sleep(0.2)
            assert not skin.link.telemetry, "the device was told to send no more"
        assert np.diff([state.time for state in seen]) == pytest.approx(0.02)
        assert {9.5, 11.0, 10.0} <= {float(state.target_mm[0]) for state in seen}

    run(script())


def test_many_requests_at_once_have_their_own_answers(url):
    async def script():
        async with await bs.aconnect(url) as skin:
            results = await asyncio.gather(*(skin.state() for _ in range(10)), *(skin.health() for _ in range(10)))
        assert [type(result) for result in results] == [bs.State] * 10 + [bs.Health] * 10

    run(script())


@pytest.mark.medium
def test_a_short_wait_does_not_last_as_long_as_another(url):
    async def script():
        async with await bs.aconnect(url) as skin:
            begin = (await skin.state()).time
            long = asyncio.create_task(skin.sleep(1.5))
            await asyncio.sleep(0)
            await skin.sleep(0.1)
            assert (await skin.state()).time - begin < 1.0
            assert not long.done()
            await long
            assert (await skin.state()).time - begin >= 1.5

    run(script())


@pytest.mark.medium
@pytest.mark.parametrize("patience", [0.0, 0.001, 0.01, 0.03, 0.1])
def test_a_cancelled_call_leaves_the_link_usable(url, patience):
    async def script():
        async with await bs.aconnect(url) as skin:
            for _ in range(5):
                task = asyncio.create_task(skin.show(np.full(7, 11.0), over=5.0))
                await asyncio.sleep(patience)
                task.cancel()
                with contextlib.suppress(asyncio.CancelledError):
                    await task
                state = await skin.state()
                assert len(state.status) == 7
            state = await skin.show(np.full(7, 10.0))
            assert state.height_mm == pytest.approx(10, abs=0.2)

    run(script())


@pytest.mark.medium
def test_a_cancelled_wait_loses_nothing_of_what_others_wait_for(url):
    async def script():
        times = []

        async def watch(skin):
            async for state in skin.telemetry(50):
                times.append(state.time)

        async with await bs.aconnect(url) as skin:
            watching = asyncio.create_task(watch(skin))
            for _ in range(40):
                waiting = asyncio.create_task(skin.sleep(1.0))
                await asyncio.sleep(0.013)
                waiting.cancel()
            watching.cancel()
            await asyncio.gather(watching, waiting, return_exceptions=True)
        assert len(times) > 10
        assert np.diff(times) == pytest.approx(0.02)

    run(script())


def test_telemetry_left_in_the_middle_does_not_end_the_next(url):
    async def script():
        async with await bs.aconnect(url) as skin:
            for rate in (20, 50):
                times = []
                async for state in skin.telemetry(rate):  # the loop is left: asyncio closes the iterator, some time
                    times.append(state.time)
                    if len(times) == 4:
                        break
                assert np.diff(times) == pytest.approx(1 / rate)

    run(script())


@pytest.mark.medium
def test_other_tasks_have_their_turn(url):
    async def script():
        turns = 0

        async def count():
            nonlocal turns
            while True:
                turns += 1
                await asyncio.sleep(0)  # a simulation may be faster than any timer

        async with await bs.aconnect(url) as skin:
            counting = asyncio.create_task(count())
            await skin.sleep(0.5)
            counting.cancel()
        assert turns >= 2

    run(script())


def test_what_is_not_there_is_said_in_asyncio_too():
    async def script():
        with pytest.raises(bs.LinkError, match="There is no /dev/ttyNONE"):
            await bs.aconnect("/dev/ttyNONE")
        with pytest.raises(bs.InvalidInput, match="timeout is 0"):
            await bs.aconnect("sim://wristband7", timeout=0)

    run(script())


def test_a_silent_port_is_a_wrong_device(port):
    async def script():
        with pytest.raises(bs.WrongDevice, match="says nothing at all"):
            await bs.aconnect(port.name, timeout=0.3)

    run(script(), seconds=5.0)


def test_a_device_that_stops_answering(served_port):
    async def script():
        async with await bs.aconnect(served_port.name, timeout=0.3) as skin:
            served_port.stop()
            with pytest.raises(bs.DeviceSilent):
                await skin.state()

    run(script(), seconds=5.0)


def test_connecting_can_be_given_up(port):
    async def script():
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.1):
                await bs.aconnect(port.name, timeout=5.0)
        with pytest.raises(bs.WrongDevice):  # not in use: the first attempt has let go of the port
            await bs.aconnect(port.name, timeout=0.1)

    run(script(), seconds=5.0)


def test_a_closed_port_is_watched_by_nobody(served_port):
    """Its number may soon be another file's, which the loop would then not take."""

    async def script():
        skin = await bs.aconnect(served_port.name)
        descriptor = skin.link.transport.descriptor
        waiting = asyncio.create_task(skin.sleep(20.0))
        await asyncio.sleep(0.05)
        await skin.aclose()
        assert not asyncio.get_running_loop().remove_reader(descriptor)
        waiting.cancel()
        with pytest.raises((asyncio.CancelledError, bs.LinkError)):
            await waiting

    run(script())
