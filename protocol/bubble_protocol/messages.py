"""Every message of the protocol, as plain data: the one source of codec, limits, documentation and golden vectors.

A field is (name, kind, unit, low, high, meaning). Limits of None: every value of the kind is allowed. A
message has fixed fields and may end in a group of fields repeated to the end of the payload. Replies have
the request's id plus REPLY. All numbers are little-endian. Fields are only ever appended.
"""

# Kinds: the low bits are the size in bytes, the top bit says signed. TEXT is 16 bytes of ASCII, zero padded.
U8, U16, U32, I32 = 0x01, 0x02, 0x04, 0x84
TEXT = 0x10
KIND_NAMES = {U8: "u8", U16: "u16", U32: "u32", I32: "i32", TEXT: "text16"}

REPLY = 0x80

HELLO, PING, INFO, SHOW, STATE, SUBSCRIBE, TELEMETRY = 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07
TABLE_WRITE, TABLE_COMMIT, TABLE_READ, STOP, VENT, CLEAR = 0x08, 0x09, 0x0A, 0x0B, 0x0C, 0x0D
TICKS, RESTART = 0x0E, 0x0F
FAULTS_READ, FAULTS_ACK, SETTING_READ, SETTING_WRITE = 0x12, 0x13, 0x14, 0x15
ERROR = 0x7F

# What ERROR says went wrong.
UNKNOWN_MESSAGE, WRONG_LENGTH, OUT_OF_RANGE, WRONG_COUNT, BAD_TABLE, BAD_CRC, NO_COMMON_PROTOCOL, FAULTED = range(1, 9)
BOARD_FAULT = 9
NO_SETTING = 12
ERRORS = (
    (UNKNOWN_MESSAGE, "unknown_message", "no message has this id"),
    (WRONG_LENGTH, "wrong_length", "the payload is too short or too long: asked bytes, low to high allowed"),
    (OUT_OF_RANGE, "out_of_range", "a field is outside its limits: field, element, asked, low, high"),
    (WRONG_COUNT, "wrong_count", "not one entry per bubble: asked entries, low = high = bubbles"),
    (BAD_TABLE, "bad_table", "a table is incomplete or its heights do not rise: element is the bubble, asked the knot"),
    (BAD_CRC, "bad_crc", "the tables received are not the tables sent"),
    (NO_COMMON_PROTOCOL, "no_common_protocol", "asked is the host's newest, low to high the device's"),
    (FAULTED, "faulted", "the device failed at this request and vents"),
    (BOARD_FAULT, "board_fault", "a fault of the board forbids it: asked are its bits; mend the cause, then CLEAR"),
    (NO_SETTING, "no_setting", "no setting has this number: asked; low to high exist"),
)

TICKS_WRAP = 1 << 30  # device time counts up to here and goes on from 0: after 62 days at 5 ms. No integer becomes long

# What the board as a whole is doing: the states of `bubble_firmware.safety`.
IDLE, ACTIVE, HOLDING, BOOT, MODE_VENTING, MODE_FAULTED, MODE_STOPPED = range(7)
VENTED = IDLE  # its name before there were others in which the vents are open
MODES = (
    (IDLE, "idle", "every vent valve is open, no bubble has pressure, nothing forbids a show"),
    (ACTIVE, "active", "heights are controlled"),
    (HOLDING, "holding", "all valves are closed and stay closed: STOP, or the host is silent"),
    (BOOT, "boot", "vented; the self-test is running or has not begun"),
    (MODE_VENTING, "venting", "every vent valve is open, the bubbles are on their way to no pressure"),
    (MODE_FAULTED, "faulted", "vented, SHOW is refused: a fault of the board stands that CLEAR has to acknowledge"),
    (MODE_STOPPED, "stopped", "vented, SHOW is refused: the emergency stop was pressed, CLEAR has to acknowledge it"),
)

# What one bubble is doing.
RESTING, MOVING, SETTLED, STOPPED, FAULT = range(5)
STATUSES = (
    (RESTING, "resting", "vent open, no pressure wanted"),
    (MOVING, "moving", "on its way to its target"),
    (SETTLED, "settled", "at its target"),
    (STOPPED, "stopped", "valves closed, not controlled"),
    (FAULT, "fault", "isolated and vented; see its faults"),
)

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
        "the reservoir stays below the pressure that is needed: bubbles are held as well as can be",
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
VENTING = ESTOP | VALVE_CHIP | OVERFILLED  # while one of these stands, SHOW is refused

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

