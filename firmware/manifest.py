"""What is frozen into the RP2040's MicroPython: the protocol, the firmware, and the port's own start-up modules.

`bubbleskin firmware build` uses it, and so can a MicroPython checkout:

    make -C ports/rp2 BOARD=RPI_PICO FROZEN_MANIFEST=/path/to/firmware/manifest.py \\
        USER_C_MODULES=/path/to/firmware/micropython.cmake

The start, a `main.py` with the board's name, is added by `bubbleskin firmware build`, which knows the board.
"""
# ruff: noqa: F821 - the functions are those of MicroPython's tools/manifestfile.py

freeze("$(PORT_DIR)/modules")
package("bubble_protocol", base_path="../protocol", opt=3)
package("bubble_firmware", base_path=".", opt=3)
