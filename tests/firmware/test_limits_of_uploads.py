"""What an upload may claim of a bubble: tables and trims beyond what the board's file allows are refused, by the device."""

import zlib

import numpy as np
import pytest

from bubble_firmware.control.nominal import KNOTS
from bubble_firmware.control.table import pressure_top
from bubble_protocol.schema import errors, messages
from bubbleskin.membrane.balloon import ATMOSPHERE
from bubbleskin.sim import SimulatedBoard

TRUE_MAX_MM = 15.7
"""True height of a bubble by itself that no accepted table and trim exceed on nominal rubber: what 42 kPa, and 1.5 kPa that
its sensor's zero may be off, do to it."""


def commit(rig, bubble, table):
    tables = [table if other == bubble else list(KNOTS) for other in range(rig.board.BUBBLES)]
    rig.write_table(bubble, table)
    return rig.ask("TABLE_COMMIT", (zlib.crc32(b"".join(np.array(one, "<u2").tobytes() for one in tables)),))


@pytest.mark.promise("uploads-raise-no-limit")
def test_the_air_of_a_table_is_the_boards_and_no_upload_raises_it(rig):
    board = rig.board
    top = pressure_top(board)
    volume = np.pi / 6 * (board.HEIGHT_MAX_UM * 1e-3) ** 3 + board.DEAD_VOLUME_MM3
    assert (top + ATMOSPHERE) * volume * 1e-3 == pytest.approx(board.AIR_MAX_UJ, rel=0.005)
    for table, knot in (
        ([(5000, 0), (14000, 42000)], 1),
        ([(5000, 0), (14000, top + 1)], 1),
        ([(5000, 0), (13000, top), (15000, top + 2)], 2),
    ):
        bubble = board.BUBBLES - 1
        answer = commit(rig, bubble, table)
        assert (answer.id, answer["error"]) == (messages.ERROR, errors.BAD_TABLE), table
        assert (answer["element"], answer["asked"], answer["low"]) == (bubble, knot, top)
        rig.write_table(bubble, KNOTS)
    assert commit(rig, 0, [(5000, 0), (14000, top), (16000, board.PRESSURE_MAX_PA)]).id == (
        messages.TABLE_COMMIT | messages.REPLY
    )


@pytest.mark.promise("uploads-raise-no-limit", "trim-limits")
@pytest.mark.parametrize("share", [0.25, 0.7, 1.4, 4.0])
def test_a_flow_that_no_restrictor_of_the_board_has_is_refused(rig, share):
    trim = rig.app.trim
    rows = [tuple(trim.nominal[:4])] * rig.board.BUBBLES
    rows[-1] = (*trim.nominal[:3], round(trim.nominal[3] * share))
    error, field, element, asked, low, high = rig.refused("TRIM_WRITE", (), rows)
    assert (error, field, element, asked) == (errors.OUT_OF_RANGE, 3, rig.board.BUBBLES - 1, rows[-1][3])
    assert low == trim.nominal[3] * 3 // 4
    assert high == trim.nominal[3] * 4 // 3


@pytest.mark.promise("height-any-upload")
@pytest.mark.medium
@pytest.mark.parametrize("top", [0, 1])
@pytest.mark.parametrize("gain", [0, 1, 2])
@pytest.mark.parametrize("zero", [0, 1])
def test_no_accepted_upload_makes_a_bubble_higher_than_its_pressure_limit_does(top, gain, zero, record_property):
    """The worst of what is accepted, all at once, on rubber that is none of it."""
    board = SimulatedBoard(contact=False)
    app = board.firmware.app
    data = board.data
    table = [(5000, 0), (14000, pressure_top(data))] if top else KNOTS
    for bubble in range(data.BUBBLES):
        app.tables.write_size(bubble, len(table))
        for knot, (height, pressure) in enumerate(table):
            app.tables.write_knot(bubble, knot, height, pressure)
        app.bubbles.set_trim(bubble, 0, app.trim.high[0] if zero else data.SENSOR_ZERO)
        for place in (3, 6):
            app.bubbles.set_trim(bubble, place, (app.trim.nominal, app.trim.low, app.trim.high)[gain][place])
    assert app.tables.first_flaw(data) < 0
    app.tables.swap()
    app.bubbles.use_tables()
    board.tick()
    heights = app.server.reply.values
    for bubble in range(data.BUBBLES):
        heights[bubble] = data.HEIGHT_MAX_UM
    highest = 0.0
    for over_ms in (0, 2000):
        app.commands.show(heights, 0, over_ms)
        for _ in range(round(4.0 / board.tick_s)):
            app.deadman.host_activity()
            board.tick()
            highest = max(highest, board.height_mm.max())
    record_property(f"true height, mm (at most {TRUE_MAX_MM:g})", highest)
    assert highest <= TRUE_MAX_MM
    if not (top or gain or zero):
        assert highest <= data.HEIGHT_MAX_UM * 1e-3 + 0.05
