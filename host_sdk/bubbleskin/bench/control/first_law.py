# mypy: disable-error-code="no-untyped-def"
"""The law of the first release, in floats: what the present one is held against, on the same plants.

It moved its metered air towards the air that the measured pressure meant by the table: at rest a loop over pressure. Of the
pulses of that firmware and of this, 99.7 % were within 20 µs. One trim was of both valves, the pressure of the air around was
taken for that at sea level. Of its faults only the two limits of each reading are here: such a bubble is vented, and counted.
Units: µm, Pa, µJ, µs, µJ/ms.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from types import ModuleType
from typing import NamedTuple

from bubble_firmware.control.state_layout import ATMOSPHERE, DOSE_MAX, FOLLOW, READINGS_MIN

_GAIN_I = 4  # /256, of the board's file then
_DEADBAND_UM = 60
_SAMPLES_MAX = 64
_SAMPLES_DOSED = 16  # left after a short dose
_INNOVATION_UM = 500  # further off than metering ever is,
_INNOVATION_PA = 500  # by more than noise: the sensor is believed afresh
_DECIMATION = 3  # readings of a quiescent bubble before the one that makes the mean
_INTEGRAL_MAX = 1 << 17  # µJ ticks
_LONGEST_UM = 1024  # of a curve's segment


class Figures(NamedTuple):
    """What set one bubble apart: counts, µs, µJ/ms per root of pressures in 8 Pa, /65536; and its table's knots, µm and Pa."""

    zero: float
    opens_us: float
    closes_us: float
    flow_gain: float
    knots: Sequence[tuple[float, float]]


def _curve_of(board: ModuleType, table: Sequence[tuple[float, float]]) -> list[tuple[float, float, float]]:
    """Knots of (height, air, pressure): a table's, and more where they are far apart."""
    knots: list[tuple[float, float]] = []
    for (low, lower), (high, higher) in pairwise(table):
        pieces = math.ceil((high - low) / _LONGEST_UM)
        knots += [(low + (high - low) * k / pieces, lower + (higher - lower) * k / pieces) for k in range(pieces)]
    knots.append(table[-1])
    volumes = [math.pi / 6 * (height * 1e-3) ** 3 + board.DEAD_VOLUME_MM3 for height, _ in knots]
    return [(h, (p + ATMOSPHERE) * volume * 1e-3, p) for (h, p), volume in zip(knots, volumes, strict=True)]


class Curve:
    """Knots of (height, air, pressure)."""

    def __init__(self, knots):
        self.height = [float(knot[0]) for knot in knots]
        self.air = [float(knot[1]) for knot in knots]
        self.pressure = [float(knot[2]) for knot in knots]
        self.lowest_pressure = min(self.pressure)
        self.highest_pressure = max(self.pressure)
        self.last = len(knots) - 2

    def locate(self, values, value, segment):
        """The segment that holds `value` of the rising `values`, looked for from `segment` on, and the share of it below."""
        while segment > 0 and value < values[segment]:
            segment -= 1
        while segment < self.last and value > values[segment + 1]:
            segment += 1
        share = (value - values[segment]) / (values[segment + 1] - values[segment])
        return segment, min(max(share, 0.0), 1.0)

    def between(self, values, segment, share):
        """What `values` are at that share of a segment."""
        return values[segment] + share * (values[segment + 1] - values[segment])

    def slope(self, segment):
        """Air per height, µJ/µm."""
        return (self.air[segment + 1] - self.air[segment]) / (self.height[segment + 1] - self.height[segment])

    def air_at(self, pressure, segment):
        """The air that `pressure` means, in the segment that contains it and is nearest to `segment`."""
        if pressure < self.lowest_pressure:
            return self.air[0]
        if pressure > self.highest_pressure:
            return self.air[-1]
        pressures = self.pressure
        low = high = segment
        upwards = True
        while (pressure - pressures[segment]) * (pressures[segment + 1] - pressure) < 0:
            if upwards:
                high = min(high + 1, self.last)
                segment = high
            else:
                low = max(low - 1, 0)
                segment = low
            upwards = not upwards
        rise = pressures[segment + 1] - pressures[segment]
        return self.between(self.air, segment, (pressure - pressures[segment]) / rise if rise else 0.0)


