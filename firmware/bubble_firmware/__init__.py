"""The wristband's firmware. Everything except boards' drivers runs unchanged on CPython and MicroPython."""
