"""Where a device's bubbles are: as it tells, or else as its board's name says."""

import numpy as np

from bubble_protocol.schema.system import CAN_TELL_LAYOUT
from bubbleskin import boards
from bubbleskin.errors import InvalidInput, WrongDevice
from bubbleskin.layout import Layout
from bubbleskin.link.link import Link
from bubbleskin.link.message import Message


async def find_layout(link: Link, hello: Message, given: Layout | None = None) -> Layout:
    """The layout of the device that has answered `hello`; `given`: what the user knows better.

    Firmware that is too old to tell it has a board whose name says it. Raises `WrongDevice` where it does not, or where
    there is not one place for each bubble, and `InvalidInput` for a `given` layout of another number of bubbles.
    """
    board, bubbles = hello.fields["board"], hello["bubbles"]
    if given is not None:
        if len(given) != bubbles:
            raise InvalidInput(f"The layout given has {len(given)} bubbles, and the device, a {board}, has {bubbles}.")
        return given
    if hello["capabilities"] & CAN_TELL_LAYOUT:
        layout = _layout_of(await link.call("LAYOUT"))
    elif board in boards.NAMES:
        layout = Layout.of_board(str(board))
    else:
        raise WrongDevice(
            f"The device calls itself {board}, which is none of {', '.join(boards.NAMES)}, and its firmware is too old to "
            "tell where its bubbles are. Update its firmware, or say it: connect(url, layout=Layout.from_file(path))."
        )
    if len(layout) != bubbles:
        raise WrongDevice(
            f"The device calls itself {board}, which has {len(layout)} bubbles, but reports {bubbles}. "
            "Check that the firmware on it was made for this board."
        )
    return layout


def _layout_of(reply: Message) -> Layout:
    return Layout.from_um(np.column_stack([reply.columns["x_um"], reply.columns["y_um"]]), reply["pitch_um"])
