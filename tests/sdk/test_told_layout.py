"""Where a device's bubbles are: told by it, known by its board's name for older firmware, or said by the user."""

import numpy as np
import pytest

import bubbleskin as bs
from bubble_protocol.schema import messages
from bubble_protocol.schema.system import CAN_TELL_LAYOUT, DELIVERY, SAFETY
from bubbleskin.async_skin import AsyncSkin
from bubbleskin.link.link import run_sync
from bubbleskin.link.message import encode

PLACES = [(0, 0), (12000, 0), (0, 12000), (12000, 12001)]


def telling(places, pitch_um=12000, board=b"pad4", bubbles=4):
    """A device with this board that tells these places."""

    def answer(request):
        if request.id == messages.HELLO:
            name = list(board.ljust(16, b"\0"))
            capabilities = DELIVERY | SAFETY | CAN_TELL_LAYOUT
            values = (2, 2, 1, 2, 0, 1, 0, *name, bubbles, 5000, 5000, 14000, 42000, 8, capabilities, 3)
            return encode("HELLO_REPLY", request.sequence, values)
        assert request.id == messages.LAYOUT
        return encode("LAYOUT_REPLY", request.sequence, (7, pitch_um), places)

    return answer


def opened(transport, layout=None):
    return run_sync(AsyncSkin.open(transport, 2.0, layout=layout))


def test_a_device_is_believed_whatever_its_name(scripted):
    for board in (b"pad4", b"wristband7"):
        skin = opened(scripted(telling(PLACES, board=board)))
        assert skin.layout.positions_mm.tolist() == [[x / 1000, y / 1000] for x, y in PLACES]
        assert skin.layout.pitch_mm == 12
        assert skin.layout.neighbours == ((1, 2), (0, 3), (0, 3), (1, 2))


def test_a_device_that_tells_too_few_places_is_a_wrong_one(scripted):
    transport = scripted(telling(PLACES[:3]))
    with pytest.raises(bs.WrongDevice, match="pad4, which has 3 bubbles, but reports 4"):
        opened(transport)
    assert transport.closed


def test_older_firmware_is_known_by_its_boards_name(scripted, hello):
    transport = scripted(hello)
    assert opened(transport).layout == bs.Layout.hexagon(1)
    assert [request.id for request in transport.requests] == [messages.HELLO]


def test_older_firmware_of_a_board_that_nobody_knows_is_refused_and_says_what_helps(scripted, hello):
    def answer(request):
        return hello(request, board=b"pad8", bubbles=8)

    with pytest.raises(bs.WrongDevice, match=r"pad8, which is none of .* Update its firmware, or .*Layout\.from_file"):
        opened(scripted(answer))
    pad = bs.Layout.grid(2, 4, pitch_mm=12)
    assert opened(scripted(answer), layout=pad).layout is pad
    with pytest.raises(bs.InvalidInput, match="has 7 bubbles, and the device, a pad8, has 8"):
        opened(scripted(answer), layout=bs.Layout.hexagon(1))


@pytest.mark.parametrize("board", ["wristband7", "wristband19"])
def test_the_firmware_tells_its_file(board):
    with bs.connect(f"sim://{board}?contact=0") as skin:
        assert skin.layout == bs.Layout.of_board(board)
        assert np.array_equal(skin.layout.positions_mm, bs.Layout.of_board(board).positions_mm)
