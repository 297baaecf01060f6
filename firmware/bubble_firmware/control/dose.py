# mypy: disable-error-code="valid-type,index,operator,arg-type,no-untyped-def"
"""Third pass over all bubbles: what each is to do, and the open times of its valves.

A PD law on the air that is missing, fed forward by the air that the moving setpoint itself needs. Air becomes open time by the
valve's flow, and dead times are added. A command computed in one tick acts from the start of the next: the PWM hardware latches
it there. What the period now playing brings counts as there.
"""

from bubble_protocol.mpy_compat import const, micropython, ptr16, ptr32, uint

# [constants] bubble_firmware.control.state_layout: used
# [constants] bubble_protocol.schema.statuses: used
# [constants] bubble_protocol.schema.faults: used
_FILL_OPENS_US = const(1)
_FILL_CLOSES_US = const(2)
_VENT_OPENS_US = const(4)
_VENT_CLOSES_US = const(5)
_PRESSURE = const(10)
_QUIESCENT = const(12)
_SETTLING_US = const(15)
_AIR = const(16)
_AIR_IN_FLIGHT = const(17)
_FILL_FLOW = const(18)
_VENT_FLOW = const(19)
_FILL_US = const(20)
_VENT_US = const(21)
_DUE = const(24)
_STATUS = const(25)
_HEIGHT = const(26)
_SETPOINT_AIR = const(28)
_PREVIOUS_SETPOINT_AIR = const(29)
_RAMPING = const(30)
_SETPOINT = const(33)
_ERROR = const(34)
_FAULTS = const(36)
_TARGET = const(37)
_SETPOINT_SLOPE = const(41)
_FILL_RUN_US = const(43)
_EMPTY_TICKS = const(48)
_AIR_SD = const(49)
_REZERO = const(62)
_ROW_WORDS = const(70)
_BUBBLE_COUNT = const(0)
_TICK_US = const(1)
_FILL_MAX_US = const(6)
_PULSE_MIN_US = const(7)
_QUIET_US = const(8)
_GAIN_P = const(10)
_GAIN_D = const(11)
_DEADBAND_UM = const(12)
_SETTLED_UM = const(13)
_REST_UM = const(14)
_ATMOSPHERE_PA = const(23)
_SURE_UM = const(24)
_HELD = const(2)
_DOSE_MAX = const(50000)
_VENT = const(0)
_FOLLOW = const(1)
_RESTING = const(0)
_MOVING = const(1)
_SETTLED = const(2)
_STOPPED = const(3)
_FAULT = const(4)
_UNSURE = const(5)
_VALVE_TIME = const(4)
# [end of constants]


_FAR_PERIODS = const(3)  # with so much to do, it does not matter whether it is looked at in every tick or every other


