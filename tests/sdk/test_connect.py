"""Connecting: whatever is wrong is one clear sentence of the right class, soon; and nothing stays open."""

import random
import select
import socket
import threading
import time
from itertools import islice
from types import SimpleNamespace

import numpy as np
import pytest
import serial
import serial.rfc2217
from serial.tools import list_ports

import bubbleskin as bs
from bubble_protocol import version
from bubble_protocol.frame import FRAME_MAX
from bubble_protocol.schema import errors
from bubbleskin.async_skin import AsyncSkin
from bubbleskin.link.link import run_sync
from bubbleskin.link.message import encode
from bubbleskin.link.serial import USB_IDS
from bubbleskin.sim.serve import PtyEnd

pytestmark = pytest.mark.timeout(30)

TIMEOUT = 1.0


def fails(kind, *words, act, within=TIMEOUT + 2):
    """`act` raises exactly `kind` in time, with sentences that hold `words`."""
    begin = time.monotonic()
    with pytest.raises(bs.BubbleskinError) as caught:
        act()
    assert time.monotonic() - begin < within
    assert type(caught.value) is kind
    text = str(caught.value)
    assert text.endswith(".")
    assert "\n" not in text
    for word in words:
        assert word in text


def connecting(url):
    return lambda: bs.connect(url, timeout=TIMEOUT)


# What cannot be meant.


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("", ["empty"]),
        ("  ", ["empty"]),
        ("foo://bar", ["foo://bar", "not a port or URL"]),
        ("socket://127.0.0.1", ["does not name host and port", "socket://host:7707"]),
        ("socket://127.0.0.1:99999", ["not a port or URL"]),
        ("rfc2217://:7707", ["does not name host and port"]),
        ("socket://[", ["socket://[", "not a port or URL"]),
        ("sim://", ["wristband7 and wristband19"]),
        ("sim://wristband8", ["'wristband8'", "wristband7 and wristband19"]),
        ("micropython://wristband8", ["'wristband8'", "wristband7 and wristband19"]),
        ("sim://wristband7/seed=3", ["not a simulated board", "sim://wristband7?seed=3"]),
        ("sim://wristband7?speed=2", ["'speed'", "seed, spread, realtime"]),
        ("sim://wristband7?seed=x", ["seed of sim://wristband7 is 'x'", "which is not a number"]),
        ("sim:wristband7", ["sim://wristband7"]),
        ("sim://wristband7?seed=1&loss=0&seed=2", ["says seed more than once"]),
        ("sim://wristband7?seed=-1", ["seed of sim://wristband7 is -1", "0 to 4294967295"]),
        ("sim://wristband7?seed", ["seed of sim://wristband7 is ''"]),
        ("sim://wristband7?loss=2", ["drop is 2", "0 to 1"]),
        ("sim://wristband7?spread=0.6", ["spread is 0.6", "0 to 0.5"]),
        ("sim://wristband7?spread=nan", ["spread is nan"]),
        ("micropython://wristband7?spread=-1", ["spread is -1"]),
    ],
)
def test_a_url_that_cannot_be_meant(url, words):
    fails(bs.InvalidInput, *words, act=connecting(url))


@pytest.mark.parametrize("timeout", [0, -1, float("nan"), float("inf")])
def test_a_timeout_that_cannot_be_meant(port, timeout):
    fails(bs.InvalidInput, f"timeout is {timeout}", act=lambda: bs.connect(port.name, timeout=timeout))
    serial.Serial(port.name, exclusive=True).close()  # it was not even opened


# Where nothing can be opened.


