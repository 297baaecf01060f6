"""Simulated wristbands: the real firmware, run one way or another, against one plant in virtual time."""

from bubbleskin.sim.board import SimulatedBoard
from bubbleskin.sim.faults import Faults, LossyTransport
from bubbleskin.sim.simulated import Simulated
from bubbleskin.sim.transport import SimulatedTransport, open_board

__all__ = ["Faults", "LossyTransport", "Simulated", "SimulatedBoard", "SimulatedTransport", "open_board"]