# What can be set: (number, name, unit, least, most, default, meaning). None: the board's.
DEADMAN_HOLD, DEADMAN_VENT, BUDGET_KPA_S = range(3)
SETTINGS = (
    (
        DEADMAN_HOLD,
        "deadman_hold_ms",
        "ms",
        50,
        5000,
        250,
        "silence of the host after which bubbles that move are held",
    ),
    (
        DEADMAN_VENT,
        "deadman_vent_ms",
        "ms",
        100,
        60000,
        1000,
        "silence after which all are vented; not below the other",
    ),
    (
        BUDGET_KPA_S,
        "budget_kpa_s",
        "kPa s",
        10,
        None,
        None,
        "pressure above the board's threshold times time, for each bubble",
    ),
)

# What has become of the self-test at boot.
NOT_RUN, RUNNING, PASSED, FAILED, SKIPPED = range(5)
SELF_TESTS = (
    (NOT_RUN, "not_run", "this board has none"),
    (RUNNING, "running", "under way"),
    (PASSED, "passed", "every sensor and valve works"),
    (FAILED, "failed", "some do not, see the bits"),
    (SKIPPED, "skipped", "valves not tested: no supply pressure, an emergency stop, or a SHOW came first"),
)

# What RESTART leads to.
FIRMWARE, BOOT_LOADER, PROMPT = range(3)
RESTARTS = (
    (FIRMWARE, "firmware", "the firmware from its beginning"),
    (BOOT_LOADER, "boot_loader", "the chip's USB drive that takes a UF2"),
    (PROMPT, "prompt", "MicroPython's prompt"),
)

_TICKS = ("ticks", U32, "ticks", None, None, "device time: ticks since boot")
_BUBBLES = (
    ("height_um", U16, "µm", None, None, "estimated height"),
    ("pressure_pa", I32, "Pa", None, None, "gauge pressure at the sensor"),
    ("target_um", U16, "µm", None, None, "height asked"),
    ("status", U8, "", None, None, "see bubble status"),
    ("faults", U8, "", None, None, "see faults, bits"),
)
_KNOTS = (
    ("knot_um", U16, "µm", 1, None, "height of a knot"),
    ("knot_pa", U16, "Pa", None, None, "gauge pressure that holds it"),
)

