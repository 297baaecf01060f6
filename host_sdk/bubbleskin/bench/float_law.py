# mypy: disable-error-code="no-untyped-def"
"""The law of `bubble_firmware.control.step.step` once more, in ordinary floats: what `bubbleskin bench` holds it against.

It runs on CPython and, sent to the prompt of an emulated chip, as MicroPython's bytecode. The same readings give
the same decisions but for rounding. Only what a healthy bubble goes through is here: no faults, no guards but the
two comparisons of each reading. Units are those of `control`, without its scales: µm, Pa, µJ, µs, µJ/ms.
"""

SUMMED = 3
ATMOSPHERE = 101325.0


class Curve:
    """Knots of (height, air, pressure), and the segment in which to look first."""

    def __init__(self, knots):
        self.height = [float(knot[0]) for knot in knots]
        self.air = [float(knot[1]) for knot in knots]
        self.pressure = [float(knot[2]) for knot in knots]
        self.lowest = min(self.pressure)
        self.highest = max(self.pressure)
        self.last = len(knots) - 2

    def within(self, values, value, seg):
        """The segment that holds `value` of rising `values`, and how far along it that is, 0 to 1."""
        while seg > 0 and value < values[seg]:
            seg -= 1
        while seg < self.last and value > values[seg + 1]:
            seg += 1
        share = (value - values[seg]) / (values[seg + 1] - values[seg])
        return seg, min(max(share, 0.0), 1.0)

    def air_at(self, pressure, seg):
        """The air at `pressure`, on the branch nearest to segment `seg`."""
        low = high = seg
        p = self.pressure
        if pressure < self.lowest:
            return self.air[0]
        if pressure > self.highest:
            return self.air[-1]
        turn = False
        while (pressure - p[seg]) * (p[seg + 1] - pressure) < 0:
            if turn:
                if low > 0:
                    low -= 1
                seg = low
            else:
                if high < self.last:
                    high += 1
                seg = high
            turn = not turn
        rise = p[seg + 1] - p[seg]
        part = (pressure - p[seg]) / rise if rise else 0.0
        return self.air[seg] + part * (self.air[seg + 1] - self.air[seg])


