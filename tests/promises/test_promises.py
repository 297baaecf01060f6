"""The promises of docs/safety.md against whatever comes, in any order; and each of them against a firmware that breaks it.

What judges knows the plant's truth, what the valves are told, and numbers of docs/safety.md written down once more here. Of the
firmware it believes only which faults it tells.
"""

import os

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule, run_state_machine_as_test

from bubble_protocol.version import PROTOCOL_MAX, PROTOCOL_MIN
from bubbleskin.link import message as wire
from bubbleskin.sim import SimulatedBoard

PRESSURE_LIMIT_PA = 42_000.0
PRESSURE_MARGIN_PA = 1_500.0
"""What is on its way when the limit is seen: two ticks of an open fill valve, and the sensor's noise."""
HEIGHT_LIMIT_MM = 14.0
HEIGHT_MARGIN_MM = 0.4
RESERVOIR_LIMIT_PA = 80_000.0
"""Where the relief valve opens."""
VENT_AFTER_S = 1.0
"""Without a valid frame."""
FILL_AT_MOST_S = 1.0
"""A fill valve at a stretch."""
ISOLATED_AT_LEAST_S = 1.0
PING_S = 0.1
BUDGET = 128  # a fault of nobody: it is used up
ESTOP = 1
SESSION = 4711


class BrokenPromiseError(AssertionError):
    """A promise of docs/safety.md that was not kept."""


