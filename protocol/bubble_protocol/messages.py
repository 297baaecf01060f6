"""Every message of the protocol, as plain data: the one source of codec, limits, documentation and golden vectors.

A field is (name, kind, unit, low, high, meaning). Limits of None: every value of the kind is allowed. A
message has fixed fields and may end in a group of fields repeated to the end of the payload. Replies have
the request's id plus REPLY. All numbers are little-endian. Fields are only ever appended.
"""

# Kinds: the low bits are the size in bytes, the top bit says signed. TEXT is 16 bytes of ASCII, zero padded.
U8, U16, U32, I16, I32 = 0x01, 0x02, 0x04, 0x82, 0x84
TEXT = 0x10
KIND_NAMES = {U8: "u8", U16: "u16", U32: "u32", I16: "i16", I32: "i32", TEXT: "text16"}

REPLY = 0x80

HELLO, PING, INFO, SHOW, STATE, SUBSCRIBE, TELEMETRY = 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07
TABLE_WRITE, TABLE_COMMIT, TABLE_READ, STOP, VENT, CLEAR = 0x08, 0x09, 0x0A, 0x0B, 0x0C, 0x0D
TICKS, RESTART = 0x0E, 0x0F
STORE_SAVE, STORE_INFO, STORE_RESET, FIGURES_WRITE, FIGURES_READ = 0x16, 0x17, 0x18, 0x19, 0x1A
SEQUENCE_BEGIN, SEQUENCE_WRITE, SEQUENCE_ARM, SEQUENCE_START = 0x20, 0x21, 0x22, 0x23
SEQUENCE_CONTROL, SEQUENCE_STATE, SEQUENCE_EVENT = 0x24, 0x25, 0x26
SUBSCRIBE_FIELDS, TELEMETRY_FIELDS = 0x1B, 0x1C
FAULTS_READ, FAULTS_ACK, SETTING_READ, SETTING_WRITE = 0x12, 0x13, 0x14, 0x15
ERROR = 0x7F

# What ERROR says went wrong.
UNKNOWN_MESSAGE, WRONG_LENGTH, OUT_OF_RANGE, WRONG_COUNT, BAD_TABLE, BAD_CRC, NO_COMMON_PROTOCOL, FAULTED = range(1, 9)
BOARD_FAULT, OVERTAKEN = 9, 10
NO_SETTING = 12
NOT_VENTED, STORE_FOREIGN, STORE_FAILED = 15, 16, 17
WRONG_BOARD, BAD_STEP, BAD_LOOP, OUT_OF_ORDER, NO_ROOM, NOT_READY, TOO_LATE = range(18, 25)
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
    (OVERTAKEN, "overtaken", "a later STOP, VENT or session came first: not applied, and never will be"),
    (NO_SETTING, "no_setting", "no setting has this number: asked; low to high exist"),
    (NOT_VENTED, "not_vented", "allowed only while all bubbles are vented: asked is the mode; VENT first"),
    (
        STORE_FOREIGN,
        "store_foreign",
        "a slot holds what newer firmware or another board has stored, and is left alone until STORE_RESET",
    ),
    (STORE_FAILED, "store_failed", "flash does not hold what was written, or there is none; what was stored still is"),
    (WRONG_BOARD, "wrong_board", "the sequence is for a board of another name"),
    (
        BAD_STEP,
        "bad_step",
        "a record of a sequence is not sound: element is the record in this message, field the word in the record "
        "(0 flags, 1 ramp, 2 time or timeout, 3 tolerance, from 4 on targets), asked, low, high",
    ),
    (
        BAD_LOOP,
        "bad_loop",
        "repeats and ends do not fit: element is the record in this message, asked the depth, high the most",
    ),
    (
        OUT_OF_ORDER,
        "out_of_order",
        "records come one after the other: asked is the first sent, low = high the one expected",
    ),
    (NO_ROOM, "no_room", "more records than are left: asked are the records sent, high what is left"),
    (
        NOT_READY,
        "not_ready",
        "not now, or not this sequence: asked is the state, low the records received, high those in all",
    ),
    (TOO_LATE, "too_late", "the tick to start at has passed: asked, low the next one"),
)

