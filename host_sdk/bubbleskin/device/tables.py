"""The tables of a wristband, height to pressure: sent to it knot by knot, taken over as a whole, and read back."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bubble_protocol.schema import messages
from bubbleskin.checks import instance
from bubbleskin.device.info import Info
from bubbleskin.errors import DeviceRefused, InvalidInput
from bubbleskin.link.framing import crc32
from bubbleskin.link.link import Call, Link
from bubbleskin.link.upload import upload as send

if TYPE_CHECKING:  # the membrane loads scipy, for which a script that only shows heights need not wait
    from bubbleskin.membrane.calibration import Calibration
    from bubbleskin.membrane.table import Table

CHECKED_FROM_MM = 6.0
"""Below, near rest, pressure rises steeply: a wall that is a little thicker changes the share a lot."""
BENT_MOST = 2.5
"""Of a table's pressures, as shares of the nominal bubble's, the greatest to the least: Ecoflex 00-30 has 2.3."""
APART_MOST = 1.5
"""Of one bubble's pressure to the middle one's: walls that differ by a fifth do not make it."""


def one_per_bubble(tables: "Sequence[Table] | Table | Calibration", info: Info) -> "list[Table]":
    """A table for each bubble of this device. `InvalidInput` where there are more or fewer, or they are another board's."""
    from bubbleskin.membrane.calibration import Calibration
    from bubbleskin.membrane.table import Table

    if isinstance(tables, Calibration):
        if tables.board != info.board:
            raise InvalidInput(f"The calibration is of a {tables.board}; this is a {info.board}.")
        tables = tables.tables
    count = len(tables) if isinstance(tables, Sequence) and not isinstance(tables, str) else None
    if count not in (None, info.bubbles):
        raise InvalidInput(f"{count} tables for {info.bubbles} bubbles: give one per bubble, or one for all.")
    each: list[Table] = [tables] * info.bubbles if count is None else list(tables)  # type: ignore[list-item, arg-type]
    for table in each:
        instance(
            "tables", table, Table, "a Table, one per bubble, or a Calibration; of a balloon: build_table(balloon)"
        )
    return each


def check(tables: "Sequence[Table]", info: Info) -> None:
    """`InvalidInput` where tables are none of rubber, or contradict each other: air is reckoned and height is taken from them.

    Compared from 6 mm to the board's greatest height with the bubble of the paper. The device bounds what it can know, pressure
    and air; whether a shape is a bubble's it cannot.
    """
    from bubbleskin.membrane.balloon import YeohBalloon

    heights_mm = np.arange(CHECKED_FROM_MM, info.height_max_mm + 0.25, 0.5)
    nominal = YeohBalloon()
    usual = np.array([nominal.pressure_at_height(height * 1e-3) for height in heights_mm])
    shares = np.array([table.pressure_at(heights_mm * 1e3) for table in tables]) / usual
    for bubble, share in enumerate(shares):
        low, high = int(share.argmin()), int(share.argmax())
        if share[high] > BENT_MOST * share[low]:
            raise InvalidInput(
                f"The table of bubble {bubble} is not one of rubber: of the nominal bubble's pressure it has {share[low]:.2f} at "
                f"{heights_mm[low]:g} mm and {share[high]:.2f} at {heights_mm[high]:g} mm; they differ by at most a factor "
                f"of {BENT_MOST:g} for known materials. Make it with `build_table` or from measurements; anyway=True "
                "(--anyway) uploads it."
            )
    middle = np.median(shares, axis=0)
    apart = np.maximum(shares / middle, middle / shares)
    bubble, at = np.unravel_index(apart.argmax(), apart.shape)
    if apart[bubble, at] > APART_MOST:
        raise InvalidInput(
            f"The tables contradict each other: bubble {bubble} has {shares[bubble, at] * usual[at] / 1e3:.1f} kPa at "
            f"{heights_mm[at]:g} mm and the middle one {middle[at] * usual[at] / 1e3:.1f} kPa; bubbles of one sheet are within a "
            f"factor of {APART_MOST:g}. Measure the sheet again; anyway=True (--anyway) uploads them."
        )


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
