"""Simulated wristbands: the real firmware, run one way or another, against one plant in virtual time."""

from bubbleskin.sim.board import Simulated, SimulatedBoard
from bubbleskin.sim.impairment import Impairment, LossyTransport
from bubbleskin.sim.transport import SimulatedTransport, open_board

__all__ = ["Impairment", "LossyTransport", "Simulated", "SimulatedBoard", "SimulatedTransport", "open_board"]
