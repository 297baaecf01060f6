"""Every message of the protocol, as plain data: the one source of codec, limits, documentation and golden vectors.

A field is (name, kind, unit, low, high, meaning). Limits of None: every value of the kind is allowed. A
message has fixed fields and may end in a group of fields repeated to the end of the payload. Replies have
the request's id plus REPLY. All numbers are little-endian. Fields are only ever appended.

Ids and kinds are `const`, so that on a device all of this stays in flash: a tuple of constants costs no memory.
"""

from bubble_protocol.mpy_compat import const

# Kinds: the low bits are the size in bytes, the top bit says signed. TEXT is 16 bytes of ASCII, zero padded.
U8 = const(0x01)
U16 = const(0x02)
U32 = const(0x04)
I16 = const(0x82)
I32 = const(0x84)
TEXT = const(0x10)
KIND_NAMES = {U8: "u8", U16: "u16", U32: "u32", I16: "i16", I32: "i32", TEXT: "text16"}

REPLY = const(0x80)

KNOTS_PER_MESSAGE = const(48)  # at most, in TABLE_WRITE and TABLE_READ_REPLY

HELLO = const(0x01)
PING = const(0x02)
INFO = const(0x03)
SHOW = const(0x04)
STATE = const(0x05)
SUBSCRIBE = const(0x06)
TELEMETRY = const(0x07)
TABLE_WRITE = const(0x08)
TABLE_COMMIT = const(0x09)
TABLE_READ = const(0x0A)
STOP = const(0x0B)
VENT = const(0x0C)
CLEAR = const(0x0D)
TICKS = const(0x0E)
RESTART = const(0x0F)
LAYOUT = const(0x10)
ESTIMATE = const(0x11)
STORE_SAVE = const(0x16)
STORE_INFO = const(0x17)
STORE_RESET = const(0x18)
TRIM_WRITE = const(0x19)
TRIM_READ = const(0x1A)
SEQUENCE_BEGIN = const(0x20)
SEQUENCE_WRITE = const(0x21)
SEQUENCE_ARM = const(0x22)
SEQUENCE_START = const(0x23)
SEQUENCE_CONTROL = const(0x24)
SEQUENCE_STATE = const(0x25)
SEQUENCE_EVENT = const(0x26)
SUBSCRIBE_FIELDS = const(0x1B)
CALIBRATION_WRITE = const(0x1D)
CALIBRATION_READ = const(0x1E)
TELEMETRY_FIELDS = const(0x1C)
INJECT = const(0x1F)
FAULTS_READ = const(0x12)
FAULTS_ACK = const(0x13)
SETTING_READ = const(0x14)
SETTING_WRITE = const(0x15)
ERROR = const(0x7F)


_TICKS = ("ticks", U32, "ticks", None, None, "device time: ticks since boot")
_ISOLATED_MS = (
    "isolated_ms",
    U16,
    "ms",
    None,
    None,
    "how long something acknowledged stays isolated, see `ISOLATION_MS`",
)
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

