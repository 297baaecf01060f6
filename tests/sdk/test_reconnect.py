"""The cable pulled and put back, the board restarted, another program: recovered, or told in time; never a replay."""

import asyncio
import contextlib
import threading
import time
from itertools import islice

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.sim import SimulatedBoard
from bubbleskin.sim.serve import PtyEnd, TcpEnd, serve

pytestmark = pytest.mark.timeout(60)

TIMEOUT = 3.0


class Cable:
    """A board that goes on whatever is plugged in: `pull` and `push` the cable, at a name that stays the same."""

    def __init__(self, kind, path):
        self.board = SimulatedBoard("wristband7")
        self._kind = kind
        self._halt = threading.Event()
        self._end = None
        self._lock = threading.Lock()
        self._path = path
        self._port = 0
        self.push()
        self.name = str(path) if kind == "pty" else self._end.name
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def push(self):
        with self._lock:
            if self._kind == "tcp":
                self._end = TcpEnd(self._port)
                self._port = int(self._end.name.rsplit(":", 1)[1])
            else:
                self._end = PtyEnd()
                self._path.symlink_to(self._end.name)

    def pull(self):
        with self._lock:
            self._end.close()
            self._end = None
            self._path.unlink(missing_ok=True)
            self.board.to_device.clear()
            self.board.from_device.clear()

    def _run(self):
        while not self._halt.is_set():
            with self._lock:
                if self._end:
                    next(serve(self.board, self._end))
                    pause = 0.001
                else:
                    self.board.tick()
                    self.board.from_device.clear()
                    pause = self.board.tick_s
            time.sleep(pause)

    def reset(self):
        with self._lock:
            self.board.reset()

    def stop(self):
        self._halt.set()
        self._thread.join(5.0)
        if self._end:
            self._end.close()


@pytest.fixture(params=["pty", "tcp"])
def cable(request, tmp_path):
    cable = Cable(request.param, tmp_path / "port")
    yield cable
    cable.stop()


def soon(*steps):
    """Does the steps in a thread, each after so many seconds."""

    def run():
        for seconds, act in steps:
            time.sleep(seconds)
            act()

    thread = threading.Thread(target=run)
    thread.start()
    return thread


@pytest.mark.promise("cable")
@pytest.mark.medium
def test_pulled_and_put_back_between_two_calls(cable):
    with bs.connect(cable.name, timeout=TIMEOUT) as skin:
        skin.show(np.full(7, 9.5), wait=False)
        session = skin.link.session
        cable.pull()
        time.sleep(0.3)
        cable.push()
        assert skin.state().target_mm.tolist() == [9.5] * 7
        assert skin.link.session == session, "the same session goes on"


def patient(skin):
    """Its deadman waits for longer than a cable is out."""
    skin.configure(deadman_hold=5.0, deadman_vent=5.0)


@pytest.mark.promise("cable")
@pytest.mark.medium
def test_pulled_and_put_back_during_show(cable):
    with bs.connect(cable.name, timeout=TIMEOUT) as skin:
        patient(skin)
        thread = soon((0.2, cable.pull), (0.3, cable.push))
        state = skin.show(np.full(7, 10.0), over=1.5)
        assert state.height_mm == pytest.approx(10, abs=0.2)
        thread.join()


@pytest.mark.medium
def test_pulled_during_show_for_longer_than_the_deadman_waits(cable):
    """What moves is held, and whoever asked is told."""
    with bs.connect(cable.name, timeout=TIMEOUT) as skin:
        thread = soon((0.2, cable.pull), (0.5, cable.push))
        with pytest.raises(bs.DeviceFault, match=r"holding in the middle of a show.*its host was silent"):
            skin.show(np.full(7, 10.0), over=1.5)
        thread.join()
        assert [fault.name for fault in skin.fault_log()] == ["host_silent"]


