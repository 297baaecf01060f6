"""The device's viper functions compiled on this computer too: the same integers, many times faster.

`enable()` is called by whoever runs the firmware in process. `BUBBLESKIN_JIT=0` leaves the functions as the plain Python
that they are; `BUBBLESKIN_JIT=check` runs them as plain Python that checks that no intermediate leaves 32 bits.
"""

from bubbleskin.sim.jit.install import compile_module, enable, waiting

__all__ = ["compile_module", "enable", "waiting"]
