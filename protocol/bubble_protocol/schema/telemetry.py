"""What SUBSCRIBE_FIELDS can choose of every bubble, as bits: name, unit, how many of the unit one stands for, meaning."""

# What SUBSCRIBE_FIELDS can choose of every bubble, as bits: name, unit, how many of the unit one stands for, meaning.
COLUMNS = (
    (1, "height", "µm", 1, "estimated height"),
    (2, "pressure", "Pa", 4, "gauge pressure at the sensor"),
    (4, "target", "µm", 1, "height asked"),
    (8, "status", "", 1, "see bubble status"),
    (16, "faults", "", 1, "see faults, bits"),
    (32, "setpoint", "µm", 1, "where the way to the target stands now"),
    (64, "fill", "µs", 1, "how long the fill valve is energised in this period"),
    (128, "vent", "µs", 1, "the same of the vent valve"),
    (256, "sd", "µm", 1, "standard deviation of the estimated height"),
)
