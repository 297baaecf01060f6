# mypy: disable-error-code="no-untyped-def"
"""The law of `bubble_firmware.control` once more, in ordinary floats: what `bubbleskin bench` holds it against.

It runs on CPython and, sent to the prompt of an emulated chip, as MicroPython's bytecode. The same passes, by the same names,
come to the same decisions but for rounding. Only what a healthy bubble goes through is here: of the limits only the two
comparisons of each reading, no faults, no STOP, no leak, no re-zeroing. Units are those of `control`, without its scales: µm,
Pa, µJ, µs, µJ/ms, mm³, shares.
"""

from bubble_firmware.control.state_layout import (
    ATMOSPHERE,
    DOSE_MAX,
    EMPTY_PA,
    EMPTY_US,
    FOLLOW,
    KEEP_CLOSED,
    READINGS_BITS_FIRST,
    READINGS_BITS_NEXT,
)


class Curve:
    """Knots of (height, volume of bubble and line, pressure)."""

    def __init__(self, knots):
        self.height = [float(knot[0]) for knot in knots]
        self.volume = [float(knot[1]) for knot in knots]
        self.pressure = [float(knot[2]) for knot in knots]
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
        """Volume per height, mm³/µm."""
        return (self.volume[segment + 1] - self.volume[segment]) / (self.height[segment + 1] - self.height[segment])

    def pressure_at(self, height, segment):
        """The pressure at `height`, as straight beyond its ends as it is there."""
        heights = self.height
        while segment > 0 and height < heights[segment]:
            segment -= 1
        while segment < self.last and height > heights[segment + 1]:
            segment += 1
        share = (height - heights[segment]) / (heights[segment + 1] - heights[segment])
        return self.between(self.pressure, segment, share)


class Valve:
    """One of a bubble's two valves: `sign` is 1 for that which fills, -1 for the other."""

    def __init__(self, board, sign):
        self.board = board
        self.sign = sign
        self.gain = board.CONDUCTANCE * 1342 // (10 * (256 - board.CRITICAL_RATIO)) / 65536
        self.flow = 0.0
        self.energised_us = self.open_us = 0.0
        self.full = False

    def meter(self, pressure, supply, asked):
        """What it has brought in the period that ended, and what it brings in the one that begins, both signed.

        Where it does nothing and its flow is not asked for, none is known.
        """
        board = self.board
        if not (asked or self.full or self.energised_us or self.open_us):
            self.flow = 0.0
            return 0.0, 0.0
        tick = board.TICK_US
        before = self.flow
        was_full = self.full
        if not was_full:
            pressure += self.sign * board.TUBE_PA_PER_FLOW * before
        self.flow = flow = self._flow(pressure, supply)
        brought = (before + flow) / 2 * self.open_us / 1000
        energised = self.energised_us
        open_us = 0.0
        if energised:
            open_us = energised if was_full else energised - board.VALVE_OPENS_US
        if energised < tick and (energised or was_full):
            open_us += board.VALVE_CLOSES_US
        self.open_us = max(open_us, 0.0)
        self.full = energised == tick
        return self.sign * brought, self.sign * flow * self.open_us / 1000

    def _flow(self, pressure, supply):
        """Flow of a restrictor below its critical ratio (ISO 6358)."""
        if self.sign > 0:
            p1 = supply + ATMOSPHERE
            p2 = min(pressure + ATMOSPHERE, p1)
        else:
            p1 = max(pressure, 0.0) + ATMOSPHERE
            p2 = ATMOSPHERE
        root = ((p1 - p2) * (p2 + (1 - self.board.CRITICAL_RATIO / 128) * p1)) ** 0.5
        return root / 8 * self.gain + 0.0625


