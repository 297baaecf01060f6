"""A simulated board, whatever a host or the world does to it, and the promises of docs/safety.md checked in every tick.

What judges knows the plant's truth, what the valves are told, and numbers of docs/safety.md written down once more here. Of the
firmware it believes only which faults it tells.
"""

from functools import partial

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, seed, settings
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
STUCK_LIMIT_MM, STUCK_FOR_S = 15.6, 1.6
"""Of a bubble whose fill valve sticks open as it gets there, and for how long it may be above the limit at a stretch."""
RESERVOIR_LIMIT_PA = 76_000.0
"""Where the dump valve opens, and a kilopascal."""
RELIEF_LIMIT_PA = 81_000.0
"""What the relief valve holds, where the reservoir's sensor lies in a way that no one can see."""
VENT_AFTER_S = 1.0
"""Without a valid frame."""
FILL_AT_MOST_S = 1.0
"""A fill valve at a stretch."""
ISOLATED_AT_LEAST_S = 1.0
PING_S = 0.1
BUDGET = 128  # a fault of nobody: it is used up
ESTOP = 1
CLEAR_TICKS = 3
"""Within which a CLEAR has been handled, and faults that came up before that are acknowledged."""
SESSION = 4711


INJECTION, ON_REQUEST = 0, range(1, 9)
"""What INJECT makes fail, and the permission for it."""
OF_THE_SENSOR, OF_THE_SUPPLY = (1, 2, 3), (6, 7, 8)

SUBTLE = ("supply_bias", "supply_flat")


class BrokenPromiseError(AssertionError):
    """A promise of docs/safety.md that was not kept."""


