"""The firmware evaluates tables to the same bit as the host, in CPython and in a real MicroPython."""

import numpy as np
import pytest

from bubble_firmware.control import table as firmware
from bubbleskin.membrane import Calibration, Table, YeohBalloon, build_table


def tables() -> list[Table]:
    rng = np.random.default_rng(5)
    random = []
    for knots in (2, 3, 17, 64):
        height = np.sort(rng.choice(np.arange(4000, 16000), knots, replace=False))
        random.append(Table(height, rng.integers(0, 65536, knots)))
    extreme = Table([0, 32767, 65535], [65535, 0, 65535])
    return [build_table(YeohBalloon(mu=mu)) for mu in (15e3, 39.62e3, 79.24e3)] + random + [extreme]


def probes(table: Table) -> np.ndarray:
    """Every height near a knot, ends and beyond, and many between."""
    near = (table.height_um[:, None] + np.arange(-3, 4)).ravel()
    between = np.random.default_rng(1).integers(0, 65536, 2000)
    return np.unique(np.clip(np.concatenate([near, between, [0, 65535]]), 0, 65535))


@pytest.mark.parametrize("table", tables(), ids=lambda table: f"{len(table)} knots")
def test_cpython(table):
    packed = bytearray(b"\xee" * 8 + table.to_bytes())  # not the first table of the set
    h = probes(table)
    found = [firmware.pressure_at(packed, 2, len(table), height) for height in h.tolist()]
    assert found == table.pressure_at(h).tolist()


def test_micropython(micropython):
    lines, expected = [], []
    for table in tables():
        h = probes(table)[::3]
        lines.append(f"{table.to_bytes().hex()} {' '.join(map(str, h))}")
        expected.append(" ".join(map(str, table.pressure_at(h).tolist())))
    said = micropython(
        """
        from bubble_firmware.control.table import pressure_at
        import sys
        while True:
            line = sys.stdin.readline()
            if not line.strip():
                break
            cells = line.split()
            knots = bytearray(b"\\xee" * 8 + bytes.fromhex(cells[0]))
            size = len(cells[0]) // 8
            print(*[pressure_at(knots, 2, size, int(h)) for h in cells[1:]])
        """,
        "\n".join(lines) + "\n",
    )
    assert said.split("\n")[:-1] == expected


def test_checksum_of_all_tables_is_the_one_in_the_file():
    calibration = Calibration.build("wristband7", [YeohBalloon(mu=m * 1e3) for m in range(36, 43)], source="")
    mine = firmware.Tables(7)
    for bubble, table in enumerate(calibration.tables):
        mine.write_size(bubble, len(table))
        knots = zip(table.height_um.tolist(), table.pressure_pa.tolist(), strict=True)
        for index, (height, pressure) in enumerate(knots):
            mine.write_knot(bubble, index, height, pressure)
    assert mine.received_crc() & 0xFFFFFFFF == calibration.crc32