# Bits of `capabilities`.
DELIVERY, SAFETY, STORE, CAN_SEQUENCES, CAN_CHOOSE_TELEMETRY = 1, 2, 4, 8, 16
CAPABILITIES = (
    (DELIVERY, "delivery", "sessions, a window, replies kept: every request counts once"),
    (SAFETY, "safety", "a deadman, a fault log, settings"),
    (STORE, "store", "tables, settings and figures can be stored"),
    (CAN_SEQUENCES, "sequences", "sequences are played on the device's own clock"),
    (CAN_CHOOSE_TELEMETRY, "telemetry_fields", "SUBSCRIBE_FIELDS: telemetry of chosen columns"),
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
        "the reservoir stays below the pressure that is needed: everything vents",
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

# Where the tables, settings and figures in use at boot came from.
FACTORY, SLOT_A, SLOT_B, DAMAGED, FOREIGN, NO_STORE = range(6)
STORES = (
    (FACTORY, "factory", "nothing is stored: what the firmware was made with"),
    (SLOT_A, "slot_a", "the first slot"),
    (SLOT_B, "slot_b", "the second slot"),
    (DAMAGED, "damaged", "something was stored and cannot be used: what the firmware was made with"),
    (FOREIGN, "foreign", "newer firmware or another board has stored something: what the firmware was made with"),
    (NO_STORE, "none", "this board has no store: what the firmware was made with"),
)

# What one slot of the store holds.
BLANK, WHOLE, TORN, OTHER, UNFIT = range(5)
SLOTS = (
    (BLANK, "blank", "nothing, or a save that was cut short"),
    (WHOLE, "whole", "a record whose CRC is right"),
    (TORN, "torn", "no whole record: a save was cut short, or flash has lost bits"),
    (OTHER, "other", "a record of newer firmware or of another board: left alone"),
    (UNFIT, "unfit", "a whole record that the board's limits do not allow"),
)

# What RESTART leads to.
FIRMWARE, BOOT_LOADER, PROMPT = range(3)
RESTARTS = (
    (FIRMWARE, "firmware", "the firmware from its beginning"),
    (BOOT_LOADER, "boot_loader", "the chip's USB drive that takes a UF2"),
    (PROMPT, "prompt", "MicroPython's prompt"),
)

# What has become of the sequence in memory.
EMPTY, LOADING, ARMED, WAITING, PLAYING, PAUSED, ENDED = range(7)
SEQUENCE_STATES = (
    (EMPTY, "empty", "there is none"),
    (LOADING, "loading", "records are awaited"),
    (ARMED, "armed", "checked, may be started"),
    (WAITING, "waiting", "will start at its tick"),
    (PLAYING, "playing", "its steps are executed"),
    (PAUSED, "paused", "its time stands still, the setpoints too"),
    (ENDED, "ended", "see the reason; may be armed again, if it was no stream"),
)

# How a step or the whole sequence ended.
UNENDED, BY_TIME, BY_SETTLING, BY_TIMEOUT, COMPLETE, CANCELLED, UNDERRUN = range(7)
SEQUENCE_REASONS = (
    (UNENDED, "unended", "it has not"),
    (BY_TIME, "by_time", "its time had come"),
    (BY_SETTLING, "by_settling", "every bubble was within the tolerance"),
    (BY_TIMEOUT, "by_timeout", "the bubbles named in unsettled were not, until its timeout"),
    (COMPLETE, "complete", "all steps have been played"),
    (CANCELLED, "cancelled", "SHOW, STOP, VENT, another sequence or a fault that vents came"),
    (UNDERRUN, "underrun", "the next record of a stream had not come: the last shape is held"),
)

# What SEQUENCE_EVENT tells.
STEP_BEGUN, SEQUENCE_PAUSED, SEQUENCE_RESUMED, SEQUENCE_ENDED = range(4)
SEQUENCE_EVENTS = (
    (STEP_BEGUN, "step_begun", "a step begins; reason and unsettled are those of the step before it"),
    (SEQUENCE_PAUSED, "sequence_paused", "time stands still"),
    (SEQUENCE_RESUMED, "sequence_resumed", "and goes on"),
    (SEQUENCE_ENDED, "sequence_ended", "reason says why; unsettled is the last step's"),
)

# What SEQUENCE_CONTROL does.
PAUSE, RESUME, END = range(3)
SEQUENCE_ACTIONS = (
    (PAUSE, "pause", "let its time and the setpoints stand still"),
    (RESUME, "resume", "go on from there"),
    (END, "end", "end it as STOP does"),
)

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
)

