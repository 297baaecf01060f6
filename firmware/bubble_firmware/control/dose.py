# mypy: disable-error-code="valid-type,index,operator,arg-type,no-untyped-def"
"""Third pass over all bubbles: what each is to do, and the open times of its valves.

An integer PID on the air that is missing, fed forward by the air that the moving setpoint itself needs. Air becomes open
time by the valve's flow, see `flow`, and dead times are added. A command computed in one tick acts from the start of the
next: the PWM hardware latches it there.
"""

from bubble_protocol.mpy_compat import const, micropython, ptr16, ptr32, uint

# [constants] bubble_firmware.control.state_layout: used
# [constants] bubble_protocol.schema.statuses: used
# [constants] bubble_protocol.schema.faults: used
_OPENS_US = const(1)
_CLOSES_US = const(2)
_FLOW_GAIN = const(3)
_PRESSURE = const(4)
_QUIESCENT = const(6)
_DECIMATION_LEFT = const(7)
_DECIMATION_SUM = const(8)
_SETTLING_US = const(9)
_AIR = const(10)
_AIR_IN_FLIGHT = const(11)
_AIR_QUEUED = const(12)
_SAMPLES = const(13)
_FLOW = const(14)
_INTEGRAL = const(15)
_ERROR = const(16)
_PREVIOUS_SETPOINT_AIR = const(17)
_FILL_US = const(18)
_VENT_US = const(19)
_FILL_RUN_US = const(20)
_FAULTS = const(21)
_STATUS = const(22)
_TARGET = const(23)
_HEIGHT = const(24)
_DUE = const(27)
_SETPOINT = const(28)
_SETPOINT_SLOPE = const(30)
_SETPOINT_AIR = const(31)
_RAMPING = const(33)
_HOLD_OUTPUT = const(34)
_ROW_WORDS = const(41)
_BUBBLE_COUNT = const(0)
_TICK_US = const(1)
_FILL_MAX_US = const(6)
_PULSE_MIN_US = const(7)
_QUIET_US = const(8)
_TUBE_PA = const(9)
_GAIN_P = const(10)
_GAIN_I = const(11)
_GAIN_D = const(12)
_DEADBAND_UM = const(13)
_SETTLED_UM = const(14)
_REST_UM = const(15)
_ROOTS = const(20)
_ROOT_STEPS = const(64)
_ATMOSPHERE = const(101325)
_SAMPLES_DOSED = const(16)
_DECIMATION = const(3)
_INTEGRAL_MAX = const(131072)
_DOSE_MAX = const(50000)
_VENT = const(0)
_FOLLOW = const(1)
_RESTING = const(0)
_MOVING = const(1)
_SETTLED = const(2)
_STOPPED = const(3)
_FAULT = const(4)
_VALVE_TIME = const(4)
# [end of constants]

_ROOT_END = const(8191)  # the last place in a table of roots, *128


