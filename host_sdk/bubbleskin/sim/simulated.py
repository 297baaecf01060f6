"""What every simulated wristband has, whichever way its firmware is run."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bubbleskin.sim.plant import Plant


class Simulated(Protocol):
    """A wristband in virtual time: it moves only when it is stepped, or when something waits on its link.

    `SimulatedBoard` (`sim://` and `micropython://`) is one, `Rp2040Board` (`rp2040://`) another.
    """

    name: str
    """The board's."""
    tick_s: float
    """Period of the control loop, s."""
    plant: Plant
    """The bubbles, valves and sensors."""
    to_device: bytearray
    from_device: bytearray

    @property
    def time(self) -> float:
        """Virtual seconds since the start."""

    @property
    def height_mm(self) -> NDArray[np.float64]:
        """The true heights, which the firmware can only estimate, (n,)."""

    def step(self, dt: float) -> None:
        """Let `dt` virtual seconds pass, in whole ticks; what is left over comes with the next step."""

    def tick(self) -> None:
        """Let one period pass."""

    def listen(self, phase_us: int) -> None:
        """Let the firmware answer what has come over the link, `phase_us` after a period has begun."""

    def inject(self, fault: str, number: int, value: float = 1.0, /) -> None:
        """Give bubble or part `number` a fault, as of `bubbleskin.sim.plant.Plant.inject`; a value of 0 takes it away."""

    def close(self) -> None:
        """End the firmware."""
