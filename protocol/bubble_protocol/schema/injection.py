"""What INJECT makes fail, on the device itself."""

# What INJECT makes fail. No fill pulse becomes longer than was decided, no vent pulse shorter; and what is decided by sensors
# that fail so keeps its promises, as with those that really do.
INJECTION, SENSOR_MISSING, SENSOR_STUCK, SENSOR_HIGH, FILL_SHUT, VENT_OPEN, SUPPLY_MISSING, SUPPLY_EMPTY, PUMP_OFF = (
    range(9)
)
INJECTIONS = (
    (INJECTION, "injection", "all that follows: permitted until the next start, or mended and forbidden"),
    (SENSOR_MISSING, "sensor_missing", "a bubble's sensor reads 0 counts"),
    (SENSOR_STUCK, "sensor_stuck", "it says for ever what it has just said"),
    (SENSOR_HIGH, "sensor_high", "it says 3 kPa too much"),
    (FILL_SHUT, "fill_shut", "a bubble's fill valve gets no pulse"),
    (VENT_OPEN, "vent_open", "a bubble's vent valve stays open"),
    (SUPPLY_MISSING, "supply_missing", "the reservoir's sensor reads 0 counts"),
    (SUPPLY_EMPTY, "supply_empty", "the pump gets no current, and the reservoir is emptied"),
    (PUMP_OFF, "pump_off", "the pump gets no current"),
)
