"""The firmware refuses what the SDK would never send: it trusts nobody. Below the public SDK, on both simulated targets."""

import os
import zlib

import numpy as np
import pytest

import bubbleskin as bs
from bubble_protocol import version
from bubble_protocol.schema import errors, messages
from bubbleskin.link.link import run_sync
from bubbleskin.link.message import encode
from bubbleskin.link.reader import Reader

pytestmark = pytest.mark.timeout(60)


@pytest.fixture(params=["sim://wristband7", "micropython://wristband7"])
def skin(request):
    """A wristband that shows 6 mm, and must still show it after the test."""
    try:
        skin = bs.connect(request.param)
    except bs.LinkError:
        raise
    except bs.BubbleskinError as error:
        if os.environ.get("CI"):
            raise
        pytest.skip(str(error))
    with skin:
        skin.show(np.full(7, 6.0))
        tables = skin.health().tables_crc
        yield skin
        state = skin.state()
        assert state.mode == "active"
        assert state.target_mm == pytest.approx(6.0)
        health = skin.health()
        assert health.exceptions == 0
        assert health.tables_crc == tables


def call(skin, name, fixed=(), repeated=()):
    return run_sync(skin.link.call(name, fixed, repeated))


def refused(skin, sentence, name, fixed=(), repeated=()):
    good = skin.health().frames_good
    with pytest.raises(bs.DeviceRefused, match=sentence):
        call(skin, name, fixed, repeated)
    assert skin.health().frames_good == good + 2, "it was sent once, and answered"


@pytest.mark.medium
@pytest.mark.parametrize("count", [0, 1, 6, 8, 100])
def test_show_of_the_wrong_count(skin, count):
    refused(skin, f"refused SHOW: {count} entries for its 7 bubbles", "SHOW", (0,), [(6000,)] * count)


@pytest.mark.promise("refused-not-applied", "height-refused")
@pytest.mark.medium
@pytest.mark.parametrize("bubble", [0, 6])
@pytest.mark.parametrize("height_um", [14001, 32768, 65535])
def test_show_above_the_limit(skin, bubble, height_um):
    heights = [(9000,)] * 7
    heights[bubble] = (height_um,)
    sentence = rf"height_um \(entry {bubble}\) is {height_um} µm; 0 to 14000 µm"
    refused(skin, sentence, "SHOW", (0,), heights)


def test_show_that_takes_too_long(skin):
    refused(skin, "over_ms is 60001 ms; 0 to 60000 ms", "SHOW", (60001,), [(9000,)] * 7)


def test_telemetry_that_is_too_slow(skin):
    refused(skin, "period_ticks is 60001", "SUBSCRIBE", (60001,))


@pytest.mark.medium
@pytest.mark.parametrize(
    ("fixed", "knots", "sentence"),
    [
        ((7, 0, 64), [(5000, 0)], "bubble is 7; 0 to 6 is allowed"),
        ((255, 0, 64), [(5000, 0)], "bubble is 255; 0 to 6 is allowed"),
        ((0, 64, 64), [(5000, 0)], "first is 64; 0 to 63 is allowed"),
        ((0, 63, 64), [(5000, 0), (6000, 0)], "first is 63; 0 to 62 is allowed"),
        ((0, 0, 1), [], "total is 1"),
        ((0, 0, 65), [], "total is 65"),
        ((0, 0, 2), [(5000, 0), (0, 7)], r"knot_um \(entry 1\) is 0"),
    ],
)
def test_part_of_a_table(skin, fixed, knots, sentence):
    refused(skin, sentence, "TABLE_WRITE", fixed, knots)


@pytest.mark.parametrize(
    ("bubble", "knots", "knot"),
    [
        (3, [(5000, 0), (5000, 100), (14000, 200)], 1),
        (0, [(5000, 0), (14000, 42001)], 1),
        (6, [(5000, 0), (13999, 30000)], 1),
        (2, [(5000, 0), (16001, 30000)], 1),
    ],
    ids=["not rising", "too much pressure", "too low", "too high"],
)
def test_a_table_that_cannot_be_used(skin, bubble, knots, knot):
    call(skin, "TABLE_WRITE", (bubble, 0, len(knots)), knots)
    refused(skin, f"table of bubble {bubble} at knot {knot}", "TABLE_COMMIT", (0,))


def test_tables_that_are_not_those_that_were_sent(skin):
    table = bs.build_table(bs.YeohBalloon())
    right = zlib.crc32(table.to_bytes() * 7)
    knots = np.frombuffer(table.to_bytes(), "<u2").reshape(-1, 2).tolist()
    for bubble in range(7):
        for first in range(0, len(knots), 32):
            call(skin, "TABLE_WRITE", (bubble, first, len(knots)), knots[first : first + 32])
    refused(skin, "what it received is not what was sent", "TABLE_COMMIT", (right ^ 1,))


@pytest.mark.parametrize(("fixed", "sentence"), [((7, 0), "bubble is 7"), ((0, 64), "first is 64")])
def test_reading_a_table_that_is_not_there(skin, fixed, sentence):
    refused(skin, sentence, "TABLE_READ", fixed)


@pytest.mark.parametrize("name", ["STATE_REPLY", "PING_REPLY", "TELEMETRY", "ERROR"])
def test_what_only_a_device_says(skin, name):
    message = {
        "STATE_REPLY": ((0, 0), []),
        "PING_REPLY": ((0, 0, 0), []),
        "TELEMETRY": ((0, 0), []),
        "ERROR": ((0,) * 7, []),
    }
    refused(skin, f"does not know {name}", name, *message[name])


def test_a_host_that_speaks_no_common_protocol(skin):
    transport = skin.link.transport
    newest = version.PROTOCOL_MAX
    transport.write(encode("HELLO", 999, (newest + 1, newest + 9, 1)))
    (answer,) = Reader().feed(transport.read(0.1))
    assert (answer.id, answer.sequence, answer["request"]) == (messages.ERROR, 999, messages.HELLO)
    assert (answer["error"], answer["low"], answer["high"]) == (errors.NO_COMMON_PROTOCOL, newest, newest)


def test_a_height_of_zero_is_no_mistake(skin):
    reply = call(skin, "SHOW", (0,), [(0,)] * 7)
    assert reply.id == messages.SHOW | messages.REPLY
    skin.show(np.full(7, 6.0))
