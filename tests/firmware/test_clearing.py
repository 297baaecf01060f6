"""A host that acknowledges faults all the time, at whatever pace, disarms nothing: judged by the plant's truth."""

import numpy as np
import pytest

from bubble_protocol.schema import faults, modes, settings
from bubble_protocol.version import PROTOCOL_MAX, PROTOCOL_MIN
from bubbleskin.link import message as wire
from bubbleskin.sim import SimulatedBoard

PACES = (0.0, 0.1, 0.3, 1.0)  # s between two CLEARs; 0: one in every tick
SESSION = 77
ILL = 2
SECONDS = 8.0
SHOW_TICKS = 130  # between two shapes

PRESSURE_MARGIN = 1000.0  # Pa, above the board's limit
HEIGHT_MARGIN = 0.3  # mm


class Attacked:
    """A simulated board whose host clears every `pace` seconds and asks for one shape and another; what became of it."""

    def __init__(self, pace, heights_um, budget=None):
        self.board = SimulatedBoard(contact=False)
        self.app = self.board.firmware.app
        self.key = wire.session_key(self.board.firmware.boot_id, SESSION)
        self.number = 0
        self.pace = max(1, round(pace / self.board.tick_s))
        self.pressure_pa = np.zeros(self.board.data.BUBBLES)  # greatest, true
        self.height_mm = np.zeros(self.board.data.BUBBLES)
        self.supply_pa = 0.0
        self.above_pa_s = self.most_above_pa_s = 0.0
        self.seen = 0
        self.isolated = {}  # for how many ticks: of a bubble, and of the board, -1
        self.board.to_device += wire.encode("HELLO", 0, (PROTOCOL_MIN, PROTOCOL_MAX, SESSION))
        self.board.tick()
        if budget:
            self.send("SETTING_WRITE", (), [(settings.BUDGET_KPA_S, budget)])
        self.heights_um = heights_um
        self.show(0)
        self.run(1.0, attack=False)

    def check_isolation(self):
        """What has a fault is vented in the tick that finds it, and for long enough."""
        bubbles, faulty = self.app.bubbles, self.app.faults.board & faults.VENTING
        self.seen |= bubbles.faults(ILL)
        ill = {bubble for bubble in range(bubbles.count) if bubbles.faults(bubble)} | ({-1} if faulty else set())
        for bubble in range(bubbles.count):
            if bubble in ill or faulty:
                assert tuple(bubbles.pulses[2 * bubble : 2 * bubble + 2]) == (0, self.board.data.TICK_US)
        for gone in self.isolated.keys() - ill:
            assert self.isolated.pop(gone) * self.board.data.TICK_US >= faults.ISOLATION_MS * 1000
        for one in ill:
            self.isolated[one] = self.isolated.get(one, 0) + 1

    def send(self, name, fixed=(), repeated=()):
        self.number += 1
        self.board.to_device += wire.encode(name, self.number, fixed, repeated, self.key)

    def show(self, which):
        self.send("SHOW", (0,), [(self.heights_um[which],)] * self.board.data.BUBBLES)

    def run(self, seconds, attack=True):
        board, plant = self.board, self.board.plant
        for tick in range(round(seconds / board.tick_s)):
            if not tick % 20:
                self.send("PING", (0,))
                self.number -= 1  # PING takes no number
            if attack and not tick % self.pace:
                self.send("CLEAR")
            if attack and not tick % SHOW_TICKS:
                self.show(tick // SHOW_TICKS % len(self.heights_um))
            board.tick()
            board.from_device.clear()
            self.check_isolation()
            self.pressure_pa = np.maximum(self.pressure_pa, plant.pressure_pa)
            self.height_mm = np.maximum(self.height_mm, plant.height_mm)
            self.supply_pa = max(self.supply_pa, plant.supply_pa)
            self.above_pa_s += (plant.pressure_pa[ILL] - board.data.BUDGET_FREE_PA) * board.tick_s
            self.above_pa_s = max(self.above_pa_s, 0.0)
            self.most_above_pa_s = max(self.most_above_pa_s, self.above_pa_s)


FAILURES = [
    pytest.param("pop_off", 1.0, faults.LEAK, id="leak"),
    pytest.param("vent_stuck", 1.0, faults.LEAK, id="vent open"),
    pytest.param("fill_stuck", -1.0, faults.NO_AIR, id="no_air"),
    pytest.param("fill_stuck", 1.0, faults.VALVE_STUCK, id="valve_stuck, overfilled"),
    pytest.param("vent_stuck", -1.0, faults.VALVE_STUCK, id="vent shut"),
    pytest.param("sensor_stuck", 700.0, faults.SENSOR_STUCK, id="sensor_stuck low"),
    pytest.param("sensor_stuck", 1460.0, faults.SENSOR_STUCK, id="sensor_stuck"),
    pytest.param("sensor_absent", 1.0, faults.SENSOR_LOST, id="sensor_lost"),
]


@pytest.mark.parametrize("pace", PACES)
@pytest.mark.parametrize(("failure", "value", "fault"), FAILURES)
def test_clearing_at_any_pace_keeps_true_pressure_and_height_within_their_limits(failure, value, fault, pace):
    attacked = Attacked(pace, (9000, 14000))
    attacked.board.inject(failure, ILL, value)
    attacked.run(SECONDS)
    limits = attacked.board.data
    assert attacked.seen & fault
    assert attacked.pressure_pa.max() <= limits.PRESSURE_MAX_PA + PRESSURE_MARGIN
    assert attacked.height_mm.max() <= limits.HEIGHT_MAX_UM * 1e-3 + HEIGHT_MARGIN
    assert attacked.supply_pa <= limits.SUPPLY_MAX_PA
    assert attacked.app.stats.exceptions == 0


@pytest.mark.parametrize("pace", PACES)
def test_clearing_at_any_pace_leaves_the_budget_what_it_is(pace):
    attacked = Attacked(pace, (13000,), budget=10)
    attacked.run(SECONDS)
    assert attacked.seen & faults.BUDGET
    assert attacked.most_above_pa_s <= 11000, "its vent takes 0.1 s to bring it below the threshold"


@pytest.mark.parametrize("pace", PACES)
def test_a_fill_valve_stuck_open_is_overfilled_at_any_pace(pace):
    attacked = Attacked(pace, (10000,))
    attacked.board.inject("fill_stuck", ILL, 1.0)
    attacked.run(1.0)
    assert attacked.app.faults.board == faults.OVERFILLED
    assert attacked.app.safety.mode == modes.FAULTED