class World:
    """A board, its host and its failures. `act` methods come from outside; `run` lets time pass and judges every tick."""

    def __init__(self, board="wristband7", *, seed=0, contact=False, spread=0.0, host=None):
        self.board = SimulatedBoard(board, seed=seed, contact=contact, spread=spread)
        self.alone = not contact
        self.matched = not spread
        self.host = host or (lambda firmware: None)
        self.injected = {}  # what is wrong with a bubble: never forgotten, a sensor that was off leaves wrong estimates
        self.telling = True
        self.pressed = False
        self.silent_s = 0.0
        self.fill_s = np.zeros(self.bubbles)
        self.isolated_s = np.zeros(self.bubbles)
        self.acknowledged = True
        self.faults = (0,) * self.bubbles
        self.cut_power(first=True)

    @property
    def bubbles(self):
        return self.board.data.BUBBLES

    # What the host does.

    def send(self, name, fixed=(), repeated=()):
        """A request in its turn, while the host tells anything at all."""
        if self.telling and self.key is not None:
            self.number += 1
            self.board.to_device += wire.encode(name, self.number, fixed, repeated, self.key)

    def show(self, heights_um, ramp_ms):
        self.send("SHOW", (ramp_ms,), [(int(height),) for height in heights_um])

    def stop(self):
        self.send("STOP")

    def vent(self):
        self.send("VENT")

    def clear(self):
        self.acknowledged = True
        self.send("CLEAR")

    def fall_silent(self):
        self.telling = False

    def speak(self):
        self.telling = True

    # What happens to the board.

    def inject(self, failure, bubble, value):
        self.injected[bubble] = failure
        self.board.inject(failure, bubble, value)

    def mend(self):
        for bubble in self.injected:
            for failure in ("leak", "pop_off", "fill_stuck", "vent_stuck", "sensor_stuck", "sensor_absent"):
                self.board.inject(failure, bubble, 0.0)

    def press(self, pressed):
        """The emergency stop."""
        self.pressed = pressed
        firmware = self.board.firmware
        firmware.active_faults = firmware.active_faults | ESTOP if pressed else firmware.active_faults & ~ESTOP

    def cut_power(self, first=False):
        """Power fails and comes back; the host opens its session anew."""
        if not first:
            self.board.reset()
        self.host(self.board.firmware.app)
        self.acknowledged = True
        self.faults = (0,) * self.bubbles
        self.isolated_s[:] = 0.0
        self.number = 0
        self.key = wire.session_key(self.board.firmware.boot_id, SESSION)
        self.board.to_device += wire.encode("HELLO", 0, (PROTOCOL_MIN, PROTOCOL_MAX, SESSION))
        self.silent_s = 0.0
        self.tick()

    # Time, and what must hold.

    def run(self, seconds):
        for _ in range(round(seconds / self.board.tick_s)):
            self.tick()

    def tick(self):
        """One period. The host pings while it speaks."""
        board = self.board
        tick_s = board.tick_s
        ticks = round(board.time / tick_s)
        if self.telling and not ticks % round(PING_S / tick_s):
            board.to_device += wire.encode("PING", 0, (0,), (), self.key)
        self.silent_s = 0.0 if board.to_device else self.silent_s + tick_s
        before = board.pulses.copy()  # they act in the period that this tick ends
        board.tick()
        board.from_device.clear()
        self.judge(before)

    def judge(self, acting):
        """Every promise, after one tick: `acting` are the seconds of fill and vent valves in the period that has passed."""
        board, plant = self.board, self.board.plant
        decided = board.pulses
        told = tuple(board.firmware.app.bubbles.faults(bubble) for bubble in range(self.bubbles))
        self.require(
            plant.pressure_pa.max() <= PRESSURE_LIMIT_PA + PRESSURE_MARGIN_PA,
            "pressure",
            f"{plant.pressure_pa.max() / 1e3:.1f} kPa in bubble {int(plant.pressure_pa.argmax())}",
        )
        if self.alone and self.matched:
            self.require(
                plant.height_mm.max() <= HEIGHT_LIMIT_MM + HEIGHT_MARGIN_MM,
                "height",
                f"{plant.height_mm.max():.2f} mm in bubble {int(plant.height_mm.argmax())}",
            )
        self.require(plant.supply_pa <= RESERVOIR_LIMIT_PA, "reservoir", f"{plant.supply_pa / 1e3:.1f} kPa")
        vented = (decided[:, 0] == 0.0) & (decided[:, 1] >= board.tick_s)
        if self.silent_s > VENT_AFTER_S + board.tick_s:
            self.require(vented.all(), "silence", f"silent for {self.silent_s:.2f} s, not vented")
        if self.pressed:
            self.require(vented.all(), "emergency stop", "pressed, not vented")
        self.fill_s = np.where(acting[:, 0] >= board.tick_s - 1e-9, self.fill_s + board.tick_s, 0.0)
        self.require(
            self.fill_s.max() <= FILL_AT_MOST_S + 2 * board.tick_s, "on-time", f"open for {self.fill_s.max():.2f} s"
        )
        for bubble, (was, is_now) in enumerate(zip(self.faults, told, strict=True)):
            if is_now:
                self.require(vented[bubble], "isolation", f"bubble {bubble} has fault {is_now} and is not vented")
                self.isolated_s[bubble] += board.tick_s
            if was & ~is_now:
                self.require(self.acknowledged, "latching", f"fault {was} of bubble {bubble} is gone by itself")
                self.require(
                    self.isolated_s[bubble] >= ISOLATED_AT_LEAST_S - 1e-6,
                    "isolation",
                    f"bubble {bubble} was isolated for {self.isolated_s[bubble]:.2f} s",
                )
            if not is_now:
                self.isolated_s[bubble] = 0.0
            if self.alone and self.matched and bubble not in self.injected:
                self.require(not is_now & ~BUDGET, "only the ill", f"bubble {bubble} is well and has fault {is_now}")
        self.faults = told

    def require(self, kept, promise, what):
        if not kept:
            raise BrokenPromiseError(f"{promise}: {what}, {self.board.time:.3f} s after the start")


SCENARIOS = int(os.environ.get("BUBBLESKIN_SCENARIOS", "400"))
"""Of the slow test: `BUBBLESKIN_SCENARIOS=20000 pytest tests/promises -m slow` for a longer look."""
FEW = 25
STEPS = 14

FAILURES = (
    ("pop_off", 1.0),
    ("leak", 3e-6),
    ("fill_stuck", 1.0),
    ("fill_stuck", -1.0),
    ("vent_stuck", 1.0),
    ("vent_stuck", -1.0),
    ("sensor_stuck", 700.0),
    ("sensor_stuck", 1460.0),
    ("sensor_absent", 1.0),
)
_heights = st.sampled_from([4000, 5500, 8000, 11000, 12500, 13500, 14000])
_nonsense = st.sampled_from([14001, 20000, 65535])
_durations = st.sampled_from([0.005, 0.02, 0.1, 0.3, 0.7, 1.1, 2.0])


