"""The membrane: the model of one bubble, its fit to measurements and the tables that the firmware runs on."""

from bubbleskin.membrane.balloon import Jump, LimitPoint, YeohBalloon, yeoh_pressure
from bubbleskin.membrane.calibration import Calibration, compare_tables, table_difference
from bubbleskin.membrane.data import BadRowWarning, Measurements, read_csv, write_csv
from bubbleskin.membrane.fit import (
    IdentifiabilityWarning,
    LackOfFitWarning,
    Noise,
    Parameters,
    UnlikelyFitWarning,
    YeohFit,
    fit_yeoh,
)
from bubbleskin.membrane.presets import PRESETS, Preset, preset
from bubbleskin.membrane.sheet import SheetFit, fit_measurements, fit_sheet
from bubbleskin.membrane.synthetic import simulate_sheet
from bubbleskin.membrane.table import Table, TableError, build_table

__all__ = [
    "PRESETS",
    "BadRowWarning",
    "Calibration",
    "IdentifiabilityWarning",
    "Jump",
    "LackOfFitWarning",
    "LimitPoint",
    "Measurements",
    "Noise",
    "Parameters",
    "Preset",
    "SheetFit",
    "Table",
    "TableError",
    "UnlikelyFitWarning",
    "YeohBalloon",
    "YeohFit",
    "build_table",
    "compare_tables",
    "fit_measurements",
    "fit_sheet",
    "fit_yeoh",
    "preset",
    "read_csv",
    "simulate_sheet",
    "table_difference",
    "write_csv",
    "yeoh_pressure",
]
