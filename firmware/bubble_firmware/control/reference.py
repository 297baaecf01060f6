# mypy: disable-error-code="valid-type,index,operator,arg-type,no-untyped-def"
"""What the membrane says of one bubble whose line is quiet: a correction of its air, as far as that is the better witness.

Air is metered, so its error grows with every dose. The curve's error does not, but it is large: rubber has a memory, sheets
differ. Two errors are kept with their standard deviations and correlation: of the air, A, and of the curve, a share β by which
the pressure at a height is above it. A pressure of a quiet line is compared with P(h)(1 + β), in a linear update of both
(Kalman) with the secant of the curve over what the height may be:

    r = P − P(h)(1 + β)     a = s σA     c = P(h) σβ     v = a² + 2ρac + c² + R²

It is asked once when the bubble has come to dwell somewhere, and once a second after that. In between β forgets: memory comes
back to `CURVE_SD` of the pressure, more after a greater height. Where r is far from what its deviation allows, both are known
worse than thought: they are doubled, until pressure and air agree.
"""

from bubble_protocol.mpy_compat import const, micropython, ptr32, uint

# [constants] bubble_firmware.control.state_layout: used
# [constants] bubble_firmware.device_clock: LATEST
_CURVE_SD = const(8)
_AIR = const(16)
_HEIGHT = const(26)
_HEIGHT_SEGMENT = const(27)
_FIRST_SEGMENT = const(44)
_LAST_SEGMENT = const(45)
_AIR_SD = const(49)
_CURVE_ERROR = const(50)
_CURVE_ERROR_SD = const(51)
_CORRELATION = const(52)
_PRESSURE_RATIO = const(54)
_DWELL_HEIGHT = const(55)
_DWELL_SLOPE = const(56)
_REFERENCE_TICK = const(57)
_PEAK = const(58)
_QUIET_PRESSURE = const(59)
_AIR_SLOPE = const(65)
_CURVE_PRESSURE = const(66)
_CURVE_BEND = const(67)
_CURVE_SLOPE = const(68)
_READINGS_BITS = const(69)
_ROW_WORDS = const(70)
_KNOT_HEIGHT = const(0)
_KNOT_PRESSURE = const(2)
_KNOT_SLOPE = const(3)
_KNOT_RISE = const(5)
_KNOT_WORDS = const(6)
_BUBBLE_COUNT = const(0)
_TICK = const(19)
_SECOND = const(22)
_ATMOSPHERE_PA = const(23)
_ROWS = const(157)
_READINGS_BITS_FIRST = const(3)
_AIR_SD_MAX = const(60000)
_LATEST = const(1073741823)
# [end of constants]

_DWELL_UM = const(100)  # a bubble that has moved further dwells somewhere else
_NEAR_UM = const(20)  # least and greatest height within which the curve's secant is taken
_FAR_UM = const(1500)
_LEAST_PA = const(500)
_NOISE_PA = const(30)
_CORRELATION_MAX = const(4000)  # *4096
_INNOVATION_MAX = const(5000)  # Pa
_AIR_SD_MIN = const(100)  # µJ
_FORGET = const(64881)  # in a second, 1 - 1/100, *65536
_FORGET_MOST = const(16384)  # a quarter is kept, however far it has gone
_CURVE_SD_MAX = const(26214)  # 0.4
_SLOPE_MAX = const(204800)  # Pa/µm, *1024