class World:
    """A board, its host and its failures; `run` lets time pass and judges every tick: `World.Broken` where a promise is."""

    Broken = BrokenPromiseError
    promises = (
        "pressure", "height", "reservoir", "silence", "emergency stop", "on-time", "isolation", "latching", "only the ill",
    )  # fmt: skip

    def __init__(self, board="wristband7", *, seed=0, contact=False, spread=0.0, host=None):
        self.board = SimulatedBoard(board, seed=seed, contact=contact, spread=spread)
        self.alone = not contact
        self.matched = not spread
        self.host = host or (lambda firmware: None)
        self.failing = {}  # value by (failure, bubble)
        self.asked_for = set()  # (number of the failure, bubble), by INJECT
        self.ill = set()  # bubbles that ever were: a sensor that was off leaves wrong estimates
        self.telling = True
        self.pressed = False
        self.silent_s = 0.0
        self.fill_s = np.zeros(self.bubbles)
        self.isolated_s = np.zeros(self.bubbles)
        self.supply_is_ill = self.supply_lies = self.fill_sticks = False
        self.lost = np.zeros(self.bubbles, bool)
        self.high_s = 0.0
        self.cut_power(first=True)

    @property
    def bubbles(self):
        return self.board.data.BUBBLES

    # What the host does.

    def send(self, name, fixed=(), repeated=()):
        """A request in its turn, while the host tells anything at all."""
        if self.telling:
            self.number += 1
            self.board.to_device += wire.encode(name, self.number, fixed, repeated, self.key)

    def show(self, heights_um, ramp_ms):
        self.send("SHOW", (ramp_ms,), [(int(height),) for height in heights_um])

    def clear(self):
        self.send("CLEAR")
        if self.telling:
            self.clearing = CLEAR_TICKS

    def ask_for(self, failure, bubble):
        """The firmware is to make a part of itself fail: it is ill, whether that was permitted or not."""
        self.send("INJECT", (failure, bubble, 1))
        self.asked_for.add((failure, bubble))
        self.lost[bubble] |= self.is_lost(bubble)
        self.ill.add(bubble)
        self.supply_is_ill |= failure in OF_THE_SUPPLY

    def fall_silent(self):
        self.telling = False

    def speak(self):
        self.telling = True

    # What happens to the board.

    def inject(self, failure, bubble, value):
        self.failing[failure, bubble] = value
        self.lost[bubble] |= self.is_lost(bubble)
        self.ill.add(bubble)
        self.fill_sticks |= failure == "fill_stuck" and value > 0.0
        self.board.inject(failure, bubble, value)

    def inject_supply(self, failure, value):
        self.failing[failure, 0] = value
        self.supply_is_ill = True
        self.supply_lies |= failure in SUBTLE
        self.board.inject(failure, 0, value)

    def mend(self):
        """Whatever fails; a bubble that was ill may be taken for ill for the rest of the time."""
        for failure, bubble in self.failing:
            self.board.inject(failure, bubble, 0.0)
        self.failing.clear()

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
        self.asked_for.clear()
        self.faults = (0,) * self.bubbles
        self.unacknowledged = set()  # bubbles with a fault of which nobody has heard
        self.clearing = 0
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
        pressure_pa = np.where(self.lost, 0.0, plant.pressure_pa)
        self.require(
            pressure_pa.max() <= PRESSURE_LIMIT_PA + PRESSURE_MARGIN_PA,
            "pressure",
            f"{pressure_pa.max() / 1e3:.1f} kPa in bubble {int(pressure_pa.argmax())}",
        )
        if self.alone and self.matched:
            self.judge_height(np.where(self.lost, 0.0, plant.height_mm))
        most = RELIEF_LIMIT_PA if self.supply_lies else RESERVOIR_LIMIT_PA
        self.require(plant.supply_pa <= most, "reservoir", f"{plant.supply_pa / 1e3:.1f} kPa")
        vented = (decided[:, 0] == 0.0) & (decided[:, 1] >= board.tick_s)
        if self.silent_s > VENT_AFTER_S + board.tick_s:
            self.require(vented.all(), "silence", f"silent for {self.silent_s:.2f} s, not vented")
        if self.pressed:
            self.require(vented.all(), "emergency stop", "pressed, not vented")
        self.fill_s = np.where(acting[:, 0] >= board.tick_s - 1e-9, self.fill_s + board.tick_s, 0.0)
        self.require(
            self.fill_s.max() <= FILL_AT_MOST_S + 2 * board.tick_s, "on-time", f"open for {self.fill_s.max():.2f} s"
        )
        self.judge_faults(told, vented)

    def is_lost(self, bubble):
        """Whether air comes in, none goes out, and the sensor does not see it: with three parts failed nothing is promised."""
        failing = self.failing
        comes_in = failing.get(("fill_stuck", bubble), 0.0) > 0.0
        stays_in = failing.get(("vent_stuck", bubble), 0.0) < 0.0
        blind = ("sensor_stuck", bubble) in failing or ("sensor_absent", bubble) in failing
        return comes_in and stays_in and (blind or any((number, bubble) in self.asked_for for number in OF_THE_SENSOR))

    def judge_height(self, height_mm):
        """True heights of bubbles that nobody lifts, on rubber as the tables have it."""
        most = HEIGHT_LIMIT_MM + HEIGHT_MARGIN_MM
        self.high_s = self.high_s + self.board.tick_s if height_mm.max() > most else 0.0
        self.require(
            height_mm.max() <= (STUCK_LIMIT_MM if self.fill_sticks else most),
            "height",
            f"{height_mm.max():.2f} mm in bubble {int(height_mm.argmax())}",
        )
        self.require(self.high_s <= STUCK_FOR_S, "height", f"{height_mm.max():.2f} mm for {self.high_s:.2f} s")

    def judge_faults(self, told, vented):
        """What the firmware tells of each bubble's faults, and whether its valves are set to empty it."""
        if self.clearing:
            self.clearing -= 1
            self.unacknowledged.clear()
        for bubble, (was, is_now) in enumerate(zip(self.faults, told, strict=True)):
            if was & ~is_now:
                self.require(
                    bubble not in self.unacknowledged, "latching", f"fault {was} of bubble {bubble} is gone by itself"
                )
                self.require(
                    self.isolated_s[bubble] >= ISOLATED_AT_LEAST_S - 1e-6,
                    "isolation",
                    f"bubble {bubble} was isolated for {self.isolated_s[bubble]:.2f} s",
                )
            if is_now & ~was and not self.clearing:
                self.unacknowledged.add(bubble)
            if is_now:
                self.require(vented[bubble], "isolation", f"bubble {bubble} has fault {is_now} and is not vented")
            self.isolated_s[bubble] = self.isolated_s[bubble] + self.board.tick_s if is_now else 0.0
            if self.alone and self.matched and bubble not in self.ill and not self.supply_is_ill:
                self.require(not is_now & ~BUDGET, "only the ill", f"bubble {bubble} is well and has fault {is_now}")
        self.faults = told

    def require(self, kept, promise, what):
        assert promise in self.promises
        if not kept:
            raise BrokenPromiseError(f"{promise}: {what}, {self.board.time:.3f} s after the start")