_TRIM = (
    ("zero", U16, "counts", None, None, "what the sensor reads at no pressure"),
    ("opens_us", U16, "µs", None, None, "from current to an open valve"),
    ("closes_us", U16, "µs", None, None, "from no current to a closed valve"),
    ("flow_gain", U16, "", None, None, "flow of the restrictor: root of pressures (8 Pa) to µJ/ms, /65536"),
)
_FIRST = ("first", U8, "", None, None, "number of the bubble that the first entry is of")
_CALIBRATION = (
    ("zero", U16, "counts", None, None, "what the sensor reads at no pressure"),
    ("fill_opens_us", U16, "µs", None, None, "of the fill valve, from current to open"),
    ("fill_closes_us", U16, "µs", None, None, "from no current to closed"),
    ("fill_gain", U16, "", None, None, "flow of its restrictor: root of pressures (8 Pa) to µJ/ms, /65536"),
    ("vent_opens_us", U16, "µs", None, None, "the same of the vent valve"),
    ("vent_closes_us", U16, "µs", None, None, "from no current to closed"),
    ("vent_gain", U16, "", None, None, "flow of its restrictor"),
    ("flow_sd", U16, "", None, None, "standard deviation of both flows, share, /65536"),
    (
        "curve_sd",
        U16,
        "",
        None,
        None,
        "standard deviation of the table's pressures, with the rubber's memory, share, /65536",
    ),
    ("leak", U16, "µJ/s per kPa", None, None, "air that the bubble loses, /16"),
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
    (CLEAR, "CLEAR", (), (), "acknowledge all faults; bubbles that still have one fault again"),
    (CLEAR | REPLY, "CLEAR_REPLY", (_TICKS, _ISOLATED_MS), (), "acknowledged"),
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
    (TRIM_WRITE, "TRIM_WRITE", (), _TRIM, "use these figures, for both valves of a bubble; only while vented"),
    (TRIM_WRITE | REPLY, "TRIM_WRITE_REPLY", (_TICKS,), (), "figures in use"),
    (TRIM_READ, "TRIM_READ", (), (), "what figures are in use, of the fill valves?"),
    (TRIM_READ | REPLY, "TRIM_READ_REPLY", (), _TRIM, "the figures in use, one entry per bubble"),
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
            ("fields", U16, "", 1, 511, "see telemetry columns, bits; as many as a frame has room for"),
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
        "acknowledge the faults up to this entry; those that still are there fault again",
    ),
    (FAULTS_ACK | REPLY, "FAULTS_ACK_REPLY", (_TICKS, _ISOLATED_MS), (), "acknowledged"),
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
    (ESTIMATE, "ESTIMATE", (), (), "what shape are you in, and how sure are you?"),
    (
        ESTIMATE | REPLY,
        "ESTIMATE_REPLY",
        (_TICKS, ("mode", U8, "", None, None, "see mode")),
        _BUBBLES + (("sd_um", U16, "µm", None, None, "standard deviation of the estimated height"),),
        "the state of every bubble, and how well it is known",
    ),
    (
        CALIBRATION_WRITE,
        "CALIBRATION_WRITE",
        (_FIRST,),
        _CALIBRATION,
        "use these figures for the first bubble and those that follow, one entry for each; only while vented",
    ),
    (CALIBRATION_WRITE | REPLY, "CALIBRATION_WRITE_REPLY", (_TICKS,), (), "figures in use"),
    (CALIBRATION_READ, "CALIBRATION_READ", (_FIRST,), (), "what figures are in use, from this bubble on?"),
    (
        CALIBRATION_READ | REPLY,
        "CALIBRATION_READ_REPLY",
        (_FIRST,),
        _CALIBRATION,
        "the figures in use, one entry for each bubble, as many as a frame has room for",
    ),
    (LAYOUT, "LAYOUT", (), (), "where are your bubbles?"),
    (
        LAYOUT | REPLY,
        "LAYOUT_REPLY",
        (_TICKS, ("pitch_um", U32, "µm", None, None, "distance between the centres of neighbours")),
        (
            ("x_um", I32, "µm", None, None, "to the right, seen from above"),
            ("y_um", I32, "µm", None, None, "up"),
        ),
        "the centre of each bubble",
    ),
    (
        INJECT,
        "INJECT",
        (
            ("failure", U8, "", 0, 8, "see injections"),
            ("bubble", U8, "", None, None, "whose, where it is a bubble's"),
            ("on", U8, "", 0, 1, "1: fails from now on; 0: mended"),
        ),
        (),
        "fail, or be mended; refused until `injection` has been permitted, which wants everything vented",
    ),
    (INJECT | REPLY, "INJECT_REPLY", (_TICKS,), (), "so be it, from the next tick"),
)

# Bytes of messages that have had fields appended, as the oldest version that is still understood sends them.
# Fields that are missing count as 0. HELLO must be understood from every version, to be refused in a sentence.
FIRST_SIZES = {HELLO: 2}