@micropython.viper
def compare(row: ptr32, board: ptr32, bubble: int) -> int:
    """Take from the curve of the bubble of this number, from 1, which `estimate` has found quiet, what it says of its height.

    Returns whether that is to correct anything: it dwells somewhere else than before, or a second has passed.
    """
    curves = ptr32(uint(board) + 4 * (_ROWS + _ROW_WORDS * board[_BUBBLE_COUNT]))
    row = ptr32(uint(row) + 4 * _ROW_WORDS * (bubble - 1))
    atmosphere = board[_ATMOSPHERE_PA]
    height = row[_HEIGHT]
    knot = ptr32(uint(curves) + row[_HEIGHT_SEGMENT])
    pressure = row[_QUIET_PRESSURE]

    # Air per height at this pressure, and how far the height may be off.
    air_slope = ((pressure + atmosphere >> 4) * knot[_KNOT_SLOPE] >> 14) + 1
    row[_AIR_SLOPE] = air_slope
    reach = (row[_AIR_SD] << 6) // air_slope
    if reach < _NEAR_UM:
        reach = _NEAR_UM
    if reach > _FAR_UM:
        reach = _FAR_UM

    # The curve's pressure there, and as far below and above.
    below = 0
    above = 0
    here = 0
    place = 0
    while place < 3:
        h = height
        if place == 1:
            h -= reach << 4
        elif place == 2:
            h += reach << 4
        segment = row[_HEIGHT_SEGMENT]
        knot = ptr32(uint(curves) + segment)
        off = h - knot[_KNOT_HEIGHT]
        while (off | knot[_KNOT_WORDS + _KNOT_HEIGHT] - h) >> 31:
            if off < 0:
                if segment == row[_FIRST_SEGMENT]:
                    break  # it goes on as straight as it begins
                segment -= 4 * _KNOT_WORDS
            else:
                if segment == row[_LAST_SEGMENT]:
                    break
                segment += 4 * _KNOT_WORDS
            knot = ptr32(uint(curves) + segment)
            off = h - knot[_KNOT_HEIGHT]
        p = knot[_KNOT_PRESSURE] + (off * knot[_KNOT_RISE] >> 12)
        if place == 0:
            here = p
        elif place == 1:
            below = p
        else:
            above = p
        place += 1
    if here < _LEAST_PA:
        here = _LEAST_PA
    row[_CURVE_PRESSURE] = here
    row[_CURVE_BEND] = (above + below >> 1) - here
    row[_CURVE_SLOPE] = ((above - below) // 2 << 10) // reach

    # The ratio that setpoints are to expect.
    ratio = (pressure - here << 12) // here
    if ratio > 4096:
        ratio = 4096
    if ratio < -2048:
        ratio = -2048
    row[_PRESSURE_RATIO] = row[_PRESSURE_RATIO] + (ratio - row[_PRESSURE_RATIO] >> 2)
    moved = (height >> 4) - row[_DWELL_HEIGHT]
    if moved > _DWELL_UM or moved < 0 - _DWELL_UM or board[_TICK] - row[_REFERENCE_TICK] & _LATEST >= board[_SECOND]:
        return 1
    return 0


@micropython.viper
def fade(row: ptr32, board: ptr32, bubble: int):
    """Let the curve's error become what the memory of the rubber may have made of it since the last time."""
    curves = ptr32(uint(board) + 4 * (_ROWS + _ROW_WORDS * board[_BUBBLE_COUNT]))
    row = ptr32(uint(row) + 4 * _ROW_WORDS * (bubble - 1))
    height = row[_HEIGHT]
    second = board[_SECOND]

    # The peak fades within 20 s.
    elapsed = board[_TICK] - row[_REFERENCE_TICK] & _LATEST
    if elapsed > 20 * second:
        elapsed = 20 * second
    row[_PEAK] = row[_PEAK] - (row[_PEAK] - height) * elapsed // (20 * second)
    row[_REFERENCE_TICK] = board[_TICK]

    # A share of the stress at the greatest height lately, which is more of the pressure here.
    segment = row[_HEIGHT_SEGMENT]
    knot = ptr32(uint(curves) + segment)
    while row[_PEAK] > knot[_KNOT_WORDS + _KNOT_HEIGHT] and segment != row[_LAST_SEGMENT]:
        segment += 4 * _KNOT_WORDS
        knot = ptr32(uint(curves) + segment)
    most = knot[_KNOT_PRESSURE] * (knot[_KNOT_HEIGHT] >> 4)
    most = (most >> 8) * 256 // ((row[_CURVE_PRESSURE] * (height >> 4) >> 8) + 1)
    if most < 256:
        most = 256
    if most > 1024:
        most = 1024
    most = row[_CURVE_SD] * most >> 8

    # Forgotten in a second, or on the way from where it dwelt before.
    keep = _FORGET
    lower = height >> 4
    moved = lower - row[_DWELL_HEIGHT]
    if moved < 0:
        moved = 0 - moved
    if moved > _DWELL_UM:
        if row[_DWELL_HEIGHT] < lower:
            lower = row[_DWELL_HEIGHT]
        keep = 65536 - (moved << 15) // (lower + 1)
        if keep < _FORGET_MOST:
            keep = _FORGET_MOST
        row[_DWELL_HEIGHT] = height >> 4
        row[_DWELL_SLOPE] = 0
    keep >>= 4  # *4096
    row[_CURVE_ERROR] = row[_CURVE_ERROR] * keep >> 12
    old = row[_CURVE_ERROR_SD] * keep >> 12
    # sqrt(old² + (1 - keep²) most²), in units of 16
    square = (old >> 4) * (old >> 4) + ((16777216 - keep * keep >> 12) * ((most >> 4) * (most >> 4) >> 6) >> 6)
    root = 0
    bit = 1 << 12
    while bit:
        if (root + bit) * (root + bit) <= square:
            root += bit
        bit >>= 1
    sd = (root << 4) + 8
    row[_CORRELATION] = row[_CORRELATION] * old // sd
    row[_CURVE_ERROR_SD] = sd if sd < _CURVE_SD_MAX else _CURVE_SD_MAX


@micropython.viper
def correct(row: ptr32, board: ptr32, bubble: int):
    """Correct air and curve's error of this bubble by what its pressure and its curve's differ, see above."""
    row = ptr32(uint(row) + 4 * _ROW_WORDS * (bubble - 1))
    here = row[_CURVE_PRESSURE]
    error = row[_CURVE_ERROR]
    sd = row[_CURVE_ERROR_SD]
    correlation = row[_CORRELATION]
    air_sd = row[_AIR_SD]
    if row[_DWELL_SLOPE] == 0:
        a = row[_CURVE_SLOPE]
        if a > _SLOPE_MAX:
            a = _SLOPE_MAX
        if a < 0 - _SLOPE_MAX:
            a = 0 - _SLOPE_MAX
        row[_DWELL_SLOPE] = a + (a * (error >> 8) >> 8)
    a = (air_sd << 6) // row[_AIR_SLOPE]
    if a > 2 * _FAR_UM:
        a = 2 * _FAR_UM
    a = row[_DWELL_SLOPE] * a >> 10
    if a > 20000:
        a = 20000
    if a < -20000:
        a = -20000
    c = (sd >> 2) * here >> 14
    if c > 10000:
        c = 10000
    noise = row[_CURVE_BEND]
    if noise < 0:
        noise = 0 - noise
    if noise > 10000:
        noise = 10000
    noise += _NOISE_PA
    u = a + (correlation * c >> 12)
    w = c + (correlation * a >> 12)
    v = a * u + c * w + noise * noise
    if v < 1024:
        v = 1024
    r = row[_QUIET_PRESSURE] - here - (here * (error >> 2) >> 14)
    # Beyond four standard deviations both are worse than thought. The next mean is asked then, and where a step is not enough.
    doubted = 1 if (r >> 2) * (r >> 2) > v else 0
    if doubted or r > _INNOVATION_MAX or r < 0 - _INNOVATION_MAX:
        row[_REFERENCE_TICK] = board[_TICK] - board[_SECOND] & _LATEST
        row[_READINGS_BITS] = _READINGS_BITS_FIRST
    if r > _INNOVATION_MAX:
        r = _INNOVATION_MAX
    if r < 0 - _INNOVATION_MAX:
        r = 0 - _INNOVATION_MAX
    if doubted:
        row[_AIR_SD] = air_sd * 2 if air_sd < _AIR_SD_MAX >> 1 else _AIR_SD_MAX
        row[_CURVE_ERROR_SD] = sd * 2 if sd < _CURVE_SD_MAX >> 1 else _CURVE_SD_MAX
        row[_DWELL_SLOPE] = 0
    else:
        gain = air_sd * u // (v >> 8)
        air = gain * r >> 8
        most = row[_AIR_SLOPE] * _FAR_UM >> 6  # the slope is one of so far: it says nothing of what lies beyond
        if air > most:
            air = most
        if air < 0 - most:
            air = 0 - most
        air += row[_AIR]
        row[_AIR] = air if air > 0 else 0
        gain = sd * w // (v >> 8)
        if gain > 0:  # never against what the pressure says: a leak would be taken for stiffer rubber
            error += gain * r >> 8
        if error > _CURVE_SD_MAX:
            error = _CURVE_SD_MAX
        if error < 0 - _CURVE_SD_MAX:
            error = 0 - _CURVE_SD_MAX
        row[_CURVE_ERROR] = error
        # What is left of both deviations: sqrt(1 - u²/v), sqrt(1 - w²/v), *4096
        if v >> 20:
            x = 4096 - u * u // (v >> 12)
            y = 4096 - w * w // (v >> 12)
            z = u * (w >> 1) // (v >> 12) * 2
        else:
            x = 4096 - (u * u << 8) // (v >> 4)
            y = 4096 - (w * w << 8) // (v >> 4)
            z = (u * w << 8) // (v >> 4)
        if x < 16:
            x = 16
        if y < 16:
            y = 16
        x <<= 12
        y <<= 12
        root = 0
        other = 0
        bit = 1 << 12
        while bit:
            if (root + bit) * (root + bit) <= x:
                root += bit
            if (other + bit) * (other + bit) <= y:
                other += bit
            bit >>= 1
        air_sd = air_sd * root >> 12
        row[_AIR_SD] = air_sd if air_sd > _AIR_SD_MIN else _AIR_SD_MIN
        row[_CURVE_ERROR_SD] = (sd * other >> 12) + 1
        correlation = (correlation - z << 12) // ((root * other >> 12) + 1)
        if correlation > _CORRELATION_MAX:
            correlation = _CORRELATION_MAX
        if correlation < 0 - _CORRELATION_MAX:
            correlation = 0 - _CORRELATION_MAX
        row[_CORRELATION] = correlation
