"""The RP2040's watchdog (RP2040 datasheet, 4.7), as far as `machine.WDT` does not give it. Not for the tick."""

import machine

_CTRL = 0x40058000
_CTRL_CLEAR = _CTRL + 0x3000  # the alias that clears bits
_SCRATCH0 = 0x4005800C  # kept through every reset but power's
_SCRATCH4 = 0x4005801C
_ENABLE = 1 << 30
_TIMED_OUT = 0x6AB73121  # what the SDK leaves in SCRATCH4 while the watchdog runs, but not before a wanted reset


def has_bitten():
    """Whether this boot follows a time-out, not a wanted reset."""
    return machine.reset_cause() == machine.WDT_RESET and machine.mem32[_SCRATCH4] == _TIMED_OUT


def stop():
    """Let the chip live without being fed."""
    machine.mem32[_CTRL_CLEAR] = _ENABLE


def count_boot():
    """How many boots there have been since power came, this one included; anything before the first."""
    count = (machine.mem32[_SCRATCH0] & 0xFFFF) + 1
    machine.mem32[_SCRATCH0] = count
    return count
