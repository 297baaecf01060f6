"""Where each number of the control state stands: the board's numbers, then the tables of roots, the rows, the curves.

All of it is one array of 32-bit integers (`Bubbles`), a row for every bubble. The functions that compute on it are viper
on the device: offsets below 32 are cheap to reach there, so that is where a row has what every tick needs. Other device
files repeat these names in regions that tools/generate/constants.py writes.

Air is in µJ: 1 µJ = 1 kPa mm³ of pV content in bubble and line, isothermal. Volumes are in units of 1000/65536 mm³, so that
volume times pressure in 16 Pa is air times 4096: no division.
"""

from bubble_protocol.mpy_compat import const

# A bubble's row. The first ten are its trim, in the order of `trim`; those of the vent valve after those of the fill valve.
SENSOR_ZERO = const(0)  # counts at no pressure
FILL_OPENS_US = const(1)  # valve dead times
FILL_CLOSES_US = const(2)
FILL_GAIN = const(3)  # root of pressures (8 Pa) to flow (µJ/ms), /65536
VENT_OPENS_US = const(4)
VENT_CLOSES_US = const(5)
VENT_GAIN = const(6)
FLOW_SD = const(7)  # of the flow gains, share *65536
CURVE_SD = const(8)  # of the curve and of the rubber's memory, share *65536
LEAK_RATE = const(9)  # air lost, µJ/s per kPa, *16
PRESSURE = const(10)  # measured, Pa gauge
SUSPECT = const(11)  # whether the last reading was one that may become a fault
QUIESCENT = const(12)  # 1 where nothing is under way, HELD where its valve stays open for a period more
READINGS = const(13)  # of a quiet line, in the sum
READINGS_SUM = const(14)  # Pa
SETTLING_US = const(15)  # from the start of the period until the line is quiet
AIR = const(16)  # at the start of this period, µJ
AIR_IN_FLIGHT = const(17)  # what the period now playing brings, µJ
FILL_FLOW = const(18)  # at this moment's pressures, were the valve open, µJ/ms, *16; 0 where that has not been asked
VENT_FLOW = const(19)
FILL_US = const(20)  # energised in the period now playing
VENT_US = const(21)
FILL_FULL = const(22)  # whether it is still open when that ends
VENT_FULL = const(23)
DUE = const(24)  # whether it is measured and decided upon in this tick
STATUS = const(25)
HEIGHT = const(26)  # the estimate, in 1/16 µm
HEIGHT_SEGMENT = const(27)  # where its segment of the curve begins, bytes
SETPOINT_AIR = const(28)  # µJ
PREVIOUS_SETPOINT_AIR = const(29)  # last tick's, µJ
RAMPING = const(30)  # whether the setpoint is not at its target yet
FILL_OPEN_US = const(31)  # how long the valve is open in the period now playing
VENT_OPEN_US = const(32)
SETPOINT = const(33)  # in 1/16 µm
ERROR = const(34)  # last tick's, µJ
AIR_METERED = const(35)  # what the valves have brought in the period that ended, µJ
FAULTS = const(36)
TARGET = const(37)  # asked, µm
SETPOINT_SEGMENT = const(38)
SETPOINT_VOLUME = const(39)  # of bubble and line
SETPOINT_PRESSURE = const(40)  # by the curve, Pa
SETPOINT_SLOPE = const(41)  # volume per µm there, *256
RAMP_START = const(42)  # where the ramp to the target began, µm
FILL_RUN_US = const(43)  # how long the fill valve has been open at a stretch
FIRST_SEGMENT = const(44)  # of its curve, bytes
LAST_SEGMENT = const(45)
OVERPRESSURE_TICKS = const(46)  # in a row above the pressure limit
LOST_TICKS = const(47)  # in a row with the sensor at an end of its range
EMPTY_TICKS = const(48)  # in a row without pressure
# What is known, and how well: see `reference`.
AIR_SD = const(49)  # of the air, µJ
CURVE_ERROR = const(50)  # share by which the pressure is above the curve's, *65536
CURVE_ERROR_SD = const(51)  # *65536
CORRELATION = const(52)  # of the two errors, *4096
HEIGHT_SD = const(53)  # µm, as `deviations` last found it
PRESSURE_RATIO = const(54)  # share by which the quiet line's pressure is above the curve's, averaged, *4096
DWELL_HEIGHT = const(55)  # where the bubble stood when the curve was first asked in this dwell, µm
DWELL_SLOPE = const(56)  # pressure per height there, Pa/µm, *1024; 0: not yet known
REFERENCE_TICK = const(57)  # when it was last asked
PEAK = const(58)  # greatest height lately, 1/16 µm
QUIET_PRESSURE = const(59)  # mean of the last readings of a quiet line, Pa
FAR_TICKS = const(60)  # in a row with a pressure that the metered air cannot have
LEAKED = const(61)  # of it not yet taken off
REZERO = const(62)  # whether it is being emptied before it goes to its target
LEAK_TICK = const(63)  # when that was reckoned
FAR = const(64)  # whether they have become too many
AIR_SLOPE = const(65)  # air per height at this pressure, µJ/µm, *64
CURVE_PRESSURE = const(66)  # of the curve at this height, Pa
CURVE_BEND = const(67)  # how much less it is than on the secant, Pa
CURVE_SLOPE = const(68)  # of the secant, Pa/µm, *1024
READINGS_BITS = const(69)  # so many readings make its next mean, as a power of two
ROW_WORDS = const(70)

