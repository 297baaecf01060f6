"""What flows through a valve's restrictor (ISO 6358, below the critical ratio b), as far as it can be worked out beforehand.

    ṁRT = C p_ref/(1 − b) √((p₁ − p₂)(p₂ + (1 − 2b) p₁))

The root stands in two tables, of `ROOT_STEPS` + 1 entries each: for filling over (p₁ − p₂)/p₁ from 0 to 1/2, in p₁, *2^14;
for venting, p₂ being the atmosphere, over p₁ − p₂ in steps of 1024 Pa, in 8 Pa. What stands before it is the flow gain.
"""

from array import array

from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from types import ModuleType

# [constants] bubble_firmware.control.state_layout: used
_ROOT_STEPS = const(64)
_ATMOSPHERE = const(101325)
# [end of constants]


def flow_gain(board: "ModuleType") -> int:
    """Flow gain of the board's restrictors: root of pressures (8 Pa) to flow (µJ/ms), *65536."""
    # C (1e-6 dm³/(s bar)) 1e-14 SI, times 1e5 Pa (ANR) 8 Pa/(1 - b), W to µJ/ms, *65536
    return board.CONDUCTANCE * 1342 // (10 * (256 - board.CRITICAL_RATIO))


def roots(critical: int) -> "array[int]":
    """The tables of roots for the critical ratio `critical`/256."""
    table = array("i", bytearray(4 * 2 * (_ROOT_STEPS + 1)))
    choke = 256 - critical  # from this share of pressure on, *256, flow does not grow
    for step in range(_ROOT_STEPS + 1):
        x = min(2 * step, choke)  # *256
        table[step] = _root(x * (2 * choke - x) << 12)
        d = 1024 * step
        p1 = d + _ATMOSPHERE
        table[_ROOT_STEPS + 1 + step] = _root(d * (p1 * (256 - 2 * critical) // 256 + _ATMOSPHERE)) >> 3
    return table


def _root(square: int) -> int:
    """The whole root of a number, rounded down (Newton)."""
    root = square
    better = (square + 1) >> 1
    while better < root:
        root = better
        better = (root + square // root) >> 1
    return root
