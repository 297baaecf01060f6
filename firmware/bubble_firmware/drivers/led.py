# mypy: disable-error-code="valid-type,index,operator,arg-type,no-untyped-def"
"""The status LED, on a GPIO that `machine.Pin` has set up (RP2040 datasheet, 2.3.1: GPIO_OUT_SET and _CLR)."""

from bubble_protocol.mpy_compat import const, micropython, ptr32

# [constants] bubble_firmware.drivers.sio: GPIO_OUT_SET GPIO_OUT_CLR
_GPIO_OUT_SET = const(5)
_GPIO_OUT_CLR = const(6)
# [end of constants]


@micropython.viper
def show(gpio: ptr32, pin: int, ticks: int, lit: int, faults: int):
    """On where `lit`, else a short flash now and then; blinking fast where there are `faults`."""
    beat = ticks & 63
    if faults:
        lit = beat >> 3 & 1
    elif beat < 4:
        lit = 1
    gpio[_GPIO_OUT_SET if lit else _GPIO_OUT_CLR] = 1 << pin
