"""The tables of a wristband, height to pressure: sent to it knot by knot, taken over as a whole, and read back."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bubble_protocol.schema import messages
from bubbleskin.device.info import Info
from bubbleskin.errors import DeviceRefused, InvalidInput
from bubbleskin.link.framing import crc32
from bubbleskin.link.link import Call, Link
from bubbleskin.link.upload import upload as send

if TYPE_CHECKING:  # the membrane loads scipy, for which a script that only shows heights need not wait
    from bubbleskin.membrane.calibration import Calibration
    from bubbleskin.membrane.table import Table


def one_per_bubble(tables: "Sequence[Table] | Table | Calibration", info: Info) -> "list[Table]":
    """A table for each bubble of this device. `InvalidInput` where there are more or fewer, or they are another board's."""
    from bubbleskin.membrane.calibration import Calibration

    if isinstance(tables, Calibration):
        if tables.board != info.board:
            raise InvalidInput(f"The calibration is of a {tables.board}; this is a {info.board}.")
        tables = tables.tables
    each = list(tables) if isinstance(tables, Sequence) else [tables] * info.bubbles
    if len(each) != info.bubbles:
        raise InvalidInput(f"{len(each)} tables for {info.bubbles} bubbles: give one per bubble, or one for all.")
    return each


async def upload(link: Link, tables: "Sequence[Table]") -> None:
    """Send a table for each bubble and let the device use them: all of them, or those it had."""
    data = [table.to_bytes() for table in tables]
    await send(link, (call for bubble, table in enumerate(data) for call in _writes(bubble, table)))
    crc = crc32(b"".join(data))
    reply = await link.call("TABLE_COMMIT", (crc,))
    if reply["tables_crc"] != crc:
        raise DeviceRefused("The wristband uses other tables than were sent. Upload them again.")


def _writes(bubble: int, table: bytes) -> list[Call]:
    knots = np.frombuffer(table, "<u2").reshape(-1, 2).tolist()
    return [
        ("TABLE_WRITE", (bubble, first, len(knots)), knots[first : first + messages.KNOTS_PER_MESSAGE])
        for first in range(0, len(knots), messages.KNOTS_PER_MESSAGE)
    ]


async def read(link: Link, bubbles: int) -> "list[Table]":
    """The tables in use, one per bubble."""
    return [await _read_one(link, bubble) for bubble in range(bubbles)]


async def _read_one(link: Link, bubble: int) -> "Table":
    from bubbleskin.membrane.table import Table

    knots: list[list[int]] = []
    total = 1
    while len(knots) < total:
        part = await link.call("TABLE_READ", (bubble, len(knots)))
        total = part["total"]
        knots += np.column_stack([part.columns["knot_um"], part.columns["knot_pa"]]).tolist()
    return Table(*np.array(knots).T)
