"""Simulated wristbands: the real firmware, run one way or another, against one plant in virtual time."""

from bubbleskin.sim.board import Board, SimulatedBoard
from bubbleskin.sim.impairment import Impairment, LossyTransport
from bubbleskin.sim.transport import SimulatedTransport, open_board

__all__ = ["Board", "Impairment", "LossyTransport", "SimulatedBoard", "SimulatedTransport", "open_board"]
