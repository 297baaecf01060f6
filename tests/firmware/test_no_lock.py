"""Whatever control believes, it looks at the bubble again: no state of a healthy bubble keeps itself up.

Everything that is estimated is overwritten with numbers at random, most of them absurd, while the bubbles do anything at all.
"""

from array import array

import numpy as np
import pytest

import bubble_firmware.control.state_layout as layout
from bubbleskin import boards
from bubbleskin.sim.board import SimulatedBoard
from bubbleskin.sim.firmware import InProcessFirmware

WITHIN_S = 2.0
SHEETS = ("paper", "stiff25", "stiff50", "ecoflex-00-30")


class Scrambled:
    """A board of real rubber somewhere between two shapes, whose estimates are nonsense from now on."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        self.firmware = InProcessFirmware(boards.load("wristband7"), 1)
        self.board = SimulatedBoard(
            "wristband7",
            seed=seed,
            contact=False,
            firmware=self.firmware,
            rubber="real",
            sheet=SHEETS[seed % len(SHEETS)],
            spread=0.1 * rng.integers(0, 2),
        )
        bubbles = self.firmware.app.bubbles
        n = bubbles.count
        words = np.frombuffer(bubbles.state, np.int32)
        self.tick_number = words[layout.TICK : layout.TICK + 1]
        self.rows = words[layout.ROWS :][: n * layout.ROW_WORDS].reshape(n, layout.ROW_WORDS)
        self.run(0.1)
        self.firmware.app.commands.show(array("i", rng.integers(5500, 13000, n).tolist()), 0, 1)
        self.run(rng.uniform(0.05, 1.0))
        first, last = self.rows[:, layout.FIRST_SEGMENT], self.rows[:, layout.LAST_SEGMENT]
        stride = 4 * layout.KNOT_WORDS
        for name, values in {
            "AIR": rng.integers(0, 300_000, n),
            "AIR_SD": np.exp(rng.uniform(np.log(100), np.log(60_000), n)),
            "HEIGHT_SEGMENT": first + stride * rng.integers(0, (last - first) // stride + 1),
            "CURVE_ERROR": rng.integers(-20_000, 20_000, n),
            "CURVE_ERROR_SD": rng.integers(300, 26_000, n),
            "CORRELATION": rng.integers(-4000, 4000, n),
            "PRESSURE_RATIO": rng.integers(-1500, 3000, n),
        }.items():
            self.rows[:, getattr(layout, name)] = values

    def run(self, seconds):
        for _ in range(round(seconds / self.board.tick_s)):
            self.firmware.app.deadman.host_activity()
            self.board.tick()

    def looked_at(self, since):
        """Whether each has been compared with its curve, or found empty or ill."""
        word = {name: self.rows[:, getattr(layout, name)] for name in ("REFERENCE_TICK", "EMPTY_TICKS", "FAULTS")}
        empty = word["EMPTY_TICKS"] * self.board.data.TICK_US >= layout.EMPTY_US
        return (word["REFERENCE_TICK"] > since) | empty | (word["FAULTS"] > 0)


def look(seed):
    scrambled = Scrambled(seed)
    since = int(scrambled.tick_number[0])
    seen = np.zeros(len(scrambled.rows), bool)
    for _ in range(round(WITHIN_S / scrambled.board.tick_s)):
        scrambled.run(scrambled.board.tick_s)
        seen |= scrambled.looked_at(since)
    assert seen.all(), f"bubbles {np.flatnonzero(~seen)} of {seed}"
    assert scrambled.firmware.app.stats.exceptions == 0


@pytest.mark.parametrize("seed", range(8))
def test_whatever_is_believed_is_looked_at_again(seed):
    look(seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8, 200, 24))
def test_whatever_is_believed_is_looked_at_again_often(seed):
    for more in range(24):
        look(seed + more)
