"""A clock for other chips on GPOUT0, GPIO 21 (RP2040 datasheet, 2.15.7): the system clock divided by n/256."""

from bubble_protocol.mpy_compat import const, micropython, ptr32

CLOCKS = 0x40008000

_CTRL = const(0)  # words of the block, those of GPOUT0
_DIV = const(1)
_SYSTEM = const(0xC0)  # CTRL: AUXSRC 6, clk_sys
_ENABLE = const(0x800)
_EVEN = const(0x1000)  # CTRL: DC50, a duty of one half


def divider(mhz: int, period_us: int, clocks: int) -> int:
    """The divider, in 1/256, that gives `clocks` clocks in `period_us`; ValueError where there is none."""
    n, rest = divmod(256 * mhz * period_us, clocks)
    if rest:
        raise ValueError("no divider gives %d clocks in %d us at %d MHz" % (clocks, period_us, mhz))
    return n


@micropython.viper
def _set(registers, control: int, divide: int):  # type: ignore[no-untyped-def]
    block = ptr32(registers)
    block[_CTRL] = 0
    block[_DIV] = divide
    block[_CTRL] = control


def start(divide: int, registers: "int | list[int]" = CLOCKS) -> None:
    """Run the clock, from now."""
    _set(registers, _SYSTEM | _EVEN | _ENABLE, divide)


def stop(registers: "int | list[int]" = CLOCKS) -> None:
    """Stop the clock."""
    _set(registers, 0, 256)
