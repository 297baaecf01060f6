"""The RP2040's watchdog (RP2040 datasheet, 4.7), as far as `machine.WDT` does not give it. Only `feed` is for the tick."""

import machine

from bubble_protocol.mpy_compat import const, micropython, ptr32

_CTRL = 0x40058000
_CTRL_CLEAR = _CTRL + 0x3000  # the alias that clears bits
_SCRATCH0 = 0x4005800C  # kept through every reset but power's
_SCRATCH4 = 0x4005801C
_LOAD = const(1)  # word of the block
_ENABLE = 1 << 30
_TIMED_OUT = 0x6AB73121  # what the SDK leaves in SCRATCH4 while the watchdog runs, but not before a wanted reset


def has_bitten() -> bool:
    """Whether this boot follows a time-out, not a wanted reset."""
    return machine.reset_cause() == machine.WDT_RESET and machine.mem32[_SCRATCH4] == _TIMED_OUT


def stop() -> None:
    """Let the chip live without being fed."""
    machine.mem32[_CTRL_CLEAR] = _ENABLE


def count_boot() -> int:
    """How many boots there have been since power came, this one included; anything before the first."""
    count = (machine.mem32[_SCRATCH0] & 0xFFFF) + 1
    machine.mem32[_SCRATCH0] = count
    return count


@micropython.viper
def feed(ms: int):  # type: ignore[no-untyped-def]
    """As `WDT.feed`, faster. The counter loses two every microsecond (erratum RP2040-E1)."""
    ptr32(0x40058000)[_LOAD] = ms * 2000
