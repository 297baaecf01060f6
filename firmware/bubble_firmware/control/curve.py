# mypy: disable-error-code="valid-type,index,operator,arg-type"
"""What a bubble's table means in volume: worked out once, so that the tick need not divide.

A *curve* is a table's knots with more said at each, `state_layout` names the places: height, volume of bubble and line,
pressure, and for the segment that begins there volume per height and its reciprocal, and pressure per height. Volume is linear
in height between two knots; a segment longer than 1 mm is divided, so that this costs less than 35 µm.
"""

from bubble_protocol.mpy_compat import const, micropython, ptr16, ptr32

KNOTS_MAX = 80  # of a curve: 64 of a table, and 15 where no segment is longer than 1024 µm

_LONGEST = const(1024)  # µm
_RISE_MAX = const(65536)  # 256 Pa/µm, more than any membrane: times the height of a bubble it is within 32 bits

# [constants] bubble_firmware.control.state_layout: used
_KNOT_HEIGHT = const(0)
_KNOT_VOLUME = const(1)
_KNOT_PRESSURE = const(2)
_KNOT_SLOPE = const(3)
_KNOT_RECIPROCAL = const(4)
_KNOT_RISE = const(5)
_KNOT_WORDS = const(6)
# [end of constants]


@micropython.viper
def build(curve: ptr32, knot: ptr16, at: int, first: int, size: int, dead: int) -> int:
    """Make the curve of one bubble at `curve[at:]` of the `size` knots from number `first` on; returns its knots.

    `dead` is the volume of the line, in the units of `state_layout`.
    """
    made = 0
    i = 2 * first
    end = i + 2 * (size - 1)
    while i <= end:
        pieces = 1
        if i < end:
            pieces = (knot[i + 2] - knot[i] + _LONGEST - 1) // _LONGEST
        piece = 0
        while piece < pieces:
            h = knot[i]
            p = knot[i + 1]
            if piece:
                h += (knot[i + 2] - h) * piece // pieces
                p += (knot[i + 3] - p) * piece // pieces
            # Sphere of diameter h: V = pi/6 h³.
            square = h * h >> 12
            volume = ((square * h >> 12) * 2358 >> 12) + dead
            if made:
                before = at - _KNOT_WORDS
                run = h - (curve[before + _KNOT_HEIGHT] >> 4)
                rise = volume - curve[before + _KNOT_VOLUME]
                if rise < run:  # of heights that no bubble has: their slope's reciprocal must stay within 32 bits
                    rise = run
                    volume = curve[before + _KNOT_VOLUME] + rise
                slope = (rise << 8) // run
                curve[before + _KNOT_SLOPE] = slope
                curve[before + _KNOT_RECIPROCAL] = (1 << 28) // slope
                rise = (p - curve[before + _KNOT_PRESSURE] << 8) // run
                if rise > _RISE_MAX:
                    rise = _RISE_MAX
                if rise < 0 - _RISE_MAX:
                    rise = 0 - _RISE_MAX
                curve[before + _KNOT_RISE] = rise
            curve[at + _KNOT_HEIGHT] = h << 4
            curve[at + _KNOT_VOLUME] = volume
            curve[at + _KNOT_PRESSURE] = p
            at += _KNOT_WORDS
            made += 1
            piece += 1
        i += 2
    return made
