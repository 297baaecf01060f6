"""The firmware has the tables of a calibration as the host has them."""

from bubble_firmware.control import table as firmware
from bubbleskin.membrane import Calibration, YeohBalloon


def test_checksum_of_all_tables_is_the_one_in_the_file():
    calibration = Calibration.build("wristband7", [YeohBalloon(mu=m * 1e3) for m in range(36, 43)], source="")
    mine = firmware.Tables(7)
    for bubble, table in enumerate(calibration.tables):
        mine.write_size(bubble, len(table))
        knots = zip(table.height_um.tolist(), table.pressure_pa.tolist(), strict=True)
        for index, (height, pressure) in enumerate(knots):
            mine.write_knot(bubble, index, height, pressure)
    mine.check_received()
    assert mine.received_crc[0] & 0xFFFFFFFF == calibration.crc32
