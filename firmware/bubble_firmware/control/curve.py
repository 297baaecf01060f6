# mypy: disable-error-code="valid-type,index,operator,arg-type"
"""What a bubble's table means in air, and what pressures mean in flow: made once, so that the tick need not divide.

A *curve* is a table's knots with more said at each, `control` names the places: height, air, pressure, and for the
segment that begins there air per height and its reciprocal. Air is linear in height between two
knots; a segment longer than 1 mm is divided, so that this costs less than 35 µm. Air always rises, by at least
1 µJ/µm, whatever the table.

*Roots* are what a restrictor's flow is proportional to (ISO 6358, below the critical ratio b):

    √((p₁ − p₂)(p₂ + (1 − 2b) p₁))

first for filling, over (p₁ − p₂)/p₁ from 0 to 1/2, in p₁, *2^14; then for venting, p₂ being the atmosphere, over
p₁ − p₂ in steps of 1024 Pa, in 8 Pa.
"""

from array import array

from bubble_protocol.mpy_compat import const, micropython, ptr16, ptr32

KNOTS_MAX = 80  # of a curve: 64 of a table, and 15 where no segment is longer than 1024 µm

_LONGEST = const(1024)  # µm
_ATMOSPHERE = const(101325)
_RISE_MIN = const(1)  # µJ/µm
_SLOPE_MAX = const(1 << 20)  # *256: steeper, and a deadband's air is beyond 32 bits
_STEPS = 64

# A knot, as in `control`.
_H = const(0)
_A = const(1)
_P = const(2)
_S = const(3)
_R = const(4)
_KNOT = const(5)


@micropython.viper
def build(curve: ptr32, knot: ptr16, at: int, first: int, size: int, dead: int) -> int:
    """Make the curve of one bubble at `curve[at:]` of the `size` knots from number `first` on; returns its knots.

    `dead` is the volume of the line, 1/64 mm³.
    """
    made = 0
    air = 0
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
            # Sphere of diameter h: V = pi/6 h³. Volume in 1/64 mm³, pressure in 16 Pa.
            square = h * h >> 12
            volume = ((square * h >> 12) * 2303 >> 12) + dead
            content = (p + _ATMOSPHERE >> 4) * volume // 4000
            if made:
                before = at - _KNOT
                run = h - (curve[before + _H] >> 4)
                if content < air + run * _RISE_MIN:
                    content = air + run * _RISE_MIN
                slope = (content - air << 8) // run
                if slope > _SLOPE_MAX:
                    slope = _SLOPE_MAX
                curve[before + _S] = slope
                curve[before + _R] = (1 << 28) // slope
            curve[at + _H] = h << 4
            curve[at + _A] = content
            curve[at + _P] = p
            air = content
            at += _KNOT
            made += 1
            piece += 1
        i += 2
    return made


def _root(square):
    """The whole root of a number, rounded down (Newton)."""
    root = square
    better = (square + 1) >> 1
    while better < root:
        root = better
        better = (root + square // root) >> 1
    return root


def roots(critical):
    """The tables of roots for the critical ratio `critical`/256."""
    table = array("i", bytearray(4 * 2 * (_STEPS + 1)))
    choke = 256 - critical  # from this share of pressure on, *256, flow does not grow
    for step in range(_STEPS + 1):
        x = min(2 * step, choke)  # *256
        table[step] = _root(x * (2 * choke - x) << 12)
        d = 1024 * step
        p1 = d + _ATMOSPHERE
        table[_STEPS + 1 + step] = _root(d * (p1 * (256 - 2 * critical) // 256 + _ATMOSPHERE)) >> 3
    return table
