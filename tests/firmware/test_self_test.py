"""The self-test at boot: what it finds of sensors and valves, and what ends it."""

import pytest

from bubble_firmware.app import App
from bubble_protocol.schema import faults
from bubble_protocol.schema.modes import ACTIVE, BOOT, IDLE
from bubble_protocol.schema.self_test import FAILED, PASSED, RUNNING, SKIPPED

ILL = 2
FILLED_PA, OFF_PA = 5000, 2000


class Booting:
    """A rig that boots with valves and sensors to test; the ill bubble has one failure, `ill`."""

    def __init__(self, rig, ill=None, supply_pa=60_000):
        self.rig, self.ill = rig, ill
        rig.hal.self_test = True
        rig.hal.counts[-1] = rig.board.SUPPLY_ZERO + supply_pa // rig.board.SUPPLY_PA_PER_COUNT
        rig.app = App(rig.board, rig.hal)
        rig.open(7)
        self.filled_us = [0] * rig.board.BUBBLES
        if ill == "zero":
            rig.sense(ILL, OFF_PA)

    def run(self, seconds):
        rig = self.rig
        for _ in range(round(seconds * 1_000_000) // rig.board.TICK_US):
            rig.tick()
            for bubble in range(rig.board.BUBBLES):
                fill, vent = rig.pulse(bubble) if rig.hal.pulses else (0, rig.board.TICK_US)
                self.filled_us[bubble] += fill
                ill = self.ill if bubble == ILL else None
                if ill == "zero":
                    continue
                if fill and ill != "unfilled":
                    rig.sense(bubble, FILLED_PA)
                elif vent and ill != "unvented":
                    rig.sense(bubble, 0)

    @property
    def found(self):
        test = self.rig.app.self_test
        return test.outcome, test.untrue_zero, test.unfilled, test.unvented


def test_a_board_on_which_all_is_well_passes_and_is_idle(rig):
    booting = Booting(rig)
    assert (rig.app.safety.mode, rig.app.self_test.outcome) == (BOOT, RUNNING)
    booting.run(1.0)
    assert booting.found == (PASSED, 0, 0, 0)
    assert booting.filled_us == [3000] * rig.board.BUBBLES, "one short pulse each"
    assert (rig.app.safety.mode, rig.app.faults.board) == (IDLE, 0)


@pytest.mark.parametrize(
    ("ill", "bits"), [("zero", (1 << ILL, 0, 0)), ("unfilled", (0, 1 << ILL, 0)), ("unvented", (0, 0, 1 << ILL))]
)
def test_what_is_ill_is_named_and_only_that(rig, ill, bits):
    booting = Booting(rig, ill)
    booting.run(1.0)
    assert booting.found == (FAILED, *bits)
    assert rig.app.faults.board == faults.SELF_TEST
    assert rig.app.safety.mode == IDLE, "it is told; it forbids nothing"
    assert booting.filled_us[ILL] == (0 if ill == "zero" else 3000), "no air where nobody sees it"


def test_without_a_supply_it_ends_and_gives_no_air(rig):
    booting = Booting(rig, supply_pa=20_000)
    booting.run(1.8)
    assert booting.found == (SKIPPED, 0, 0, 0)
    assert booting.filled_us == [0] * rig.board.BUBBLES


def test_a_show_ends_it(rig):
    booting = Booting(rig)
    booting.run(0.02)
    rig.show(9000)
    assert booting.found == (SKIPPED, 0, 0, 0)
    assert rig.app.safety.mode == ACTIVE
