"""The cycle bench's control half in small: the law at fixed point and in floats, on the emulated chip."""

import math

import pytest

from bubbleskin.toolchain.frozen import BARE

pytestmark = pytest.mark.chip

SMALL = 0.4
"""Of the full phases: 72 ticks, 360 ms, which is longer than a board whose host is silent keeps moving (250 ms)."""


def test_the_control_half_in_small(uf2):
    """The bench refuses to give figures where the chip's pulses are not the simulator's, or the law in floats is another.

    Where the recorded trace has no host, its board closes its valves after 250 ms, in the 50th tick, and the law in floats,
    which knows no closed valves, refuses that tick.
    """
    from bubbleskin.bench.rp2040 import control_rows

    uf2(BARE)  # built, or the test is skipped
    rows = list(control_rows("wristband7", SMALL))
    assert len(rows) == 4 * 3 + 1
    assert all(math.isfinite(row.value) and row.value > 0 for row in rows)
    assert rows[-1].value >= 95  # % of the pulses of both laws
