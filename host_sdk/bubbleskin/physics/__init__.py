"""The membrane: the model of one bubble, its fit to measurements and the tables that the firmware runs on."""

from bubbleskin.physics.balloon import Jump, LimitPoint, YeohBalloon, yeoh_pressure
from bubbleskin.physics.table import Table, TableError, build_table

__all__ = ["Jump", "LimitPoint", "Table", "TableError", "YeohBalloon", "build_table", "yeoh_pressure"]