def test_a_micropython_that_is_not_there(monkeypatch, tmp_path):
    monkeypatch.delenv("MICROPYTHON", raising=False)
    monkeypatch.setenv("BUBBLESKIN_CACHE", str(tmp_path))
    monkeypatch.setenv("PATH", str(tmp_path))  # nor anything that could build one
    fails(bs.BubbleskinError, "cannot be built here", "Set MICROPYTHON=", act=connecting("micropython://wristband7"))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("not a program", ["does not run", "Set MICROPYTHON"]),
        ("#!/bin/sh\necho broken >&2; exit 3\n", ["ended with status 3: broken."]),
        ("#!/bin/sh\nexit 0\n", ["ended with status 0: it said nothing."]),
    ],
)
def test_a_micropython_that_is_none(monkeypatch, tmp_path, content, words):
    program = tmp_path / "micropython"
    program.write_text(content)
    program.chmod(0o755)
    monkeypatch.setenv("MICROPYTHON", str(program))
    fails(bs.LinkError, *words, act=connecting("micropython://wristband7"))


def test_a_port_that_is_not_there():
    fails(bs.LinkError, "There is no /dev/ttyNONE.", "sim://wristband7", act=connecting("/dev/ttyNONE"))


def test_a_port_that_is_not_there_names_those_that_are(monkeypatch):
    monkeypatch.setattr(list_ports, "comports", lambda: [SimpleNamespace(device=f"/dev/ttyS{n}") for n in (1, 0)])
    fails(bs.LinkError, "The ports here are /dev/ttyS0, /dev/ttyS1.", act=connecting("/dev/ttyNONE"))


def test_a_file_is_no_port(tmp_path):
    path = tmp_path / "file"
    path.touch()
    fails(bs.LinkError, f"Cannot open {path}", act=connecting(str(path)))


def test_a_port_in_use(port):
    with serial.Serial(port.name, exclusive=True):
        fails(bs.LinkError, f"{port.name} is in use by another program", act=connecting(port.name))


def test_a_port_that_another_skin_holds(served_port):
    with bs.connect(served_port.name):
        fails(bs.LinkError, "is in use", act=connecting(served_port.name))
    bs.connect(served_port.name).close()


def test_a_socket_where_nobody_listens():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        number = one.getsockname()[1]
    fails(
        bs.LinkError, f"Nothing listens at socket://127.0.0.1:{number}.", act=connecting(f"socket://127.0.0.1:{number}")
    )


def plugged(*ports):
    """What the system says is plugged in: wristbands at `ports`, and a printer."""
    vendor, product = USB_IDS[0]
    wristbands = [SimpleNamespace(device=port, vid=vendor, pid=product) for port in ports]
    return lambda: [SimpleNamespace(device="/dev/ttyUSB9", vid=0x1234, pid=1), *wristbands]


def test_no_wristband_attached(monkeypatch):
    monkeypatch.setattr(list_ports, "comports", plugged())
    fails(bs.LinkError, "No wristband is attached.", "sim://wristband7", act=connecting(None))


def test_two_wristbands_attached(monkeypatch):
    monkeypatch.setattr(list_ports, "comports", plugged("/dev/ttyACM1", "/dev/ttyACM0"))
    fails(bs.LinkError, "2 wristbands are attached, at /dev/ttyACM0, /dev/ttyACM1", act=connecting(None))


def test_the_only_wristband_attached_is_taken(monkeypatch, served_port):
    monkeypatch.setattr(list_ports, "comports", plugged(served_port.name))
    with bs.connect() as skin:
        assert skin.info.board == "wristband7"


# What is no wristband.


def random_bytes(rng):
    return lambda data: rng.randbytes(200)


def text(data):
    return b"MicroPython v1.25.0; Raspberry Pi Pico with RP2040\r\n>>> "


def no_answer(data):
    return b""


def telemetry_of_something_else(data):
    return encode("PING_REPLY", 7, (1, 2, 3))


@pytest.mark.medium
@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (random_bytes(random.Random(1)), "It sends data, but not ours."),
        (text, "It sends data, but not ours."),
        (lambda data: data, "It sends data, but not ours."),
        (telemetry_of_something_else, "It sends data, but not ours."),
        (no_answer, "It says nothing at all."),
    ],
    ids=["garbage", "text", "echo", "unasked frames", "silence"],
)
def test_what_does_not_answer_as_a_wristband(behaving, answer, words):
    name = behaving(answer)
    fails(bs.WrongDevice, f"What is at {name} does not answer as a wristband", words, act=connecting(name))
    serial.Serial(name, exclusive=True).close()  # and the port is free again