class Bubble:
    """One bubble's state, named as in `state_layout`; its methods are its share of the passes."""

    def __init__(self, board, curve):
        self.board = board
        self.curve = curve
        self.fill = Valve(board, 1)
        self.vent = Valve(board, -1)
        self.pressure = 0.0
        self.due = True
        self.quiescent = self.held = False
        self.readings = 0
        self.readings_mean = 1 << READINGS_BITS_FIRST
        self.readings_sum = 0.0
        self.settling_us = 0.0
        self.air = ATMOSPHERE * curve.volume[0] / 1000
        self.air_in_flight = self.error = self.previous_setpoint_air = self.setpoint_air = 0.0
        self.empty_ticks = 0
        self.height = self.ramp_start = self.target = self.setpoint = float(board.HEIGHT_REST_UM)
        self.height_segment = self.setpoint_segment = 0
        self.setpoint_volume = curve.volume[0]
        self.setpoint_pressure = curve.pressure[0]
        self.setpoint_slope = curve.slope(0)
        self.ramping = True
        # What is known, and how well.
        self.air_sd = 200.0
        self.curve_error = 0.0
        self.curve_error_sd = board.CURVE_SD / 65536
        self.correlation = self.pressure_ratio = self.dwell_height = self.dwell_slope = 0.0
        self.reference_tick = 0
        self.peak = 0.0

    def set_target(self, height):
        """Begin the way from where it is to `height`."""
        self.ramp_start = self.height
        self.target = float(height)
        self.quiescent = self.held = False
        self.ramping = True

    def estimate(self, count, supply, same_mode, served):
        """Take up a reading; where the bubble is due, air and height. Whether its quiet line is to be compared with its curve."""
        board = self.board
        self.pressure = pressure = float((count - board.SENSOR_ZERO) * board.SENSOR_PA_PER_COUNT)
        if count <= board.COUNT_LOW or count >= board.COUNT_HIGH or pressure > board.PRESSURE_MAX_PA:
            raise ValueError("a fault, which this law does not know")
        chosen = False
        self.due = True
        if self.quiescent and same_mode:
            self.due = self._is_due(served)
            if self.due:
                chosen = not self.vent.full
                pressure = self.readings_sum / self.readings_mean
                self.quiet_pressure = pressure
                self.readings = 0
                self.readings_sum = 0.0
                self.readings_mean = 1 << READINGS_BITS_NEXT
        else:
            self.readings = 0
            self.readings_sum = 0.0
            self.readings_mean = 1 << READINGS_BITS_FIRST
            if self.held and same_mode:
                self.due = False
                valve = self.fill if self.fill.energised_us else self.vent
                valve.open_us += board.TICK_US
            self.held = False
        if self.due:
            self._take_air(supply, pressure, chosen)
        return chosen

    def _is_due(self, served):
        if self.settling_us > 0:
            self.settling_us -= self.board.TICK_US
        elif self.readings < self.readings_mean:
            self.readings += 1
            self.readings_sum += self.pressure
        else:
            return not served
        return False

    def _take_air(self, supply, pressure, chosen):
        board = self.board
        curve = self.curve
        missing = self.setpoint_air - self.air
        brought, coming = self.fill.meter(self.pressure, supply, missing > 0)
        let_out, leaving = self.vent.meter(self.pressure, supply, missing < 0)
        for valve, moved in ((self.fill, brought), (self.vent, -let_out)):
            if moved:
                self.air_sd += moved * board.FLOW_SD / 65536 + (0.0 if valve.energised_us else 10.0)
        self.air_in_flight = coming + leaving
        self.air += brought + let_out
        segment = self.height_segment
        if pressure >= EMPTY_PA:
            self.empty_ticks = 0
        elif self.empty_ticks * board.TICK_US < EMPTY_US:
            self.empty_ticks += 1
        else:
            segment = 0
            believed = self.air
            self.air = (pressure + ATMOSPHERE) * curve.volume[0] / 1000
            if abs(believed - self.air) > 20000:
                self.curve_error = 0.0
                self.curve_error_sd = board.CURVE_SD / 65536
            self.air_sd = 200.0
            self.correlation = 0.0
        absolute = pressure + ATMOSPHERE
        if not chosen:
            if self.fill.full:
                absolute -= board.TUBE_PA_PER_FLOW * self.fill.flow
            elif self.vent.full:
                absolute += board.TUBE_PA_PER_FLOW * self.vent.flow
        self.height_segment, share = curve.locate(curve.volume, 1000 * self.air / absolute, segment)
        self.height = curve.between(curve.height, self.height_segment, share)
        self.peak = max(self.peak, self.height)

    def reference(self, tick):
        """See `bubble_firmware.control.reference`."""
        curve = self.curve
        height = self.height
        pressure = self.quiet_pressure
        second = 1000000 // self.board.TICK_US
        air_slope = (pressure + ATMOSPHERE) * curve.slope(self.height_segment) / 1000
        reach = min(max(self.air_sd / air_slope, 20.0), 1500.0)
        here, below, above = (curve.pressure_at(height + d, self.height_segment) for d in (0.0, -reach, reach))
        here = max(here, 500.0)
        ratio = min(max(pressure / here - 1, -0.5), 1.0)
        self.pressure_ratio += (ratio - self.pressure_ratio) / 4
        moved = abs(height - self.dwell_height)
        elapsed = tick - self.reference_tick
        if moved <= 100 and elapsed < second:
            return
        self.peak -= (self.peak - height) * min(elapsed / (20 * second), 1.0)
        self.reference_tick = tick
        error, sd, correlation = self._forget(here, height, moved)
        if moved > 100 or not self.dwell_slope:
            slope = (above - below) / 2 * (1 + error) / reach
            self.dwell_slope = min(max(slope, -200.0), 200.0)
        a = min(max(self.dwell_slope * min(self.air_sd / air_slope, 3000.0), -20000.0), 20000.0)
        c = min(sd * here, 10000.0)
        noise = min(abs((above + below) / 2 - here), 10000.0) + 30
        u = a + correlation * c
        w = c + correlation * a
        v = max(a * u + c * w + noise * noise, 1024.0)
        r = pressure - here * (1 + error)
        doubted = r * r > 16 * v
        if doubted or abs(r) > 5000:
            self.reference_tick = tick - second
            self.readings_mean = 1 << READINGS_BITS_FIRST
        r = min(max(r, -5000.0), 5000.0)
        if doubted:
            self.air_sd = min(2 * self.air_sd, 60000.0)
            self.curve_error_sd = min(2 * sd, 0.4)
            self.dwell_slope = 0.0
            return
        self.air = max(self.air + min(max(self.air_sd * u * r / v, -1500 * air_slope), 1500 * air_slope), 0.0)
        self.curve_error = min(max(error + sd * w * r / v, -0.4), 0.4)
        left_air = max(1 - u * u / v, 1 / 256) ** 0.5
        left_curve = max(1 - w * w / v, 1 / 256) ** 0.5
        self.air_sd = max(self.air_sd * left_air, 100.0)
        self.curve_error_sd = sd * left_curve
        self.correlation = min(max((correlation - u * w / v) / (left_air * left_curve), -0.977), 0.977)

    def _forget(self, here, height, moved):
        """Error of the curve, its deviation, and its correlation with that of the air, after what memory has done to them."""
        curve = self.curve
        segment = curve.locate(curve.height, self.peak, 0)[0]
        most = curve.pressure[segment] * curve.height[segment] / (here * height)
        most = self.board.CURVE_SD / 65536 * min(max(most, 1.0), 4.0)
        keep = 0.99
        if moved > 100:
            keep = max(1 - moved / (2 * min(height, self.dwell_height or height)), 0.25)
            self.dwell_height = height
        old = self.curve_error_sd * keep
        sd = (old * old + (1 - keep * keep) * most * most) ** 0.5
        return self.curve_error * keep, min(sd, 0.4), self.correlation * old / sd

    def move_setpoint(self, share):
        """Find height and air of the setpoint, where the bubble is due: `share` of the ramp is done."""
        if not self.due:
            return
        curve = self.curve
        if self.ramping:
            self.ramping = share < 1
            self.setpoint = self.ramp_start + (self.target - self.ramp_start) * share
            self.setpoint_segment, part = curve.locate(curve.height, self.setpoint, self.setpoint_segment)
            self.setpoint_slope = curve.slope(self.setpoint_segment)
            self.setpoint_volume = curve.between(curve.volume, self.setpoint_segment, part)
            self.setpoint_pressure = curve.between(curve.pressure, self.setpoint_segment, part)
        expected = self.setpoint_pressure * (1 + self.pressure_ratio) + ATMOSPHERE
        self.setpoint_air = expected * self.setpoint_volume / 1000

    def dose(self, mode):
        """Decide what the valves do in the next period."""
        if not self.due:
            return
        board = self.board
        fill, vent = self.fill, self.vent
        tick = board.TICK_US
        filled, vented = fill.energised_us, vent.energised_us
        tail = 0.0
        if filled or vented:
            self.settling_us = filled + vented + board.VALVE_CLOSES_US + board.QUIET_US - tick
            if filled == tick:
                tail = fill.flow * board.VALVE_CLOSES_US / 1000
            elif vented == tick:
                tail = -vent.flow * board.VALVE_CLOSES_US / 1000
        elif self.settling_us > 0:
            self.settling_us -= tick
        fill.energised_us = vent.energised_us = 0.0
        if mode != FOLLOW or self.setpoint <= board.HEIGHT_REST_UM + board.DEADBAND_UM:
            self.quiescent = vented == tick and not self.ramping and self.empty_ticks > 0
            self.settling_us = self.error = 0.0
            self.previous_setpoint_air = self.air
            vent.energised_us = float(tick)
        else:
            self._follow(tail, filled, vented)

    def _follow(self, tail, filled, vented):
        """The air that is missing, and what the setpoint's own motion asks for: feed-forward."""
        board = self.board
        ahead = self.setpoint_air - self.previous_setpoint_air
        error = self.previous_setpoint_air - self.air - self.air_in_flight - tail
        self.previous_setpoint_air = self.setpoint_air
        if not self.ramping:
            error += ahead
            ahead = 0.0
        width = 0.0
        unasked = False
        if ahead or abs(error) > (self.pressure + ATMOSPHERE) * self.setpoint_slope * board.DEADBAND_UM / 1000:
            want = ahead + (error * board.GAIN_P + (error - self.error) * board.GAIN_D) / 256
            valve, before = (self.fill, filled) if want > 0 else (self.vent, vented)
            opened = before == board.TICK_US
            if valve.flow:
                width = valve.energised_us = self._width(abs(want), valve.flow, opened)
                self.held = opened and min(abs(want), DOSE_MAX) * 1000 / valve.flow > 3 * board.TICK_US
            else:
                unasked = True
        self.quiescent = not (filled or vented or self.air_in_flight or self.ramping or width or unasked)
        self.error = error

    def _width(self, size, flow, opened):
        """How long a valve is energised that brings `size`: neither the pulse nor the gap after it too short to play."""
        board = self.board
        tick, shortest = board.TICK_US, board.PULSE_MIN_US
        delay = 0.0 if opened else board.VALVE_OPENS_US - board.VALVE_CLOSES_US
        width = min(size, DOSE_MAX) * 1000 / flow + delay
        if width > tick - shortest:
            return float(tick) if width > tick - shortest / 2 else float(tick - shortest)
        if width < shortest and not opened:
            return float(shortest) if 8 * (width - delay) >= 5 * (shortest - delay) else 0.0
        return max(width, 0.0)