class Promises(RuleBasedStateMachine):
    """Anything a host or the world may do, in any order."""

    spoil = None  # takes a rule out of the firmware after each boot

    @initialize(
        board=st.sampled_from(["wristband7", "wristband7", "wristband7", "wristband19"]),
        seed=st.integers(0, 1000),
        world=st.sampled_from([(False, 0.0), (False, 0.0), (True, 0.0), (False, 0.05)]),
    )
    def boot(self, board, seed, world):
        contact, spread = world
        self.world = World(board, seed=seed, contact=contact, spread=spread, host=self.spoil)

    @rule(data=st.data(), ramp_ms=st.sampled_from([0, 0, 30, 500]), duration=_durations)
    def show(self, data, ramp_ms, duration):
        n = self.world.bubbles
        heights = data.draw(_heights.map(lambda h: [h] * n) | st.lists(_heights, min_size=n, max_size=n))
        self.world.speak()
        self.world.show(heights, ramp_ms)
        self.world.run(duration)

    @rule(duration=_durations)
    def stop(self, duration):
        self.world.stop()
        self.world.run(duration)

    @rule(duration=_durations)
    def vent(self, duration):
        self.world.vent()
        self.world.run(duration)

    @rule(duration=_durations, pace=st.sampled_from([1, 2, 20, 60]))
    def clear(self, duration, pace):
        for tick in range(round(duration / self.world.board.tick_s)):
            if not tick % pace:
                self.world.clear()
            self.world.tick()

    @rule(failure=st.sampled_from(FAILURES), bubble=st.integers(0, 6), duration=st.sampled_from([0.3, 1.1, 2.0]))
    def fail(self, failure, bubble, duration):
        self.world.inject(failure[0], bubble, failure[1])
        self.world.run(duration)

    @rule()
    def mend(self):
        self.world.mend()

    @rule(bubble=st.integers(0, 6), height=_nonsense)
    def show_what_is_not_allowed(self, bubble, height):
        heights = [10000] * self.world.bubbles
        heights[bubble] = height
        self.world.show(heights, 0)
        self.world.run(0.1)

    @rule(duration=_durations, speaks=st.booleans())
    def silence(self, duration, speaks):
        self.world.fall_silent()
        self.world.run(duration)
        if speaks:
            self.world.speak()
            self.world.run(0.1)

    @rule(pressed=st.booleans(), duration=_durations)
    def emergency_stop(self, pressed, duration):
        self.world.press(pressed)
        self.world.run(duration)

    @rule(duration=_durations)
    def power_cut(self, duration):
        self.world.cut_power()
        self.world.run(duration)

    @rule(duration=_durations)
    def wait(self, duration):
        self.world.run(duration)

    def teardown(self):
        if hasattr(self, "world"):
            self.world.board.close()


def look(scenarios, spoil=None, phases=(Phase.explicit, Phase.reuse, Phase.generate, Phase.shrink)):
    run_state_machine_as_test(
        type("Spoiled", (Promises,), {"spoil": staticmethod(spoil)}) if spoil else Promises,
        settings=settings(
            max_examples=scenarios,
            stateful_step_count=STEPS,
            deadline=None,
            phases=phases,
            suppress_health_check=list(HealthCheck),
        ),
    )


def test_promises_are_kept():
    look(FEW)


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_promises_are_kept_for_long():
    look(SCENARIOS)


# Firmware with one rule taken out: each must be found, by the promise that it breaks.


def deaf_deadman(app):
    app.deadman.tick = lambda mode, moving: -1


def blind_monitor(app):
    app.fault_monitor.check = lambda: 0


def healing(app):
    check = app.fault_monitor.check

    def heals():
        found = check()
        for bubble in range(app.bubbles.count):
            app.bubbles.clear_faults(bubble)
        return found

    app.fault_monitor.check = heals


def no_emergency_stop(app):
    app.commands.fault = lambda board_faults: None


CONTROLS = {
    "silence": deaf_deadman,
    "pressure|height|isolation": blind_monitor,
    "latching|isolation|pressure|height": healing,
    "emergency stop": no_emergency_stop,
}


@pytest.mark.slow
@pytest.mark.parametrize("promise", CONTROLS)
def test_a_firmware_without_the_rule_is_found(promise):
    with pytest.raises(BrokenPromiseError, match=f"^({promise}): "):
        look(400, CONTROLS[promise], phases=(Phase.generate,))
