# mypy: disable-error-code="valid-type,index,operator,arg-type,no-untyped-def"
"""The RP2040's PWM block (RP2040 datasheet, 4.5): the tick's pace, a pump, and where a board wants it the valves.

A slice has five registers of 32 bits, one slice after the other: CSR, DIV (8.4 bits), CTR, CC (channel A in
the low half, B in the high one) and TOP. CC is taken up when the counter wraps. Here DIV makes a slice
count microseconds, so CC is an open time in µs, and one of TOP + 1 or more is the whole period.

Bubble i has slice i: channel A is its fill valve, energised to open. Channel B is inverted: the vent valve
is open without power, and CC is how long it is left so from the start of the period.

`registers` is the block's address; a test passes a list.
"""

from bubble_protocol.mpy_compat import const, micropython, ptr16, ptr32

BASE = 0x40050000
TIMER = 0x40054000

# Words of the block.
_CSR = const(0)
_DIV = const(1)
_CTR = const(2)
_CC = const(3)
_TOP = const(4)
_SLICE = const(5)  # words from one slice to the next
_EN = const(40)  # the enable bits of all slices, so that they start in one cycle
_INTR = const(41)  # one bit a slice: has wrapped; cleared by writing it

_TIME = const(10)  # words of the timer block: TIMERAWL, µs since power-on

_INVERT_B = const(8)  # CSR
_PUMP_SLICE = const(7)
_PUMP_TOP = const(6249)  # 20 kHz at 125 MHz: above hearing


@micropython.viper
def start(registers, slices: int, tick_us: int, mhz: int):
    """Run slices 0 to `slices` - 1 at the tick's rate and in phase, all valves safe, and the pump's slice, at rest."""
    pwm = ptr32(registers)
    pwm[_EN] = 0
    at = 0
    i = 0
    while i < slices:
        pwm[at + _CSR] = _INVERT_B
        pwm[at + _DIV] = mhz << 4
        pwm[at + _CTR] = 0
        pwm[at + _CC] = tick_us << 16  # fill closed, vent left open
        pwm[at + _TOP] = tick_us - 1
        at += _SLICE
        i += 1
    at = _PUMP_SLICE * _SLICE
    pwm[at + _CSR] = 0
    pwm[at + _DIV] = 1 << 4
    pwm[at + _CTR] = 0
    pwm[at + _CC] = 0
    pwm[at + _TOP] = _PUMP_TOP
    pwm[_INTR] = 255
    pwm[_EN] = (1 << slices) - 1 | 1 << _PUMP_SLICE


@micropython.viper
def write(registers: ptr32, pulses: ptr16, bubbles: int, duty: int):
    """Set the next period: open times, µs, of fill and vent of every bubble; and the pump, 0 to 65535."""
    at = _CC
    i = 0
    while i < bubbles:
        registers[at] = pulses[2 * i] | pulses[2 * i + 1] << 16
        at += _SLICE
        i += 1
    registers[_PUMP_SLICE * _SLICE + _CC] = duty * (_PUMP_TOP + 1) + 65534 >> 16


@micropython.viper
def vent(registers: ptr32, bubbles: int, tick_us: int):
    """Fill closed and vent open in the next period, pump off."""
    at = _CC
    while bubbles > 0:
        registers[at] = tick_us << 16
        at += _SLICE
        bubbles -= 1
    registers[_PUMP_SLICE * _SLICE + _CC] = 0


@micropython.viper
def phase(registers) -> int:
    """Microseconds since slice 0 has wrapped."""
    return ptr32(registers)[_CTR]


@micropython.viper
def wrapped(registers) -> int:
    """Whether slice 0 has wrapped since the last time this was asked."""
    pwm = ptr32(registers)
    if pwm[_INTR] & 1:
        pwm[_INTR] = 1
        return 1
    return 0


@micropython.viper
def begin(registers: ptr32, timer: ptr32, began: ptr32, tick_us: int) -> int:
    """Note in `began[0]` when the period that runs began, on the timer (4.6); returns how many have since the last."""
    now = timer[_TIME] - registers[_CTR]
    periods = (now - began[0] + (tick_us >> 1)) // tick_us
    began[0] = now
    return periods


@micropython.viper
def elapsed(timer: ptr32, began: ptr32) -> int:
    """Microseconds since the period began."""
    return timer[_TIME] - began[0]
