# mypy: disable-error-code="valid-type,index,operator,arg-type,no-untyped-def"
"""The status LED, on a GPIO that `machine.Pin` has set up (RP2040 datasheet, 2.3.1: GPIO_OUT_SET and _CLR)."""

from bubble_protocol.mpy_compat import const, micropython, ptr32

_SET = const(5)
_CLEAR = const(6)


@micropython.viper
def show(gpio: ptr32, pin: int, ticks: int, lit: int, faults: int):
    """On where `lit`, else a short flash now and then; blinking fast where there are `faults`."""
    beat = ticks & 63
    if faults:
        lit = beat >> 3 & 1
    elif beat < 4:
        lit = 1
    gpio[_SET if lit else _CLEAR] = 1 << pin