# What a host or the world may do.

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
SUPPLY_FAILURES = (
    ("supply_stuck", 2160.0),
    ("supply_stuck", 2560.0),
    ("supply_absent", 1.0),
    ("supply_bias", -8e3),
    ("supply_flat", 55e3),
)
_heights = st.sampled_from([4000, 5500, 8000, 11000, 12500, 13500, 14000])
_nonsense = st.sampled_from([14001, 20000, 65535])
_durations = st.sampled_from([0.005, 0.02, 0.1, 0.3, 0.7, 1.1, 2.0])


class Promises(RuleBasedStateMachine):
    """Anything a host or the world may do, in any order."""

    make = None  # a world

    @initialize(
        board=st.sampled_from(["wristband7", "wristband7", "wristband7", "wristband19"]),
        seed=st.integers(0, 1000),
        world=st.sampled_from([(False, 0.0), (False, 0.0), (True, 0.0), (False, 0.05)]),
    )
    def boot(self, board, seed, world):
        contact, spread = world
        self.world = self.make(board, seed=seed, contact=contact, spread=spread)

    @rule(data=st.data(), ramp_ms=st.sampled_from([0, 0, 30, 500]), duration=_durations)
    def show(self, data, ramp_ms, duration):
        n = self.world.bubbles
        heights = data.draw(_heights.map(lambda h: [h] * n) | st.lists(_heights, min_size=n, max_size=n))
        self.world.speak()
        self.world.show(heights, ramp_ms)
        self.world.run(duration)

    @rule(duration=_durations)
    def stop(self, duration):
        self.world.send("STOP")
        self.world.run(duration)

    @rule(duration=_durations)
    def vent(self, duration):
        self.world.send("VENT")
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

    @rule(failure=st.sampled_from(SUPPLY_FAILURES), duration=_durations)
    def fail_supply(self, failure, duration):
        self.world.inject_supply(*failure)
        self.world.run(duration)

    @rule(permitted=st.sampled_from([1, 1, 1, 0]), duration=st.sampled_from([0.02, 0.3]))
    def permit_failures(self, permitted, duration):
        self.world.send("VENT")  # or it is refused
        self.world.send("INJECT", (INJECTION, 0, permitted))
        self.world.run(duration)

    @rule(failure=st.sampled_from(ON_REQUEST), bubble=st.integers(0, 6), duration=_durations)
    def fail_on_request(self, failure, bubble, duration):
        self.world.ask_for(failure, bubble)
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


def look_at(scenarios, spoil=None, phases=tuple(Phase), share=0):
    """At so many scenarios, others for every `share`; `spoil` takes a rule out of the firmware after each boot."""
    machine = type("Scenario", (Promises,), {"make": staticmethod(partial(World, host=spoil))})
    run_state_machine_as_test(
        seed(share)(machine),
        settings=settings(
            max_examples=scenarios,
            stateful_step_count=STEPS,
            deadline=None,
            phases=phases,
            suppress_health_check=list(HealthCheck),
        ),
    )


@pytest.fixture(scope="session")
def world():
    """The class."""
    return World


@pytest.fixture(scope="session")
def look():
    """See `look_at`."""
    return look_at
