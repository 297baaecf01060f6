"""What the link logs: frames at DEBUG; reconnects, restarts and what is sent again at INFO; and the command that shows it."""

import logging
import re

import numpy as np
import pytest

import bubbleskin as bs
from bubbleskin.cli.command import main
from bubbleskin.link.link import Link, run_sync
from bubbleskin.sim import SimulatedBoard, SimulatedTransport
from bubbleskin.skin import AsyncSkin, Skin

pytestmark = pytest.mark.timeout(60)


def told(caplog, level, *words):
    """The lines of one level that have these words."""
    lines = [record.getMessage() for record in caplog.records if record.levelno == level]
    return [line for line in lines if all(word in line for word in words)]


def test_every_frame_is_told_with_name_number_and_size(tapped, caplog):
    skin, tap = tapped()
    with caplog.at_level(logging.DEBUG, "bubbleskin.link"):
        sent, received = len(tap.sent), len(tap.received)
        skin.show(np.full(7, 9.0), wait=False)
    (out,) = told(caplog, logging.DEBUG, "sent SHOW")
    (back,) = told(caplog, logging.DEBUG, "received SHOW_REPLY")
    for line, size in ((out, len(tap.sent) - sent), (back, len(tap.received) - received)):
        number, told_size = re.search(r" (\d+), (\d+) bytes$", line).groups()
        assert int(told_size) == size
        assert int(number) == 2, "after LAYOUT, which opened the skin"
    assert all(record.name.startswith("bubbleskin.link.") for record in caplog.records)


def test_telemetry_and_pings_are_told_too(tapped, caplog):
    skin, _ = tapped()
    with caplog.at_level(logging.DEBUG, "bubbleskin.link"):
        states = skin.telemetry(50)
        next(states)
        skin.sleep(0.3)
    assert told(caplog, logging.DEBUG, "received TELEMETRY")
    assert told(caplog, logging.DEBUG, "sent PING")
    assert told(caplog, logging.DEBUG, "received PING_REPLY")


def test_what_is_sent_again_is_told(tapped, caplog):
    lost = []
    skin, _ = tapped(change=lambda data: data if not lost else lost.pop() and b"")
    with caplog.at_level(logging.INFO, "bubbleskin.link"):
        lost.append(True)
        skin.state()
    assert told(caplog, logging.INFO, "ESTIMATE 2 is sent again")
    assert not told(caplog, logging.DEBUG), "no frames"


def test_a_restart_and_a_new_session_are_told(caplog):
    board = SimulatedBoard("wristband7")
    link = Link(SimulatedTransport(board, "sim"), 2.0)
    before = run_sync(link.hello())["boot_id"]
    with caplog.at_level(logging.INFO, "bubbleskin.link"):
        board.reset()
        with pytest.raises(bs.DeviceRestarted):
            run_sync(link.call("STATE"))
        (line,) = told(caplog, logging.INFO, "the device has restarted")
        assert f"{before:08x}" in line
        assert not told(caplog, logging.INFO, "is open")
        run_sync(link.hello())
    assert told(caplog, logging.INFO, f"session {link.session:08x} is open")


class Unplugged(SimulatedTransport):
    """A transport whose port goes and comes back."""

    reopens = True
    gone = False

    def read(self, timeout):
        if self.gone:
            raise bs.LinkError("gone")
        return super().read(timeout)

    def reopen(self):
        self.gone = False


def test_a_port_that_goes_and_comes_back_is_told(caplog):
    line = Unplugged(SimulatedBoard("wristband7"), "here")
    with Skin(run_sync(AsyncSkin.open(line, 2.0))) as skin, caplog.at_level(logging.INFO, "bubbleskin.link"):
        line.gone = True
        skin.state()
    assert told(caplog, logging.INFO, "here is lost", "gone")
    assert told(caplog, logging.INFO, "here is back")


@pytest.mark.promise("log")
def test_nothing_is_formatted_when_nobody_wants_it(tapped, monkeypatch):
    skin, _ = tapped()
    monkeypatch.setattr(logging.Logger, "_log", lambda *_, **__: pytest.fail("logged"))
    skin.show(np.full(7, 9.0))


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as end:
        main(list(arguments))
    return end.value.code, *capsys.readouterr()


def test_the_command_shows_it_where_it_is_asked_to(monkeypatch, capsys):
    info = ["info", "--json", "--device", "sim://wristband7"]
    monkeypatch.setenv("BUBBLESKIN_LOG", "debug")
    code, out, err = run(capsys, *info)
    assert code == 0
    assert out.startswith("{"), "the output stays what it was"
    assert re.search(r"DEBUG bubbleskin\.link\.\w+: sent HELLO 1, \d+ bytes", err)
    assert re.search(r"INFO bubbleskin\.link\.\w+: session [0-9a-f]{8} is open", err)
    monkeypatch.setenv("BUBBLESKIN_LOG", "info")
    code, out, err = run(capsys, *info)
    assert "sent" not in err
    assert "is open" in err
    monkeypatch.delenv("BUBBLESKIN_LOG")
    assert run(capsys, *info)[2] == ""


def test_a_wrong_level_is_one_line(monkeypatch, capsys):
    monkeypatch.setenv("BUBBLESKIN_LOG", "loud")
    code, out, err = run(capsys, "info", "--device", "sim://wristband7")
    assert (code, out) == (2, "")
    assert err == "BUBBLESKIN_LOG is 'loud'; give one of debug, info, warning, error, or leave it unset.\n"