class Bubble:
    """One bubble's state; `step` is its tick."""

    def __init__(self, board, curve):
        self.board = board
        self.curve = curve
        self.gain = board.CONDUCTANCE * 1342 // (10 * (256 - board.CRITICAL_RATIO)) / 65536
        self.air = curve.air[0]
        self.dose = self.next = self.flow = self.integral = self.error = self.aim = 0.0
        self.busy = self.total = 0.0
        self.wait = -1
        self.calm = self.coast = False
        self.ramping = True
        self.trust = 0
        self.resting = True
        self.fill = self.vent = 0.0
        self.seg = self.goal_seg = 0
        self.height = self.start = self.target = float(board.HEIGHT_REST_UM)
        self.setpoint = self.start
        self.model = 0.0
        self.goal = curve.air[0]
        self.slope = (curve.air[1] - curve.air[0]) / (curve.height[1] - curve.height[0])
        self.goal_slope = self.slope

    def step(self, count, supply, active, same, share):
        """Decide what the valves do in the next period."""
        board = self.board
        curve = self.curve
        tick = board.TICK_US
        p = float((count - board.SENSOR_ZERO) * board.SENSOR_PA_PER_COUNT)
        if count <= board.COUNT_LOW or count >= board.COUNT_HIGH or p > board.PRESSURE_MAX_PA:
            raise ValueError("a fault, which this law does not know")
        if self.calm and same:
            if self.busy > 0:
                self.busy -= tick
                return
            if self.wait > 0:
                self.wait -= 1
                self.total += p
                return
        elif self.coast and same:
            self.coast = False
            self.air += self.dose
            self.dose = self.next
            return
        air = self.air + self.dose
        if self.busy <= 0:
            mean = p
            weight = 1
            if self.wait == 0:
                mean = (self.total + p) / 4
                weight = 4
            self.wait = -1
            off = curve.air_at(mean, self.seg) - air
            if self.resting:
                air += off
            else:
                self.trust = min(self.trust + weight, 64)
                seg = self.seg
                part = (air - curve.air[seg]) / (curve.air[seg + 1] - curve.air[seg])
                self.model = curve.pressure[seg] + min(max(part, 0.0), 1.0) * (
                    curve.pressure[seg + 1] - curve.pressure[seg]
                )
                if abs(off) > 500 * self.slope and abs(mean - self.model) > 500:
                    self.trust = weight = 1
                air += off * weight / self.trust
            air = max(air, 0.0)
        self.air = air
        self.seg, part = curve.within(curve.air, air, self.seg)
        seg = self.seg
        self.height = curve.height[seg] + part * (curve.height[seg + 1] - curve.height[seg])
        self.slope = (curve.air[seg + 1] - curve.air[seg]) / (curve.height[seg + 1] - curve.height[seg])
        if self.ramping:
            self.ramping = share < 1
            self.setpoint = self.start + (self.target - self.start) * share
            self.goal_seg, part = curve.within(curve.height, self.setpoint, self.goal_seg)
            seg = self.goal_seg
            self.goal = curve.air[seg] + part * (curve.air[seg + 1] - curve.air[seg])
            self.goal_slope = (curve.air[seg + 1] - curve.air[seg]) / (curve.height[seg + 1] - curve.height[seg])

        filled = self.fill
        vented = self.vent
        energised = filled + vented
        self.dose = self.next
        tail = 0.0
        if energised:
            self.busy = energised + board.VALVE_CLOSES_US + board.QUIET_US - tick
            if energised == tick:
                tail = self.flow * board.VALVE_CLOSES_US / 1000
                if vented:
                    tail = -tail
        elif self.busy > 0:
            self.busy -= tick
        self.fill = self.vent = 0.0
        if not active or self.setpoint <= board.HEIGHT_REST_UM + board.DEADBAND_UM:
            self.calm = vented == tick and not self.ramping
            self.next = self.busy = self.error = self.integral = self.flow = 0.0
            self.aim = air
            self.trust = 0
            self.vent = float(tick)
            self.resting = True
        else:
            self.resting = False
            ahead = self.goal - self.aim
            error = self.aim - air - self.dose - tail
            self.aim = self.goal
            self.next = tail
            self.calm = False
            if not ahead and abs(error) <= self.goal_slope * board.DEADBAND_UM:
                self.calm = not (energised or self.dose or self.ramping)
            elif self.trust:
                self._dose(p, supply, ahead, error, tail, filled, vented)
            self.error = error
        if self.calm and self.busy <= 0:
            self.wait = SUMMED
            self.total = 0.0

    def _dose(self, p, supply, ahead, error, tail, filled, vented):
        board = self.board
        tick = board.TICK_US
        integral = self.integral + error
        change = error - self.error
        want = ahead + (error * board.GAIN_P + integral * board.GAIN_I + change * board.GAIN_D) / 256
        lost = board.TUBE_PA_PER_FLOW * self.flow if self.busy <= 0 else 0.0
        if want > 0:
            opened = filled == tick
            p1 = supply + ATMOSPHERE
            p2 = min(p + lost + ATMOSPHERE, p1)
        else:
            opened = vented == tick
            p1 = max(p - lost, 0.0) + ATMOSPHERE
            p2 = ATMOSPHERE
        flow = ((p1 - p2) * (p2 + (1 - board.CRITICAL_RATIO / 128) * p1)) ** 0.5 / 8 * self.gain + 0.0625
        self.flow = flow
        shortest = board.PULSE_MIN_US
        delay = 0.0 if opened else board.VALVE_OPENS_US - board.VALVE_CLOSES_US
        width = min(abs(want), 50000.0) * 1000 / flow + delay
        self.coast = opened and width > 3 * tick
        if width > tick - shortest:
            width = float(tick) if width > tick - shortest / 2 else float(tick - shortest)
        elif width < shortest and not opened:
            width = float(shortest) if 2 * (width - delay) >= shortest - delay else 0.0
        if width < tick:
            self.integral = min(max(integral, -131072.0), 131072.0)
        if width:
            moved = width - delay
            if width == tick:
                moved -= board.VALVE_CLOSES_US
                self.trust = 1
            else:
                self.trust = min(self.trust, 16)
            if want > 0:
                self.fill = width
                self.next = tail + flow * moved / 1000
            else:
                self.vent = width
                self.next = tail - flow * moved / 1000


class Bubbles:
    """All bubbles, called as `bubble_firmware.control.bubbles.Bubbles` is; `curves` are lists of (height, air, pressure)."""

    def __init__(self, board, curves):
        self.bubbles = [Bubble(board, Curve(knots)) for knots in curves]
        self.done = 0
        self.ticks = 1
        self.mode = 0

    def set_targets(self, heights, ticks):
        """Ramp to `heights` within so many ticks."""
        for bubble, height in zip(self.bubbles, heights):  # noqa: B905 - MicroPython has no strict
            bubble.start = bubble.height
            bubble.target = float(height)
            bubble.calm = bubble.coast = False
            bubble.ramping = True
        self.done = 0
        self.ticks = ticks

    def step(self, counts, supply, mode):
        """One tick."""
        if self.done != self.ticks:
            self.done += 1
        share = self.done / self.ticks
        same = mode == self.mode
        self.mode = mode
        for i, bubble in enumerate(self.bubbles):
            bubble.step(counts[i], supply, mode == 1, same, share)

    def pulses(self):
        """Fill and vent µs of every bubble."""
        return [width for bubble in self.bubbles for width in (bubble.fill, bubble.vent)]
