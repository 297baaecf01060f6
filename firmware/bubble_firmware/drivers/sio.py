"""Words of the RP2040's SIO block, as others repeat them (datasheet 2.3.1.7)."""

from bubble_protocol.mpy_compat import const

GPIO_OUT_SET = const(5)
"""Pins as bits: those that become high."""
GPIO_OUT_CLR = const(6)
"""Those that become low."""
