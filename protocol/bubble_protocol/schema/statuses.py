"""What one bubble is doing."""

# What one bubble is doing.
RESTING, MOVING, SETTLED, STOPPED, FAULT, UNSURE = range(6)
STATUSES = (
    (RESTING, "resting", "vent open, no pressure wanted"),
    (MOVING, "moving", "on its way to its target"),
    (SETTLED, "settled", "at its target, by an estimate that is sure enough"),
    (STOPPED, "stopped", "valves closed, not controlled"),
    (FAULT, "fault", "isolated and vented; see its faults"),
    (UNSURE, "unsure", "at its target as far as is known, but that is not known well enough"),
)
