"""Heights in, shapes out: the SDK of the bubbleskin wristbands."""

from bubbleskin.physics.balloon import YeohBalloon
from bubbleskin.physics.table import Table, build_table

__all__ = ["Table", "YeohBalloon", "build_table"]