@micropython.viper
def dose(row: ptr32, board: ptr32, pulses: ptr16, mode: int):
    """Decide upon every bubble that is due: its status, and fill and vent µs of each in the next period in `pulses`.

    `mode` is what control is to do, see `state_layout`.
    """
    n = board[_BUBBLE_COUNT]
    tick = board[_TICK_US]
    atmosphere = board[_ATMOSPHERE_PA]
    i = 0
    while i < n:
        if row[_DUE]:
            # What the period that has just begun does.
            filled = row[_FILL_US]
            vented = row[_VENT_US]
            energised = filled + vented
            in_flight = row[_AIR_IN_FLIGHT]
            tail = 0
            if energised:
                row[_SETTLING_US] = energised + row[_FILL_CLOSES_US] + board[_QUIET_US] - tick
                row[_FILL_RUN_US] = row[_FILL_RUN_US] + filled if filled == tick else 0
                if row[_FILL_RUN_US] >= board[_FILL_MAX_US]:
                    row[_FAULTS] = row[_FAULTS] | _VALVE_TIME
                # It closes its dead time into the next period: that air comes anyway. /16000 by multiplication.
                if filled == tick:
                    tail = (row[_FILL_FLOW] * row[_FILL_CLOSES_US] >> 12) * 16777 >> 16
                elif vented == tick:
                    tail = 0 - ((row[_VENT_FLOW] * row[_VENT_CLOSES_US] >> 12) * 16777 >> 16)
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
                row[_QUIESCENT] = 1 if vented == tick and row[_RAMPING] == 0 and row[_EMPTY_TICKS] else 0
                row[_SETTLING_US] = 0
                row[_PREVIOUS_SETPOINT_AIR] = row[_AIR]
                row[_ERROR] = 0
                vent = tick
            elif mode == _FOLLOW and row[_REZERO]:
                row[_STATUS] = _MOVING
                row[_QUIESCENT] = 0
                row[_PREVIOUS_SETPOINT_AIR] = row[_AIR]
                row[_ERROR] = 0
                vent = tick
            elif mode != _FOLLOW:
                row[_STATUS] = _STOPPED
                row[_QUIESCENT] = 0 if energised or in_flight else 1
                row[_PREVIOUS_SETPOINT_AIR] = row[_AIR]
                row[_ERROR] = 0
            else:
                deadband = (row[_PRESSURE] + atmosphere >> 4) * (row[_SETPOINT_SLOPE] * board[_DEADBAND_UM] >> 8) >> 12
                off = row[_TARGET] - (row[_HEIGHT] >> 4)
                row[_STATUS] = _MOVING
                if row[_RAMPING] == 0 and (board[_SETTLED_UM] - off | board[_SETTLED_UM] + off) >> 31 == 0:
                    sure = row[_AIR_SD] * board[_DEADBAND_UM] <= deadband * board[_SURE_UM]
                    row[_STATUS] = _SETTLED if sure else _UNSURE

                # The air that is missing, and what the setpoint's own motion asks for: feed-forward.
                ahead = row[_SETPOINT_AIR] - row[_PREVIOUS_SETPOINT_AIR]
                error = row[_PREVIOUS_SETPOINT_AIR] - row[_AIR] - in_flight - tail
                row[_PREVIOUS_SETPOINT_AIR] = row[_SETPOINT_AIR]
                row[_QUIESCENT] = 0
                unasked = 0
                far = 0
                if row[_RAMPING] == 0:
                    error += ahead
                    ahead = 0
                if ahead | (deadband - error | deadband + error) >> 31 != 0:
                    want = error * board[_GAIN_P] + (error - row[_ERROR]) * board[_GAIN_D]
                    want = ahead + (want >> 8)

                    # Air to time. A valve that is still open needs no opening and its closing is in the tail.
                    if want > 0:
                        size = want
                        opened = 1 if filled == tick else 0
                        flow = row[_FILL_FLOW]
                        delay = row[_FILL_OPENS_US] - row[_FILL_CLOSES_US]
                    else:
                        size = 0 - want
                        opened = 1 if vented == tick else 0
                        flow = row[_VENT_FLOW]
                        delay = row[_VENT_OPENS_US] - row[_VENT_CLOSES_US]
                    if opened:
                        delay = 0
                    if size > _DOSE_MAX:
                        size = _DOSE_MAX
                    width = 0
                    if flow:
                        width = size * 16000 // flow + delay
                    else:
                        unasked = 1  # what this valve would bring: the next tick asks
                    far = 1 if opened and width > _FAR_PERIODS * tick else 0
                    shortest = board[_PULSE_MIN_US]
                    if width > tick - shortest:  # too short a gap to close in
                        width = tick if width > tick - (shortest >> 1) else tick - shortest
                    elif opened == 0 and width < shortest:
                        # Of open time, five eighths of that or more are worth a pulse: with half, one may call for its opposite.
                        width = shortest if 8 * (width - delay) >= 5 * (shortest - delay) and flow else 0
                    if width < 0:
                        width = 0
                    if want > 0:
                        fill = width
                    else:
                        vent = width
                if energised | in_flight | row[_RAMPING] | fill | vent | unasked == 0:
                    row[_QUIESCENT] = 1
                elif far and row[_FILL_RUN_US] + tick < board[_FILL_MAX_US]:
                    row[_QUIESCENT] = _HELD
                row[_ERROR] = error
            row[_FILL_US] = fill
            row[_VENT_US] = vent
        pulses[2 * i] = row[_FILL_US]
        pulses[2 * i + 1] = row[_VENT_US]
        i += 1
        row = ptr32(uint(row) + 4 * _ROW_WORDS)