def test_a_wristband_behind_some_noise_is_found(port, served_port):
    port.write(random.Random(2).randbytes(FRAME_MAX))
    with bs.connect(served_port.name) as skin:
        assert skin.info.bubbles == 7


def no_common(low, high):
    return lambda request: encode("ERROR", request.sequence, (1, 7, 1, 255, 1, low, high))


def of_protocol_1(request):
    """It does not know of sessions, and finds HELLO too long."""
    return encode("ERROR", request.sequence, (1, errors.WRONG_LENGTH, 0, 255, 6, 2, 2))


NOW = version.PROTOCOL_MAX


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ({"low": NOW + 1, "high": NOW + 1}, [f"speaks protocol {NOW + 1}", f"at most {NOW}", "pip install --upgrade"]),
        ({"low": NOW + 1, "high": NOW + 3}, [f"speaks protocols {NOW + 1} to {NOW + 3}", "pip install --upgrade"]),
        ({"low": 1, "high": 1}, ["speaks protocol 1", "2 and newer", "update the wristband's firmware"]),
        (of_protocol_1, ["speaks protocol 1", "2 and newer", "update the wristband's firmware"]),
        (no_common(NOW + 1, NOW + 3), [f"speaks protocols {NOW + 1} to {NOW + 3}", "pip install --upgrade bubbleskin"]),
        (no_common(1, 1), ["speaks protocol 1", "update the wristband's firmware"]),
        ({"bubbles": 8}, ["calls itself wristband7", "reports 8"]),
    ],
)
def test_a_version_or_a_board_that_does_not_fit(scripted, hello, answer, words):
    transport = scripted(answer if callable(answer) else lambda request: hello(request, **answer))
    fails(bs.WrongDevice, *words, act=lambda: run_sync(AsyncSkin.open(transport, 2.0)))
    assert transport.closed
    assert len(transport.requests) == 1


def test_versions_that_overlap_fit(scripted, hello):
    transport = scripted(lambda request: hello(request, 0, 9))
    assert run_sync(AsyncSkin.open(transport, 2.0)).info.protocol == (0, 9)


def test_a_version_mismatch_over_a_real_port(behaving):
    answer = encode("HELLO_REPLY", 1, (5, 6, 1, 2, 0, 1, 0, *bytes(16), 7, 5000, 5000, 14000, 42000, 1, 0, 3))
    name = behaving(lambda data: answer if data else b"")
    fails(bs.WrongDevice, "speaks protocols 5 to 6", act=connecting(name))


# What goes wrong later.


@pytest.mark.medium
def test_a_device_that_stops_answering(served):
    with bs.connect(served.name, timeout=TIMEOUT) as skin:
        skin.show(np.full(7, 6.0), wait=False)
        served.stop()
        for act in (skin.state, skin.health, skin.vent, skin.stop, lambda: skin.show(np.full(7, 6.0))):
            fails(bs.DeviceSilent, f"at {served.name} has not answered", "Check its cable", act=act)
        with pytest.raises(TimeoutError):
            skin.state()


@pytest.mark.medium
def test_telemetry_of_a_device_that_stops_answering(served_port):
    with bs.connect(served_port.name, timeout=TIMEOUT) as skin:
        states = skin.telemetry(50)
        next(states)
        served_port.stop()
        fails(bs.DeviceSilent, "has not answered", act=lambda: list(states), within=2 * TIMEOUT + 2)


@pytest.mark.medium
def test_a_plug_that_is_pulled(port, served_port, tmp_path):
    name = tmp_path / "port"  # the system gives the number of a pseudo-terminal that has gone to the next that is made
    name.symlink_to(served_port.name)
    skin = bs.connect(str(name), timeout=TIMEOUT)
    served_port.stop()
    name.unlink()
    port.close()
    for _ in range(2):
        fails(bs.LinkError, f"connection to {name} is lost", "Check the cable", act=skin.state)
    skin.close()