_TICKS = ("ticks", U32, "ticks", None, None, "device time: ticks since boot")
_BUBBLES = (
    ("height_um", U16, "µm", None, None, "estimated height"),
    ("pressure_pa", I32, "Pa", None, None, "gauge pressure at the sensor"),
    ("target_um", U16, "µm", None, None, "height asked"),
    ("status", U8, "", None, None, "see bubble status"),
    ("faults", U8, "", None, None, "see faults, bits"),
)
_SEQUENCE = ("sequence", U16, "", None, None, "the host's number for this sequence")
_RECORD = ("record", U32, "", None, None, "the step's record, counted from 0")
_UNSETTLED = (
    "unsettled",
    U32,
    "",
    None,
    None,
    "bubbles, as bits, that were not there when a step ended by its timeout",
)
_FREE = ("free", U16, "records", None, None, "records that there is room for")
_KNOTS = (
    ("knot_um", U16, "µm", 1, None, "height of a knot"),
    ("knot_pa", U16, "Pa", None, None, "gauge pressure that holds it"),
)

_FIGURES = (
    ("zero", U16, "counts", None, None, "what the sensor reads at no pressure"),
    ("opens_us", U16, "µs", None, None, "from current to an open valve"),
    ("closes_us", U16, "µs", None, None, "from no current to a closed valve"),
    ("flow_gain", U16, "", None, None, "flow of the restrictor: root of pressures (8 Pa) to µJ/ms, /65536"),
)
_STORE = (
    ("source", U8, "", None, None, "see store"),
    ("generation", U16, "", None, None, "number of the record in use, 65535 is followed by 0; 0 also without one"),
    ("schema", U8, "", None, None, "version of its format"),
    ("slot_a", U8, "", None, None, "see slot"),
    ("slot_b", U8, "", None, None, "see slot"),
    ("wear_a", U32, "erases", None, None, "of the first slot's sectors, at least"),
    ("wear_b", U32, "erases", None, None, "of the second slot's"),
    ("size", U16, "bytes", None, None, "of the record in use"),
    ("capacity", U16, "bytes", None, None, "of a slot"),
    (
        "tables_crc",
        U32,
        "",
        None,
        None,
        "CRC-32 of the tables stored; those in use are others while they are not saved",
    ),
    ("error", U8, "", None, None, "why the last save was refused, see errors; 0: it was not"),
)

