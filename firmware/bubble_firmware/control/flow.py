"""What flows through a valve's restrictor (ISO 6358, below the critical ratio b), as far as it can be worked out beforehand.

    ṁRT = C p_ref/(1 − b) √((p₁ − p₂)(p₂ + (1 − 2b) p₁))

The root stands in two tables, of `ROOT_STEPS` + 1 entries each: for filling over (p₁ − p₂)/p₁ from 0 to 1/2, in p₁, *2^14;
for venting, p₂ being the atmosphere, over p₁ − p₂ in steps of 1024 Pa, in 8 Pa. What stands before it is the flow gain.
"""

from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from array import array
    from types import ModuleType

# [constants] bubble_firmware.control.state_layout: used
_ROOT_STEPS = const(64)
# [end of constants]


def flow_gain(board: "ModuleType") -> int:
    """Flow gain of the board's restrictors: root of pressures (8 Pa) to flow (µJ/ms), *65536."""
    # C (1e-6 dm³/(s bar)) 1e-14 SI, times 1e5 Pa (ANR) 8 Pa/(1 - b), W to µJ/ms, *65536
    return board.CONDUCTANCE * 1342 // (10 * (256 - board.CRITICAL_RATIO))


def fill_roots(table: "array[int]", at: int, critical: int) -> None:
    """Put the roots of filling, for the critical ratio `critical`/256, at `table[at:]`."""
    choke = 256 - critical  # from this share of pressure on, *256, flow does not grow
    for step in range(_ROOT_STEPS + 1):
        x = min(2 * step, choke)  # *256
        table[at + step] = _root(x * (2 * choke - x) << 12)


def vent_roots(table: "array[int]", at: int, critical: int, atmosphere: int) -> None:
    """Put the roots of venting into air of the pressure `atmosphere`, Pa, at `table[at:]`."""
    for step in range(_ROOT_STEPS + 1):
        d = 1024 * step
        p1 = d + atmosphere
        # In units of 8 Pa, so that no product needs more than a small integer.
        table[at + step] = _root((d >> 3) * ((p1 >> 3) * (256 - 2 * critical) // 256 + (atmosphere >> 3)))


def _root(square: int) -> int:
    """The whole root of a number, rounded down (Newton)."""
    root = square
    better = (square + 1) >> 1
    while better < root:
        root = better
        better = (root + square // root) >> 1
    return root
