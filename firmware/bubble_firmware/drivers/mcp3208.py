"""MCP3208: eight 12-bit inputs on SPI mode 0 (Microchip DS21298E, section 5 and figure 6-1).

Three bytes a conversion, chip select low for their time: five zeros, the start bit, single-ended, then the
channel's three bits; the answer has a zero (the "null bit") before its 12 bits:

    out  0000 01 1 c2 | c1 c0 000000 | 00000000
    in   ........     | ...0 bbbb    | bbbbbbbb

Where no chip drives the line the pull-up makes the null bit one. 2 MHz are allowed at 5 V, 1 MHz at 2.7 V.

The bytes go through the registers of the RP2040's SPI (PL022; RP2040 datasheet, 4.4) and its GPIO (2.3.1),
which `machine.SPI` and `machine.Pin` have set up: `registers` and `gpio` are their addresses; a test passes
objects that stand for them.
"""

from bubble_protocol.mpy_compat import const, micropython, ptr16, ptr32

SPI0 = 0x4003C000
SIO = 0xD0000000

# [constants] bubble_firmware.hal.base: ABSENT
# [constants] bubble_firmware.drivers.sio: GPIO_OUT_SET GPIO_OUT_CLR
_ABSENT = const(65535)
_GPIO_OUT_SET = const(5)
_GPIO_OUT_CLR = const(6)
# [end of constants]

_DR = const(2)  # words of the SPI block
_SR = const(3)
_BUSY = const(16)  # SR
_NOT_EMPTY = const(4)
_HIGH = const(8)  # turns that are at least the 500 ns that the chip must be deselected


@micropython.viper
def read(registers, gpio, select: int, channels: int, counts, at: int) -> int:  # type: ignore[no-untyped-def]
    """Convert channels 0 to `channels` - 1 into `counts[at:]`; returns how many were answered.

    `select` is the chip select's GPIO. A channel without an answer is ABSENT.
    """
    spi = ptr32(registers)
    pin = ptr32(gpio)
    count = ptr16(counts)
    mask = 1 << select
    answers = 0
    while spi[_SR] & _NOT_EMPTY:  # left by an interrupted conversion
        spi[_DR]
    channel = 0
    while channel < channels:
        pin[_GPIO_OUT_CLR] = mask
        spi[_DR] = 6 | channel >> 2
        spi[_DR] = (channel & 3) << 6
        spi[_DR] = 0
        while spi[_SR] & _BUSY:
            pass
        pin[_GPIO_OUT_SET] = mask
        spi[_DR]
        high = spi[_DR]
        low = spi[_DR]
        if high & 16:
            count[at] = 0xFFFF
        else:
            count[at] = (high & 15) << 8 | low
            answers += 1
        at += 1
        channel += 1
        wait = _HIGH
        while wait > 0:
            wait -= 1
    return answers