class Bubble:
    """One bubble's state; `estimate`, `move_setpoint` and `dose` are its share of the passes."""

    def __init__(self, board, figures):
        self.board = board
        self.figures = figures
        self.curve = curve = Curve(_curve_of(board, figures.knots))
        self.faulty = False
        self.out_of_range = 0
        self.pressure = 0.0
        self.due = True
        self.quiescent = self.hold_output = False
        self.decimation_left = -1
        self.decimation_sum = 0.0
        self.settling_us = 0.0
        self.air = curve.air[0]
        self.air_in_flight = self.air_queued = 0.0
        self.samples = 0
        self.resting = True
        self.flow = self.integral = self.error = self.previous_setpoint_air = 0.0
        self.fill_us = self.vent_us = 0.0
        self.height = self.target = self.setpoint = float(board.HEIGHT_REST_UM)
        self.height_segment = self.setpoint_segment = 0
        self.height_slope = self.setpoint_slope = curve.slope(0)
        self.setpoint_air = curve.air[0]
        self.ramping = True

    def set_target(self, height):
        """Go to `height`."""
        self.target = float(height)
        self.quiescent = self.hold_output = False
        self.ramping = True

    def estimate(self, count, same_mode):
        """Take up a reading: pressure, and where the bubble is due air and height."""
        board = self.board
        self.pressure = pressure = float((count - self.figures.zero) * board.SENSOR_PA_PER_COUNT)
        good = board.COUNT_LOW < count < board.COUNT_HIGH and pressure <= board.PRESSURE_MAX_PA
        self.out_of_range = 0 if good else self.out_of_range + 1
        self.faulty |= self.out_of_range >= READINGS_MIN
        self.due = self._is_due(same_mode)
        if self.due:
            self.air += self.air_in_flight
            if self.settling_us <= 0:
                self._correct()
            curve = self.curve
            self.height_segment, share = curve.locate(curve.air, self.air, self.height_segment)
            self.height = curve.between(curve.height, self.height_segment, share)
            self.height_slope = curve.slope(self.height_segment)

    def _is_due(self, same_mode):
        if self.quiescent and same_mode:
            if self.settling_us > 0:
                self.settling_us -= self.board.TICK_US
                return False
            if self.decimation_left > 0:
                self.decimation_left -= 1
                self.decimation_sum += self.pressure
                return False
        elif self.hold_output and same_mode:
            self.hold_output = False
            self.air += self.air_in_flight
            self.air_in_flight = self.air_queued
            return False
        return True

    def _correct(self):
        """Move the air towards what the pressure means."""
        mean = self.pressure
        weight = 1
        if self.decimation_left == 0:
            weight = _DECIMATION + 1
            mean = (self.decimation_sum + mean) / weight
        self.decimation_left = -1
        innovation = self.curve.air_at(mean, self.height_segment) - self.air
        if self.resting:  # the vent is open: the sensor alone says what there is
            self.air += innovation
        else:
            self.samples = min(self.samples + weight, _SAMPLES_MAX)
            if self._contradicts(mean, innovation):
                self.samples = weight = 1
            self.air += innovation * weight / self.samples
        self.air = max(self.air, 0.0)

    def _contradicts(self, mean, innovation):
        """The innovation gate: whether a measurement is too far from the estimate to be averaged with it."""
        curve = self.curve
        segment = self.height_segment
        share = (self.air - curve.air[segment]) / (curve.air[segment + 1] - curve.air[segment])
        expected = curve.between(curve.pressure, segment, min(max(share, 0.0), 1.0))
        return abs(innovation) > _INNOVATION_UM * self.height_slope and abs(mean - expected) > _INNOVATION_PA

    def move_setpoint(self):
        """Find air of the setpoint, where it has moved: to its target, at once."""
        if self.due and self.ramping:
            curve = self.curve
            self.ramping = False
            self.setpoint = self.target
            self.setpoint_segment, part = curve.locate(curve.height, self.setpoint, self.setpoint_segment)
            self.setpoint_slope = curve.slope(self.setpoint_segment)
            self.setpoint_air = curve.between(curve.air, self.setpoint_segment, part)

    def dose(self, supply, mode):
        """Decide what the valves do in the next period."""
        if not self.due:
            return
        board = self.board
        filled, vented = self.fill_us, self.vent_us
        tail = self._begin_period()
        self.fill_us = self.vent_us = 0.0
        if self.faulty or mode != FOLLOW or self.setpoint <= board.HEIGHT_REST_UM + _DEADBAND_UM:
            self._vent(vented)
        else:
            self._follow(supply, tail, filled, vented)
        if self.quiescent and self.settling_us <= 0:
            self.decimation_left = _DECIMATION
            self.decimation_sum = 0.0

    def _begin_period(self):
        """What the period that has just begun does. Returns the air that its valve, closing, brings into the next."""
        board = self.board
        tick = board.TICK_US
        energised = self.fill_us + self.vent_us
        self.air_in_flight = self.air_queued
        if energised:
            self.settling_us = energised + self.figures.closes_us + board.QUIET_US - tick
        elif self.settling_us > 0:
            self.settling_us -= tick
        if energised != tick:
            return 0.0
        tail = self.flow * self.figures.closes_us / 1000
        return -tail if self.vent_us else tail

    def _vent(self, vented):
        tick = self.board.TICK_US
        self.resting = True
        self.quiescent = vented == tick and not self.ramping
        self.air_queued = self.settling_us = self.error = self.integral = self.flow = 0.0
        self.previous_setpoint_air = self.air
        self.samples = 0
        self.vent_us = float(tick)

    def _follow(self, supply, tail, filled, vented):
        """The air that is missing, and what the setpoint's own motion asks for: feed-forward."""
        board = self.board
        self.resting = False
        ahead = self.setpoint_air - self.previous_setpoint_air
        error = self.previous_setpoint_air - self.air - self.air_in_flight - tail
        self.previous_setpoint_air = self.setpoint_air
        self.air_queued = tail
        self.quiescent = False
        if not ahead and abs(error) <= self.setpoint_slope * _DEADBAND_UM:
            self.quiescent = not (filled or vented or self.air_in_flight or self.ramping)
        elif self.samples:
            integral = self.integral + error
            change = error - self.error
            want = ahead + (error * board.GAIN_P + integral * _GAIN_I + change * board.GAIN_D) / 256
            opened = (filled if want > 0 else vented) == board.TICK_US
            width = self._pulse(want, supply, opened, tail)
            if width < board.TICK_US:  # only while not saturated: the integral must not wind up
                self.integral = min(max(integral, -_INTEGRAL_MAX), _INTEGRAL_MAX)
        self.error = error

    def _pulse(self, want, supply, opened, tail):
        """Have the air `want` come in the next period, or go where it is negative; returns how long a valve is energised."""
        board = self.board
        tick = board.TICK_US
        self.flow = flow = self._flow(want, supply)
        delay = 0.0 if opened else self.figures.opens_us - self.figures.closes_us
        width = min(abs(want), DOSE_MAX) * 1000 / flow + delay
        self.hold_output = opened and width > 3 * tick
        width = self._playable(width, delay, opened)
        if not width:
            return width
        moved = width - delay
        if width == tick:
            moved -= self.figures.closes_us
            self.samples = 1
        else:
            self.samples = min(self.samples, _SAMPLES_DOSED)
        moved = flow * moved / 1000
        if want > 0:
            self.fill_us = width
            self.air_queued = tail + moved
        else:
            self.vent_us = width
            self.air_queued = tail - moved
        return width

    def _flow(self, want, supply):
        """Flow of a restrictor below its critical ratio (ISO 6358), filling where `want` is positive, else venting."""
        board = self.board
        lost = board.TUBE_PA_PER_FLOW * self.flow if self.settling_us <= 0 else 0.0
        if want > 0:
            p1 = supply + ATMOSPHERE
            p2 = min(self.pressure + lost + ATMOSPHERE, p1)
        else:
            p1 = max(self.pressure - lost, 0.0) + ATMOSPHERE
            p2 = ATMOSPHERE
        root = ((p1 - p2) * (p2 + (1 - board.CRITICAL_RATIO / 128) * p1)) ** 0.5
        return root / 8 * self.figures.flow_gain / 65536 + 0.0625

    def _playable(self, width, delay, opened):
        """The pulse nearest to `width` that a valve can play: neither it nor the gap after it too short."""
        tick = self.board.TICK_US
        shortest = self.board.PULSE_MIN_US
        if width > tick - shortest:
            return float(tick) if width > tick - shortest / 2 else float(tick - shortest)
        if width < shortest and not opened:
            return float(shortest) if 2 * (width - delay) >= shortest - delay else 0.0
        return width


class Bubbles:
    """All bubbles, called as `bubble_firmware.control.bubbles.Bubbles` is."""

    def __init__(self, board, figures):
        self.bubbles = [Bubble(board, each) for each in figures]
        self.mode = 0

    def set_targets(self, heights):
        """Go to `heights`, µm, at once."""
        for bubble, height in zip(self.bubbles, heights, strict=True):
            bubble.set_target(height)

    def step(self, counts, supply, mode):
        """One tick."""
        same_mode = mode == self.mode
        self.mode = mode
        for bubble, count in zip(self.bubbles, counts, strict=False):  # the last count is the supply's
            bubble.estimate(count, same_mode)
        for bubble in self.bubbles:
            bubble.move_setpoint()
        for bubble in self.bubbles:
            bubble.dose(supply, mode)

    def pulses(self):
        """Fill and vent µs of every bubble."""
        return [round(width) for bubble in self.bubbles for width in (bubble.fill_us, bubble.vent_us)]
