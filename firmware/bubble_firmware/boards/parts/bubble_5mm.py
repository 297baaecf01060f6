"""Bubbles of 5 mm with their valves, lines and sensors: limits and figures of every board that has them."""

# Limits of the hardware. Nothing on the wire can raise them.
HEIGHT_REST_UM = 5000
HEIGHT_MAX_UM = 14000
PRESSURE_MAX_PA = 42000  # 14 mm takes 34 kPa, air in motion 5 kPa more
AIR_MAX_UJ = 232000  # in bubble and line at HEIGHT_MAX_UM, by its table: 40.4 kPa there, a sheet half as stiff again
FILL_MAX_US = 1000000  # longest a fill valve may stay open at a time; 5 to 14 mm takes 0.4 s
SUPPLY_PA = 60000
SUPPLY_MAX_PA = 75000
SUPPLY_LOW_PA = 45000  # less for long and the supply is lost: a bubble at its limit could not be filled
BUDGET_KPA_S = 3600  # pressure above the next line times time, for each bubble: a limit of comfort, not a medical one
BUDGET_FREE_PA = 20000  # 7 mm; what is below it recovers. 30 kPa may stay for 6 minutes

SEQUENCE_BYTES = 49152  # memory for the steps of a sequence

# Sensors: counts to pascals.
SENSOR_ZERO = 160
SENSOR_PA_PER_COUNT = 17
SUPPLY_ZERO = 160
SUPPLY_PA_PER_COUNT = 25
COUNT_LOW = 8  # at or beyond these a sensor is not believed
COUNT_HIGH = 4087
FROZEN_US = (
    300000  # one that says the same for so long is not read: noise is 3 counts. Half a count would be too little
)

# Valves and lines.
VALVE_OPENS_US = 1200
VALVE_CLOSES_US = 1000
PULSE_MIN_US = 1500
CONDUCTANCE = 3800  # sonic conductance of valve and 0.2 mm restrictor, 1e-6 dm³/(s bar)
CRITICAL_RATIO = 128  # of the restrictor, /256
DEAD_VOLUME_MM3 = 200  # valve node and tube
TUBE_PA_PER_FLOW = 4  # pressure lost along the tube, Pa per µJ/ms
QUIET_US = 7000  # after a valve has closed, until tube and membrane have settled and the sensor reads the bubble

# Control, in 1/256.
GAIN_P = 230
GAIN_D = 16
DEADBAND_UM = 30  # no dose for less
SETTLED_UM = 120  # a bubble this near its target counts as there,
SURE_UM = 180  # and as settled where its height is known as well as that: one standard deviation
FLOW_SD = 3900  # how far restrictors are from CONDUCTANCE, share, *65536: 6 %, without calibration
CURVE_SD = 6554  # and pressures from the table's, the memory of the rubber included: 10 %