class Bubbles:
    """All bubbles, called as `bubble_firmware.control.bubbles.Bubbles` is; `curves` are lists of (height, volume, pressure)."""

    def __init__(self, board, curves):
        self.bubbles = [Bubble(board, Curve(knots)) for knots in curves]
        self.ramp_done = 0
        self.ramp_ticks = 1
        self.mode = 0
        self.tick = 0

    def set_targets(self, heights, ticks):
        """Ramp to `heights` within so many ticks."""
        for bubble, height in zip(self.bubbles, heights):  # noqa: B905 - MicroPython has no strict
            bubble.set_target(height)
        self.ramp_done = 0
        self.ramp_ticks = ticks

    def step(self, counts, supply, mode):
        """One tick."""
        if mode == KEEP_CLOSED:
            raise ValueError("STOP or a silent host, which this law does not know")
        same_mode = mode == self.mode
        self.mode = mode
        self.tick += 1
        chosen = None
        for i, bubble in enumerate(self.bubbles):
            if bubble.estimate(counts[i], supply, same_mode, chosen is not None):
                chosen = bubble
        if chosen:
            chosen.reference(self.tick)
        if self.ramp_done != self.ramp_ticks:
            self.ramp_done += 1
        share = self.ramp_done / self.ramp_ticks
        for bubble in self.bubbles:
            bubble.move_setpoint(share)
        for bubble in self.bubbles:
            bubble.dose(mode)

    def pulses(self):
        """Fill and vent µs of every bubble."""
        return [width for bubble in self.bubbles for width in (bubble.fill.energised_us, bubble.vent.energised_us)]