# (id, name, fixed fields, repeated fields, meaning)
MESSAGES = (
    (
        HELLO,
        "HELLO",
        (
            ("protocol_min", U8, "", None, None, "oldest protocol the host speaks"),
            ("protocol_max", U8, "", None, None, "newest protocol the host speaks"),
        ),
        (),
        "who is there?",
    ),
    (
        HELLO | REPLY,
        "HELLO_REPLY",
        (
            ("protocol_min", U8, "", None, None, "oldest protocol the device speaks"),
            ("protocol_max", U8, "", None, None, "newest protocol the device speaks"),
            ("schema_crc", U32, "", None, None, "CRC-32 of this schema as the device knows it"),
            ("boot_id", U32, "", None, None, "another number after every boot"),
            ("firmware_major", U8, "", None, None, "firmware version"),
            ("firmware_minor", U8, "", None, None, ""),
            ("firmware_patch", U8, "", None, None, ""),
            ("board", TEXT, "", None, None, "name of the board"),
            ("bubbles", U8, "", None, None, "how many bubbles it has"),
            ("tick_us", U16, "µs", None, None, "length of a tick"),
            ("height_rest_um", U16, "µm", None, None, "height of a bubble without pressure"),
            ("height_max_um", U16, "µm", None, None, "the greatest height that may be asked"),
            ("pressure_max_pa", U32, "Pa", None, None, "gauge pressure at which a bubble is vented"),
            ("window", U8, "requests", None, None, "requests that may be under way at once"),
            ("capabilities", U32, "", None, None, "bits, none defined yet"),
            ("tables_crc", U32, "", None, None, "CRC-32 of the tables in use"),
        ),
        (),
        "the device introduces itself",
    ),
    (PING, "PING", (("token", U32, "", None, None, "comes back unchanged"),), (), "are you there, what time is it?"),
    (
        PING | REPLY,
        "PING_REPLY",
        (
            ("token", U32, "", None, None, "the request's"),
            _TICKS,
            ("phase_us", U16, "µs", None, None, "time since the tick began"),
        ),
        (),
        "here, at this device time",
    ),
    (INFO, "INFO", (), (), "how are you?"),
    (
        INFO | REPLY,
        "INFO_REPLY",
        (
            _TICKS,
            ("late_ticks", U32, "ticks", None, None, "ticks that began late"),
            ("tick_worst_us", U32, "µs", None, None, "the longest tick"),
            ("exceptions", U32, "", None, None, "exceptions that vented the board"),
            ("frames_good", U32, "frames", None, None, "frames understood"),
            ("frames_bad", U32, "frames", None, None, "frames dropped: CRC, COBS or length"),
            ("telemetry_dropped", U32, "frames", None, None, "telemetry that found no room"),
            ("heap_free", U32, "bytes", None, None, "free heap; 0 where it has no limit"),
            ("supply_pa", I32, "Pa", None, None, "gauge pressure of the reservoir"),
            ("tables_crc", U32, "", None, None, "CRC-32 of the tables in use"),
            ("mode", U8, "", None, None, "see mode"),
            ("board_faults", U8, "", None, None, "see board faults, bits"),
            ("self_test", U8, "", None, None, "see self-test"),
            ("untrue_zero", U32, "", None, None, "bubbles, as bits, whose sensor was off or silent without pressure"),
            ("unfilled", U32, "", None, None, "bubbles, as bits, that a fill pulse did not reach"),
            ("unvented", U32, "", None, None, "bubbles, as bits, that did not vent"),
        ),
        (),
        "counters and health",
    ),
    (
        SHOW,
        "SHOW",
        (("over_ms", U16, "ms", 0, 60000, "time to take for the change; 0: as fast as the valves can"),),
        (("height_um", U16, "µm", 0, None, "height asked, up to height_max_um; at rest height or below: no pressure"),),
        "take this shape; one height per bubble",
    ),
    (SHOW | REPLY, "SHOW_REPLY", (_TICKS,), (), "targets set"),
    (STATE, "STATE", (), (), "what shape are you in?"),
    (
        STATE | REPLY,
        "STATE_REPLY",
        (_TICKS, ("mode", U8, "", None, None, "see mode")),
        _BUBBLES,
        "the state of every bubble",
    ),
    (
        SUBSCRIBE,
        "SUBSCRIBE",
        (("period_ticks", U16, "ticks", 0, 60000, "one TELEMETRY every so many ticks; 0: none"),),
        (),
        "send telemetry",
    ),
    (SUBSCRIBE | REPLY, "SUBSCRIBE_REPLY", (_TICKS,), (), "subscription changed"),
    (
        TELEMETRY,
        "TELEMETRY",
        (_TICKS, ("mode", U8, "", None, None, "see mode")),
        _BUBBLES,
        "unasked: as STATE_REPLY; the sequence number counts what was due, so a gap is a loss",
    ),
    (
        TABLE_WRITE,
        "TABLE_WRITE",
        (
            ("bubble", U8, "", 0, None, "whose table"),
            ("first", U8, "", 0, 63, "index of the first knot in this message"),
            ("total", U8, "knots", 2, 64, "knots of the whole table"),
        ),
        _KNOTS,
        "part of a height to pressure table; takes effect at TABLE_COMMIT",
    ),
    (TABLE_WRITE | REPLY, "TABLE_WRITE_REPLY", (_TICKS,), (), "part received"),
    (
        TABLE_COMMIT,
        "TABLE_COMMIT",
        (("crc", U32, "", None, None, "CRC-32 over all tables: per bubble the knots as (u16 µm, u16 Pa)"),),
        (),
        "check the tables received and use them from the next tick",
    ),
    (
        TABLE_COMMIT | REPLY,
        "TABLE_COMMIT_REPLY",
        (("tables_crc", U32, "", None, None, "of the tables in use"),),
        (),
        "tables in use",
    ),
    (
        TABLE_READ,
        "TABLE_READ",
        (
            ("bubble", U8, "", 0, None, "whose table"),
            ("first", U8, "", 0, 63, "index of the first knot wanted"),
        ),
        (),
        "what table is in use?",
    ),
    (
        TABLE_READ | REPLY,
        "TABLE_READ_REPLY",
        (
            ("bubble", U8, "", None, None, "whose table"),
            ("first", U8, "", None, None, "index of the first knot in this message"),
            ("total", U8, "knots", None, None, "knots of the whole table"),
        ),
        _KNOTS,
        "part of the table in use",
    ),
    (STOP, "STOP", (), (), "close all valves and keep the air; SHOW goes on from there"),
    (STOP | REPLY, "STOP_REPLY", (_TICKS,), (), "stopped"),
    (VENT, "VENT", (), (), "open all vent valves until the next SHOW"),
    (VENT | REPLY, "VENT_REPLY", (_TICKS,), (), "venting"),
    (CLEAR, "CLEAR", (), (), "forget all faults; bubbles that still have one fault again"),
    (CLEAR | REPLY, "CLEAR_REPLY", (_TICKS,), (), "faults cleared"),
    (TICKS, "TICKS", (), (), "how long do ticks take, how late do they begin?"),
    (
        TICKS | REPLY,
        "TICKS_REPLY",
        (
            ("work_us", U16, "µs", None, None, "width of a bin of worked"),
            ("delay_us", U16, "µs", None, None, "width of a bin of delayed"),
        ),
        (
            (
                "worked",
                I32,
                "ticks",
                None,
                None,
                "ticks that took so many times work_us; the last bin also takes longer ones",
            ),
            (
                "delayed",
                I32,
                "ticks",
                None,
                None,
                "ticks that began so many times delay_us after their period; likewise",
            ),
        ),
        "histograms since boot",
    ),
    (
        RESTART,
        "RESTART",
        (("into", U8, "", 0, 2, "see restart"),),
        (),
        "vent and start again; answered first",
    ),
    (RESTART | REPLY, "RESTART_REPLY", (_TICKS,), (), "restarting"),
    (
        FAULTS_READ,
        "FAULTS_READ",
        (("after", I32, "", 0, 0x3FFFFFFF, "entries with a greater id; 0: from the oldest"),),
        (),
        "what has gone wrong, and when?",
    ),
    (
        FAULTS_READ | REPLY,
        "FAULTS_READ_REPLY",
        (
            _TICKS,
            ("newest", U32, "", None, None, "id of the newest entry; 0: there was none since boot"),
            ("acknowledged", U32, "", None, None, "entries up to this id are acknowledged"),
        ),
        (
            ("id", U32, "", None, None, "counts from 1"),
            ("at", U32, "ticks", None, None, "when, device time"),
            ("what", U16, "", None, None, "a bit: see faults of a bubble, faults of the board, events"),
            ("bubble", U8, "", None, None, "255: the board"),
            ("value", I32, "", None, None, "Pa: the bubble's pressure, the board's reservoir; of an event see there"),
        ),
        "entries of the fault log, oldest first; ask again after the last id until there are none",
    ),
    (
        FAULTS_ACK,
        "FAULTS_ACK",
        (("up_to", I32, "", 0, 0x3FFFFFFF, "id of the newest entry that has been seen"),),
        (),
        "acknowledge: forget the faults up to this entry; those that still are there fault again",
    ),
    (FAULTS_ACK | REPLY, "FAULTS_ACK_REPLY", (_TICKS,), (), "acknowledged"),
    (SETTING_READ, "SETTING_READ", (), (), "what is set?"),
    (
        SETTING_READ | REPLY,
        "SETTING_READ_REPLY",
        (_TICKS, ("version", U32, "", None, None, "counts changes since boot")),
        (
            ("setting", U8, "", None, None, "see settings"),
            ("value", I32, "", None, None, "in use"),
            ("low", I32, "", None, None, "the least that this board allows"),
            ("high", I32, "", None, None, "the most that this board allows"),
        ),
        "all settings",
    ),
    (
        SETTING_WRITE,
        "SETTING_WRITE",
        (),
        (
            ("setting", U8, "", None, None, "see settings"),
            ("value", I32, "", 0, 0x3FFFFFFF, "wanted"),
        ),
        "set: all of these, or none",
    ),
    (SETTING_WRITE | REPLY, "SETTING_WRITE_REPLY", (_TICKS,), (), "set, from the next tick"),
    (
        ERROR,
        "ERROR",
        (
            ("request", U8, "", None, None, "id of the message refused"),
            ("error", U8, "", None, None, "see errors"),
            ("field", U8, "", None, None, "index of the field: fixed fields first, then the repeated ones"),
            ("element", U8, "", None, None, "which repetition, where it is one: the bubble or knot"),
            ("asked", I32, "", None, None, "what was asked"),
            ("low", I32, "", None, None, "the least allowed"),
            ("high", I32, "", None, None, "the most allowed"),
        ),
        (),
        "refused, nothing was changed; in place of the reply",
    ),
)