@micropython.viper
def dose(row: ptr32, board: ptr32, pulses: ptr16, supply: int, mode: int):
    """Decide upon every bubble that is due: its status, and fill and vent µs of each in the next period in `pulses`.

    `supply` is the reservoir's pressure in Pa, `mode` what control is to do, see `state_layout`.
    """
    n = board[_BUBBLE_COUNT]
    tick = board[_TICK_US]
    supply_scale = supply + _ATMOSPHERE >> 3  # 8 Pa
    supply_reciprocal = 0x3FFFFFFF // (supply + _ATMOSPHERE)
    i = 0
    while i < n:
        if row[_DUE]:
            # What the period that has just begun does.
            filled = row[_FILL_US]
            vented = row[_VENT_US]
            energised = filled + vented
            in_flight = row[_AIR_QUEUED]
            row[_AIR_IN_FLIGHT] = in_flight
            tail = 0
            if energised:
                row[_SETTLING_US] = energised + row[_CLOSES_US] + board[_QUIET_US] - tick
                row[_FILL_RUN_US] = row[_FILL_RUN_US] + filled if filled == tick else 0
                if row[_FILL_RUN_US] >= board[_FILL_MAX_US]:
                    row[_FAULTS] = row[_FAULTS] | _VALVE_TIME
                if energised == tick:
                    # It closes its dead time into the next period: that air comes anyway. /16000 by multiplication.
                    tail = (row[_FLOW] * row[_CLOSES_US] >> 12) * 16777 >> 16
                    if vented:
                        tail = 0 - tail
            else:
                row[_FILL_RUN_US] = 0
                if row[_SETTLING_US] > 0:
                    row[_SETTLING_US] = row[_SETTLING_US] - tick

            fill = 0
            vent = 0
            isolated = 0
            if row[_FAULTS]:
                row[_STATUS] = _FAULT
                isolated = 1
            elif mode == _VENT or (mode == _FOLLOW and row[_SETPOINT] <= board[_REST_UM] + board[_DEADBAND_UM] << 4):
                row[_STATUS] = _RESTING
                isolated = 1
            if isolated:
                row[_QUIESCENT] = 1 if vented == tick and row[_RAMPING] == 0 else 0
                row[_AIR_QUEUED] = 0
                row[_SETTLING_US] = 0
                row[_PREVIOUS_SETPOINT_AIR] = row[_AIR]
                row[_ERROR] = 0
                row[_INTEGRAL] = 0
                row[_SAMPLES] = 0
                row[_FLOW] = 0
                vent = tick
            elif mode != _FOLLOW:
                row[_STATUS] = _STOPPED
                row[_QUIESCENT] = 0 if energised or in_flight else 1
                row[_AIR_QUEUED] = tail
                row[_PREVIOUS_SETPOINT_AIR] = row[_AIR]
                row[_ERROR] = 0
            else:
                off = row[_TARGET] - (row[_HEIGHT] >> 4)
                row[_STATUS] = _MOVING
                if (
                    row[_RAMPING] == 0
                    and row[_SAMPLES] > 1
                    and (board[_SETTLED_UM] - off | board[_SETTLED_UM] + off) >> 31 == 0
                ):
                    row[_STATUS] = _SETTLED

                # The air that is missing, and what the setpoint's own motion asks for: feed-forward.
                ahead = row[_SETPOINT_AIR] - row[_PREVIOUS_SETPOINT_AIR]
                error = row[_PREVIOUS_SETPOINT_AIR] - row[_AIR] - in_flight - tail
                row[_PREVIOUS_SETPOINT_AIR] = row[_SETPOINT_AIR]
                row[_AIR_QUEUED] = tail
                row[_QUIESCENT] = 0
                deadband = row[_SETPOINT_SLOPE] * board[_DEADBAND_UM] >> 8
                if ahead | (deadband - error | deadband + error) >> 31 == 0:
                    if (energised | in_flight | row[_RAMPING]) == 0:
                        row[_QUIESCENT] = 1
                elif row[_SAMPLES]:
                    integral = row[_INTEGRAL] + error
                    want = error * board[_GAIN_P] + integral * board[_GAIN_I] + (error - row[_ERROR]) * board[_GAIN_D]
                    want = ahead + (want >> 8)

                    # Flow of a restrictor below its critical ratio (ISO 6358), from the tables of its root.
                    lost = board[_TUBE_PA] * row[_FLOW] >> 4 if row[_SETTLING_US] <= 0 else 0
                    size = want
                    if want > 0:
                        opened = 1 if filled == tick else 0
                        at = (supply - row[_PRESSURE] - lost) * supply_reciprocal >> 16
                        scale = supply_scale
                    else:
                        size = 0 - want
                        opened = 1 if vented == tick else 0
                        at = row[_PRESSURE] - lost >> 3
                        scale = 1 << 14
                    if at >> 13:
                        at = _ROOT_END if at > 0 else 0
                    part = at & 127
                    at >>= 7
                    if want <= 0:
                        at += _ROOT_STEPS + 1
                    roots = ptr32(uint(board) + 4 * at)
                    root = scale * (roots[_ROOTS] + ((roots[_ROOTS + 1] - roots[_ROOTS]) * part >> 7)) >> 14
                    flow = (root * row[_FLOW_GAIN] >> 12) + 1
                    row[_FLOW] = flow

                    # Air to time. A valve that is still open needs no opening and its closing is in the tail.
                    if size > _DOSE_MAX:
                        size = _DOSE_MAX
                    delay = 0 if opened else row[_OPENS_US] - row[_CLOSES_US]
                    width = size * 16000 // flow + delay
                    shortest = board[_PULSE_MIN_US]
                    if opened and width > 3 * tick and row[_FILL_RUN_US] + 2 * tick < board[_FILL_MAX_US]:
                        row[_HOLD_OUTPUT] = 1
                    if width > tick - shortest:  # too short a gap to close in
                        width = tick if width > tick - (shortest >> 1) else tick - shortest
                    elif opened == 0 and width < shortest:  # of open time, half of that or more is worth a pulse
                        width = shortest if 2 * (width - delay) >= shortest - delay else 0
                    if width < tick:
                        # Only while not saturated: the integral must not wind up.
                        if integral > _INTEGRAL_MAX:
                            integral = _INTEGRAL_MAX
                        if integral < 0 - _INTEGRAL_MAX:
                            integral = 0 - _INTEGRAL_MAX
                        row[_INTEGRAL] = integral
                    if width:
                        moved = width - delay
                        if width == tick:
                            moved -= row[_CLOSES_US]
                            row[_SAMPLES] = 1
                        elif row[_SAMPLES] > _SAMPLES_DOSED:
                            row[_SAMPLES] = _SAMPLES_DOSED
                        moved = (flow * moved >> 12) * 16777 >> 16
                        if want > 0:
                            fill = width
                            row[_AIR_QUEUED] = tail + moved
                        else:
                            vent = width
                            row[_AIR_QUEUED] = tail - moved
                row[_ERROR] = error
            if row[_QUIESCENT] and row[_SETTLING_US] <= 0:
                row[_DECIMATION_LEFT] = _DECIMATION
                row[_DECIMATION_SUM] = 0
            row[_FILL_US] = fill
            row[_VENT_US] = vent
        pulses[2 * i] = row[_FILL_US]
        pulses[2 * i + 1] = row[_VENT_US]
        i += 1
        row = ptr32(uint(row) + 4 * _ROW_WORDS)