# A knot of a curve, see `curve`.
KNOT_HEIGHT = const(0)  # 1/16 µm
KNOT_VOLUME = const(1)  # of bubble and line
KNOT_PRESSURE = const(2)  # Pa
KNOT_SLOPE = const(3)  # volume per µm from here on, *256
KNOT_RECIPROCAL = const(4)  # of the slope, 2^28/slope
KNOT_RISE = const(5)  # pressure per 1/16 µm from here on, Pa *4096
KNOT_WORDS = const(6)

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
GAIN_D = const(11)
DEADBAND_UM = const(12)
SETTLED_UM = const(13)
REST_UM = const(14)
CONTROL_MODE = const(15)  # of the last tick
RAMP_DONE = const(16)  # ticks
RAMP_TICKS = const(17)
RAMP_SHARE = const(18)  # how much of it is done, *4096
TICK = const(19)  # number of this one, from 0 again after LATEST
SUPPLY_SCALE = const(20)  # absolute pressure of the supply, 8 Pa
SUPPLY_RECIPROCAL = const(21)
SECOND = const(22)  # ticks
ATMOSPHERE_PA = const(23)
SURE_UM = const(24)  # standard deviation up to which a height is known
REZERO_UM = const(25)  # from which a bubble is emptied before it goes elsewhere; 0: never
LEAK_SHARE = const(26)  # of the leak's reckoning in a µJ
BOARD_WORDS = const(27)

# The tables of roots, see `flow`; then the rows; after them the curves.
ROOTS = const(27)
ROOT_STEPS = const(64)  # in each of the two tables
ROWS = const(157)

ATMOSPHERE = const(101325)  # Pa
READINGS_MIN = const(2)  # in a row that make a fault: one alone is noise

# The law's own numbers, the same for all boards.
READINGS_BITS_FIRST = const(3)  # of a line that has become quiet, eight readings make the first mean,
READINGS_BITS_NEXT = const(5)  # and 32 each that follows
AIR_SD_MAX = const(60000)  # µJ
EMPTY_PA = const(1000)  # a line that has no more for a while is empty: the best reference there is
EMPTY_US = const(15000)
HELD = const(2)
RESTART = const(256)  # of what `estimate` returns
DOSE_MAX = const(50000)  # µJ, more than any period brings
ROOT_END = const(8191)  # the last place in a table of roots, *128

# What control is to do with all bubbles: open the vents, follow the setpoints, keep all valves closed.
VENT = const(0)
FOLLOW = const(1)
KEEP_CLOSED = const(2)
