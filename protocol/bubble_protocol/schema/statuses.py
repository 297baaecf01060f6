"""What one bubble is doing."""

# What one bubble is doing.
RESTING, MOVING, SETTLED, STOPPED, FAULT = range(5)
STATUSES = (
    (RESTING, "resting", "vent open, no pressure wanted"),
    (MOVING, "moving", "on its way to its target"),
    (SETTLED, "settled", "at its target"),
    (STOPPED, "stopped", "valves closed, not controlled"),
    (FAULT, "fault", "isolated and vented; see its faults"),
)
