"""Where each number of the control state stands: the board's numbers, then the tables of roots, the rows, the curves.

All of it is one array of 32-bit integers (`Bubbles`), a row for every bubble. The functions that compute on it are viper
on the device: offsets below 32 are cheap to reach there, so that is where a row has what every tick needs. Other device
files repeat these names in regions that tools/generate/constants.py writes.

Air is in µJ: 1 µJ = 1 kPa mm³ of pV content in bubble and line, isothermal.
"""

from bubble_protocol.mpy_compat import const

# A bubble's row. The first four are its trim, in the order of `trim`.
SENSOR_ZERO = const(0)  # counts at no pressure
OPENS_US = const(1)  # valve dead times
CLOSES_US = const(2)
FLOW_GAIN = const(3)  # root of pressures (8 Pa) to flow (µJ/ms), /65536
PRESSURE = const(4)  # measured, Pa gauge
SUSPECT = const(5)  # whether the last reading was one that may become a fault
QUIESCENT = const(6)  # whether nothing is under way
DECIMATION_LEFT = const(7)  # readings yet to be summed before the mean is taken; -1: there is no sum
DECIMATION_SUM = const(8)  # of pressures, Pa
SETTLING_US = const(9)  # from the start of the period until the line is quiet
AIR = const(10)  # at the start of this period, µJ
AIR_IN_FLIGHT = const(11)  # what the period now playing brings, µJ
AIR_QUEUED = const(12)  # what the period after it will bring, µJ
SAMPLES = const(13)  # how many readings the estimate averages; 0: none yet
FLOW = const(14)  # at the last dose, µJ/ms, *16, filling or venting
INTEGRAL = const(15)  # of the error, µJ ticks
ERROR = const(16)  # last tick's, µJ
PREVIOUS_SETPOINT_AIR = const(17)  # last tick's, µJ
FILL_US = const(18)  # energised in the period now playing
VENT_US = const(19)
FILL_RUN_US = const(20)  # how long the fill valve has been open at a stretch
FAULTS = const(21)
STATUS = const(22)
TARGET = const(23)  # asked, µm
HEIGHT = const(24)  # the estimate, in 1/16 µm, so that averages do not stall on whole ones
HEIGHT_SEGMENT = const(25)  # where its segment of the curve begins, bytes
HEIGHT_SLOPE = const(26)  # air per height in that segment, µJ/µm, *256
DUE = const(27)  # whether it is measured and decided upon in this tick
SETPOINT = const(28)  # in 1/16 µm
SETPOINT_SEGMENT = const(29)
SETPOINT_SLOPE = const(30)
SETPOINT_AIR = const(31)  # µJ
RAMP_START = const(32)  # where the ramp to the target began, µm
RAMPING = const(33)  # whether the setpoint is not at its target yet
HOLD_OUTPUT = const(34)  # whether the next tick goes on as this one
FIRST_SEGMENT = const(35)  # of its curve, bytes
LAST_SEGMENT = const(36)
LOWEST_PRESSURE = const(37)  # of its curve, Pa
HIGHEST_PRESSURE = const(38)
OVERPRESSURE_TICKS = const(39)  # in a row above the pressure limit
LOST_TICKS = const(40)  # in a row with the sensor at an end of its range
ROW_WORDS = const(41)

# A knot of a curve, see `curve`.
KNOT_HEIGHT = const(0)  # 1/16 µm
KNOT_AIR = const(1)  # µJ
KNOT_PRESSURE = const(2)  # Pa
KNOT_SLOPE = const(3)  # air per height from here on, µJ/µm, *256
KNOT_RECIPROCAL = const(4)  # of the slope, 2^28/slope
KNOT_WORDS = const(5)

# The board's numbers.
BUBBLE_COUNT = const(0)
TICK_US = const(1)
PA_PER_COUNT = const(2)
COUNT_LOW = const(3)
COUNT_HIGH = const(4)
PRESSURE_MAX = const(5)
FILL_MAX_US = const(6)
PULSE_MIN_US = const(7)
QUIET_US = const(8)  # from the closing of a valve until the line is quiet
TUBE_PA = const(9)  # pressure lost along the tube, Pa per µJ/ms
GAIN_P = const(10)  # gains *256
GAIN_I = const(11)
GAIN_D = const(12)
DEADBAND_UM = const(13)
SETTLED_UM = const(14)
REST_UM = const(15)
CONTROL_MODE = const(16)  # of the last tick
RAMP_DONE = const(17)  # ticks
RAMP_TICKS = const(18)
RAMP_SHARE = const(19)  # how much of it is done, *4096
BOARD_WORDS = const(20)

# The tables of roots, see `flow`; then the rows; after them the curves.
ROOTS = const(20)
ROOT_STEPS = const(64)  # in each of the two tables
ROWS = const(150)

ATMOSPHERE = const(101325)  # Pa
READINGS_MIN = const(2)  # in a row that make a fault: one alone is noise

# The law's own numbers, the same for all boards.
SAMPLES_MAX = const(64)
SAMPLES_DOSED = const(16)  # left after a short dose, which is metered well
INNOVATION_UM = const(500)  # further off than metering ever is,
INNOVATION_PA = const(500)  # by more than noise: believe the sensor afresh
DECIMATION = const(3)  # readings of a quiescent bubble that are summed before the one that makes the mean
INTEGRAL_MAX = const(1 << 17)  # µJ ticks
DOSE_MAX = const(50000)  # µJ, more than any period brings

# What control is to do with all bubbles: open the vents, follow the setpoints, keep all valves closed.
VENT = const(0)
FOLLOW = const(1)
KEEP_CLOSED = const(2)
