"""What a compiled plant works on: arrays of records, one per bubble, and how far its model goes."""

from dataclasses import fields

import numpy as np

from bubbleskin.sim.parameters import PlantParameters, Supply

STRETCH_MIN, STRETCH_MAX = 0.8, 6.0
"""Where the model ends: a membrane under suction buckles, an over-inflated one slips off its barb."""

DRAG = 0.05
"""What slows a centre down, N·s/m: it follows its springs within milliseconds, much faster than air flows. Small
enough not to show, large enough for steps of 50 µs: h k < 2 DRAG even where six neighbours push (1800 N/m)."""

FAILURES = ("leak", "pop_off", "fill_stuck", "vent_stuck", "sensor_stuck", "sensor_absent", "sensor_bias")
"""What can be made to fail, all 0 when healthy; `Plant.inject` says what the values mean."""

SUPPLY_FAILURES = (
    "supply_stuck",
    "supply_flat",
    "supply_bias",
    "supply_absent",
    "relief_stuck",
    "pump_off",
    "dump_stuck",
)
"""The same of the reservoir."""

REAL = (
    "node_air",
    "line_air",
    "stress",
    "quick",
    "slow",
    "largest",
    "quick_left",
    "quick_new",
    "slow_left",
    "slow_new",
)
"""What only `rubber="real"` moves: air of node and of line and sphere (pV at the reference temperature, J), elastic stress
and the overstress of both branches (Pa), the largest stretch so far, and what a step does to both branches."""

STATE = np.dtype(
    [(name, "f8") for name in ("stretch", "pressure", "node", "membrane")]
    + [(f"{valve}_{name}", "?") for valve in ("fill", "vent") for name in ("energised", "open")]
    + [(f"{valve}_{name}", "f8") for valve in ("fill", "vent") for name in ("since", "start", "stop")]
    + [(name, "f8") for name in (*FAILURES, *REAL)],
    align=True,
)
AIR = np.dtype([(name, "f8") for name in ("pressure", "pumped", "vented", *SUPPLY_FAILURES, "air")])
SUPPLY = np.dtype([(f.name, "f8") for f in fields(Supply)])
CONSTANTS = np.dtype([(name, "f8") for name in PlantParameters.each()])