# (id, name, fixed fields, repeated fields, meaning)
MESSAGES = (
    (
        HELLO,
        "HELLO",
        (
            ("protocol_min", U8, "", None, None, "oldest protocol the host speaks"),
            ("protocol_max", U8, "", None, None, "newest protocol the host speaks"),
            ("session", U32, "", None, None, "any number but 0, another one for every session"),
        ),
        (),
        "who is there? Opens the session, where it is not open already",
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
            ("capabilities", U32, "", None, None, "see capabilities, bits"),
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
            ("store", U8, "", None, None, "see store"),
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
    (STORE_SAVE, "STORE_SAVE", (), (), "store tables, settings and figures in use; only while vented"),
    (STORE_SAVE | REPLY, "STORE_SAVE_REPLY", _STORE, (), "stored; what was stored already is not written again"),
    (STORE_INFO, "STORE_INFO", (), (), "what is stored?"),
    (STORE_INFO | REPLY, "STORE_INFO_REPLY", _STORE, (), "the state of the store"),
    (
        STORE_RESET,
        "STORE_RESET",
        (),
        (),
        "use what the firmware was made with, and store nothing else; only while vented",
    ),
    (STORE_RESET | REPLY, "STORE_RESET_REPLY", _STORE, (), "as it was made"),
    (FIGURES_WRITE, "FIGURES_WRITE", (), _FIGURES, "use these figures, one entry per bubble; only while vented"),
    (FIGURES_WRITE | REPLY, "FIGURES_WRITE_REPLY", (_TICKS,), (), "figures in use"),
    (FIGURES_READ, "FIGURES_READ", (), (), "what figures are in use?"),
    (FIGURES_READ | REPLY, "FIGURES_READ_REPLY", (), _FIGURES, "the figures in use, one entry per bubble"),
    (
        SEQUENCE_BEGIN,
        "SEQUENCE_BEGIN",
        (
            _SEQUENCE,
            ("bubbles", U8, "", None, None, "how many bubbles its records have"),
            ("board_crc", U32, "", None, None, "CRC-32 of the name of the board that it is for; 0: any"),
            ("records", U32, "records", None, None, "in all; more than the memory holds: a stream; 0: one without end"),
            ("crc", U32, "", None, None, "CRC-32 of all its records' words; not looked at in a stream"),
        ),
        (),
        "make room for a sequence; one that runs is cancelled and the bubbles are held where they are",
    ),
    (
        SEQUENCE_BEGIN | REPLY,
        "SEQUENCE_BEGIN_REPLY",
        (_TICKS, _FREE, ("capacity", U16, "records", None, None, "records that fit into the memory")),
        (),
        "records may come",
    ),
    (
        SEQUENCE_WRITE,
        "SEQUENCE_WRITE",
        (_SEQUENCE, ("first", U16, "records", None, None, "number of the first record in this message, modulo 65536")),
        (("word", U16, "", None, None, "whole records, word by word; see Sequences"),),
        "the next records of a sequence; all are checked before one is taken",
    ),
    (
        SEQUENCE_WRITE | REPLY,
        "SEQUENCE_WRITE_REPLY",
        (_TICKS, _FREE, ("received", U32, "records", None, None, "records received so far")),
        (),
        "records taken",
    ),
    (SEQUENCE_ARM, "SEQUENCE_ARM", (_SEQUENCE,), (), "check that the sequence is whole, and the one that was sent"),
    (SEQUENCE_ARM | REPLY, "SEQUENCE_ARM_REPLY", (_TICKS,), (), "may be started"),
    (
        SEQUENCE_START,
        "SEQUENCE_START",
        (_SEQUENCE, ("start_ticks", U32, "ticks", None, None, "device time of the first step; 0: the next tick")),
        (),
        "play the sequence that is armed; a start that has passed is refused",
    ),
    (
        SEQUENCE_START | REPLY,
        "SEQUENCE_START_REPLY",
        (_TICKS, ("start_ticks", U32, "ticks", None, None, "device time of the first step")),
        (),
        "will start then",
    ),
    (
        SEQUENCE_CONTROL,
        "SEQUENCE_CONTROL",
        (_SEQUENCE, ("action", U8, "", 0, 2, "see sequence action")),
        (),
        "pause, resume or end the sequence that runs",
    ),
    (SEQUENCE_CONTROL | REPLY, "SEQUENCE_CONTROL_REPLY", (_TICKS,), (), "done"),
    (SEQUENCE_STATE, "SEQUENCE_STATE", (), (), "what has become of the sequence?"),
    (
        SEQUENCE_STATE | REPLY,
        "SEQUENCE_STATE_REPLY",
        (
            _TICKS,
            _SEQUENCE,
            ("state", U8, "", None, None, "see sequence state"),
            ("reason", U8, "", None, None, "see sequence reason"),
            _RECORD,
            ("begun_ticks", U32, "ticks", None, None, "when that step began"),
            _UNSETTLED,
            ("timeouts", U32, "steps", None, None, "how many steps so far ended by their timeout"),
            ("received", U32, "records", None, None, "records received"),
            _FREE,
            ("capacity", U16, "records", None, None, "records that fit into the memory"),
        ),
        (),
        "how far the sequence is, or how it ended",
    ),
    (
        SEQUENCE_EVENT,
        "SEQUENCE_EVENT",
        (
            _TICKS,
            _SEQUENCE,
            ("event", U8, "", None, None, "see sequence event"),
            ("reason", U8, "", None, None, "see sequence reason"),
            _RECORD,
            _UNSETTLED,
            _FREE,
        ),
        (),
        "unasked: something has happened to the sequence, at this tick; the sequence number counts, so a gap is a loss",
    ),
    (
        SUBSCRIBE_FIELDS,
        "SUBSCRIBE_FIELDS",
        (
            ("period_ticks", U16, "ticks", 0, 60000, "one TELEMETRY_FIELDS every so many ticks; 0: none"),
            ("fields", U16, "", 1, 255, "see telemetry columns, bits; as many as a frame has room for"),
        ),
        (),
        "send chosen telemetry in place of what was subscribed to before",
    ),
    (SUBSCRIBE_FIELDS | REPLY, "SUBSCRIBE_FIELDS_REPLY", (_TICKS,), (), "subscription changed"),
    (
        TELEMETRY_FIELDS,
        "TELEMETRY_FIELDS",
        (
            _TICKS,
            ("mode", U8, "", None, None, "see mode"),
            ("board_faults", U8, "", None, None, "see board faults, bits"),
            ("supply_pa", I32, "Pa", None, None, "gauge pressure of the reservoir"),
            ("dropped", U16, "frames", None, None, "telemetry that found no room since it was subscribed to"),
            ("fields", U16, "", None, None, "the columns, bits"),
        ),
        (("value", I16, "", None, None, "per bubble one value for each bit of fields, lowest bit first"),),
        "unasked: the columns chosen; the sequence number counts what was due, so a gap is a loss",
    ),
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

# Bytes of messages that have had fields appended, as the oldest version that is still understood sends them.
# Fields that are missing count as 0. HELLO must be understood from every version, to be refused in a sentence.
FIRST_SIZES = {HELLO: 2}