@pytest.mark.medium
def test_pulled_and_put_back_during_telemetry_and_an_upload(cable):
    with bs.connect(cable.name, timeout=TIMEOUT) as skin:
        states = skin.telemetry(50)
        next(states)
        thread = soon((0.1, cable.pull), (0.3, cable.push))
        assert len(list(islice(states, 60))) == 60
        thread.join()
        states.close()
        table = bs.build_table(bs.YeohBalloon(mu=38e3))
        thread = soon((0.02, cable.pull), (0.2, cable.push))
        skin.upload_tables(table)
        thread.join()
        assert all(read.to_bytes() == table.to_bytes() for read in skin.read_tables())


@pytest.mark.promise("cable")
@pytest.mark.medium
def test_pulled_for_good_raises_in_time(cable):
    with bs.connect(cable.name, timeout=1.5) as skin:
        cable.pull()
        begin = time.monotonic()
        with pytest.raises(bs.LinkError, match="is lost"):
            skin.show(np.full(7, 10.0))
        assert time.monotonic() - begin < 6.0
        cable.push()
        assert skin.state().mode == "idle", "and it connects again by itself"


@pytest.mark.promise("restart-told")
@pytest.mark.medium
def test_a_restart_is_told_and_nothing_is_sent_again(cable):
    with bs.connect(cable.name, timeout=TIMEOUT) as skin:
        skin.show(np.full(7, 10.0))
        boot = skin.info.boot_id
        thread = soon((0.2, cable.reset))
        with pytest.raises(bs.DeviceRestarted, match="has restarted"):
            skin.show(np.full(7, 12.0), over=2.0)
        thread.join()
        assert skin.info.boot_id != boot
        state = skin.state()
        assert state.mode == "idle"
        assert state.target_mm == pytest.approx(5.0)


@pytest.mark.medium
def test_telemetry_goes_on_after_a_restart(cable, tmp_path):
    """Whoever calls next is told of the restart; what is recorded goes on by itself."""
    with bs.connect(cable.name, timeout=TIMEOUT) as skin, skin.record(tmp_path / "x.csv", 50) as recording:
        skin.sleep(0.2)
        cable.reset()
        with pytest.raises(bs.DeviceRestarted):
            skin.state()
        before = recording.rows
        assert before
        skin.sleep(0.4)
        assert recording.rows > before + 10
        assert recording.lost < 20


@pytest.mark.promise("one-program")
@pytest.mark.medium
def test_another_program_takes_the_wristband(cable):
    """On a line that two can write to: the first is told so, and takes it back with its next call."""
    from bubbleskin.link.message import encode

    with bs.connect(cable.name, timeout=TIMEOUT) as skin:
        with cable._lock:
            cable.board.to_device += encode("HELLO", 9, (2, 2, 12345))
        time.sleep(0.05)
        with pytest.raises(bs.LinkError, match="Another program talks to the wristband"):
            skin.state()
        assert skin.state().mode == "idle"


@pytest.mark.medium
def test_in_asyncio(cable):
    async def script():
        async with await bs.aconnect(cable.name, timeout=TIMEOUT) as skin:
            times = []

            async def watch():
                async for state in skin.telemetry(50):
                    times.append(state.time)

            await skin.configure(deadman_hold=5.0, deadman_vent=5.0)
            watching = asyncio.create_task(watch())
            showing = asyncio.create_task(skin.show(np.full(7, 10.0), over=1.0))
            await asyncio.sleep(0.2)
            await asyncio.to_thread(cable.pull)
            cancelled = asyncio.create_task(skin.state())
            await asyncio.sleep(0.2)
            cancelled.cancel()
            before = len(times)
            await asyncio.to_thread(cable.push)
            state = await showing
            assert state.height_mm == pytest.approx(10, abs=0.2)
            await asyncio.sleep(0.3)
            assert len(times) > before
            watching.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await watching

    asyncio.run(asyncio.wait_for(script(), 20))
