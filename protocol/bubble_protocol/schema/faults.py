"""What can go wrong, as bits: of one bubble, of the board as a whole, and events that are only written down."""

# Faults of one bubble, as bits. The bubble is isolated: fill closed, vent open, until they are acknowledged.
OVERPRESSURE, SENSOR_LOST, VALVE_TIME, LEAK, NO_AIR, VALVE_STUCK, SENSOR_STUCK, BUDGET = 1, 2, 4, 8, 16, 32, 64, 128
FAULTS = (
    (OVERPRESSURE, "overpressure", "pressure above the board's limit"),
    (SENSOR_LOST, "sensor_lost", "the sensor reads the end of its range: broken wire or missing chip"),
    (VALVE_TIME, "valve_time", "the fill valve was open longer than the board allows at a time"),
    (
        LEAK,
        "leak",
        "air escapes: a leak, a bubble off its barb, a vent valve that does not close; or a sensor that has fallen",
    ),
    (NO_AIR, "no_air", "air does not arrive: a fill valve that does not open, a kinked or lost tube"),
    (
        VALVE_STUCK,
        "valve_stuck",
        "pressure that nobody asked for: a fill valve that does not close, a vent that does not open",
    ),
    (SENSOR_STUCK, "sensor_stuck", "the sensor says what cannot be: always the same count, or a leap"),
    (BUDGET, "budget", "under pressure for too long: its budget of pressure and time is used up, see settings"),
)

# Faults of the board as a whole, as bits. They stay until CLEAR.
ESTOP, SUPPLY_LOST, VALVE_CHIP, SENSOR_CHIP, EXCEPTION, WATCHDOG, SELF_TEST, OVERFILLED = 1, 2, 4, 8, 16, 32, 64, 128
BOARD_FAULTS = (
    (ESTOP, "emergency_stop", "the emergency stop is pressed, or its loop is broken: everything vents"),
    (
        SUPPLY_LOST,
        "supply_lost",
        "the reservoir stays below the pressure that is needed, or its sensor cannot be believed: everything vents, "
        "the pump stops, the reservoir is emptied",
    ),
    (VALVE_CHIP, "valve_chip", "a valve driver does not answer: everything vents"),
    (SENSOR_CHIP, "sensor_chip", "a converter does not answer: its bubbles vent"),
    (EXCEPTION, "exception", "an exception in the firmware: everything vented"),
    (WATCHDOG, "watchdog", "the firmware hung and was restarted by the watchdog: everything vented"),
    (SELF_TEST, "self_test", "the self-test at boot found a sensor or a valve that does not work, see INFO"),
    (
        OVERFILLED,
        "overfilled",
        "a bubble fills though its fill valve is closed and its vent open: everything vents, the reservoir is emptied",
    ),
)
VENTING = ESTOP | SUPPLY_LOST | VALVE_CHIP | OVERFILLED  # while one of these stands, SHOW is refused
SHUTTING = SUPPLY_LOST | OVERFILLED  # while one of these does, the pump stands and the dump valve is open

# What else is written to the fault log: it forbids nothing. Bits beyond those of the board's faults.
HOST_SILENT = 256
EVENTS = (
    (
        HOST_SILENT,
        "host_silent",
        "the host was silent in ACTIVE or HOLDING: held, then vented. The value is how long, ms",
    ),
)
BOARD = 255  # in place of a bubble's number

# What has a fault stays isolated for at least so long, ms, however early it is acknowledged: twice what empties a full bubble.
ISOLATION_MS = 1000