def test_a_socket_that_closes():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(2.0)
        url = f"socket://127.0.0.1:{listener.getsockname()[1]}"
        closer = threading.Thread(target=lambda: listener.accept()[0].close())
        closer.start()
        fails(bs.LinkError, f"connection to {url} is lost", act=connecting(url))
        closer.join()


def test_a_closed_skin_says_so(served):
    skin = bs.connect(served.name, timeout=TIMEOUT)
    skin.close()
    skin.close()
    fails(bs.LinkError, "is lost", act=skin.state)
    simulated = bs.connect("sim://wristband7")
    simulated.close()
    simulated.close()
    fails(bs.LinkError, "sim://wristband7 is closed; connect again", act=simulated.state)


# What goes right.


@pytest.mark.medium
def test_a_show_is_not_over_before_a_tick_has_seen_it(served):
    with bs.connect(served.name) as skin:  # between two ticks all bubbles rest where the last one has found them
        for height in (9.5, 8.0, 9.0, 8.0, 9.0):
            skin.show([height + 1] * 7, wait=False)
            assert not skin.state().settled
            assert skin.show([height] * 7).height_mm == pytest.approx(height, abs=0.2)


@pytest.mark.medium
def test_a_served_board_takes_shapes_in_real_time(served):
    with bs.connect(served.name) as skin:
        assert skin.simulated is None
        begin = time.monotonic()
        state = skin.show(np.linspace(9, 12, 7), over=0.3)
        assert state.height_mm == pytest.approx(np.linspace(9, 12, 7), abs=0.2)
        assert 0.3 < time.monotonic() - begin < 5
        states = skin.telemetry(50)
        times = [next(states).time for _ in range(10)]
        states.close()
        assert np.diff(times) == pytest.approx(0.02)
        skin.vent()
    assert served.board.alone_mm.max() < 13
    with bs.connect(served.name) as again:
        assert again.state().mode in ("venting", "idle")


class PortWithoutLines(serial.Serial):
    """A pseudo-terminal has no modem lines for an RFC 2217 server to pass on."""

    cts = dsr = ri = cd = False

    def _update_rts_state(self):
        pass

    _update_dtr_state = _update_break_state = _update_rts_state


@pytest.mark.medium
@pytest.mark.filterwarnings("ignore:set(Daemon|Name):DeprecationWarning")  # in pyserial
def test_a_port_of_another_machine(served_port):
    """Through pyserial's own RFC 2217 server."""

    def pass_on(listener):
        connection, _ = listener.accept()
        with connection, PortWithoutLines(served_port.name, timeout=0) as port:
            manager = serial.rfc2217.PortManager(port, SimpleNamespace(write=connection.sendall))
            while True:
                for ready in select.select([connection, port.fd], [], [])[0]:
                    if ready is not connection:
                        connection.sendall(b"".join(manager.escape(port.read(4096))))
                    elif data := connection.recv(4096):
                        port.write(b"".join(manager.filter(data)))
                    else:
                        return

    with socket.create_server(("127.0.0.1", 0)) as listener:
        server = threading.Thread(target=pass_on, args=(listener,))
        server.start()
        with bs.connect(f"rfc2217://127.0.0.1:{listener.getsockname()[1]}") as skin:
            begin = time.monotonic()
            assert skin.show(np.full(7, 10.0)).height_mm == pytest.approx(10, abs=0.2)
            times = [state.time for state in islice(skin.telemetry(50), 20)]
            assert np.diff(times) == pytest.approx(0.02)
            assert time.monotonic() - begin < 5
        server.join(5)
        assert not server.is_alive()


def test_real_time_on_request():
    with bs.connect("sim://wristband7?realtime=1") as skin:
        skin.sleep(0.05)
        begin, virtual = time.monotonic(), skin.state().time
        skin.sleep(0.3)
        assert 0.25 < time.monotonic() - begin < 5
        assert skin.state().time - virtual == pytest.approx(0.3, abs=0.02)


def test_the_name_that_was_given_is_the_name_in_errors():
    end = PtyEnd()
    name = end.name
    end.close()
    fails(bs.LinkError, name, act=connecting(name))
