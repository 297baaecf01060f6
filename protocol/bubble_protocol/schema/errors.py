"""What ERROR says went wrong with a request."""

# What ERROR says went wrong.
UNKNOWN_MESSAGE, WRONG_LENGTH, OUT_OF_RANGE, WRONG_COUNT, BAD_TABLE, BAD_CRC, NO_COMMON_PROTOCOL, FAULTED = range(1, 9)
BOARD_FAULT, OVERTAKEN = 9, 10
NO_SETTING, NOT_PERMITTED = 12, 13
NOT_VENTED, STORE_FOREIGN, STORE_FAILED = 15, 16, 17
WRONG_BOARD, BAD_STEP, BAD_LOOP, OUT_OF_ORDER, NO_ROOM, NOT_READY, TOO_LATE = range(18, 25)
NO_ELEMENT = 255  # in place of a repetition's number: it is about none

ERRORS = (
    (UNKNOWN_MESSAGE, "unknown_message", "no message has this id"),
    (WRONG_LENGTH, "wrong_length", "the payload is too short or too long: asked bytes, low to high allowed"),
    (OUT_OF_RANGE, "out_of_range", "a field is outside its limits: field, element, asked, low, high"),
    (WRONG_COUNT, "wrong_count", "not one entry per bubble: asked entries, low = high = bubbles"),
    (
        BAD_TABLE,
        "bad_table",
        "a table is incomplete, its heights do not rise, or it asks for more pressure or air than the board allows: element is "
        "the bubble, asked the knot, high the greatest pressure, low the greatest at the greatest height, Pa",
    ),
    (BAD_CRC, "bad_crc", "the tables received are not the tables sent"),
    (NO_COMMON_PROTOCOL, "no_common_protocol", "asked is the host's newest, low to high the device's"),
    (FAULTED, "faulted", "the device failed at this request and vents"),
    (BOARD_FAULT, "board_fault", "a fault of the board forbids it: asked are its bits; mend the cause, then CLEAR"),
    (OVERTAKEN, "overtaken", "a later STOP, VENT or session came first: not applied, and never will be"),
    (NO_SETTING, "no_setting", "no setting has this number: asked; low to high exist"),
    (
        NOT_PERMITTED,
        "not_permitted",
        "nothing is made to fail on purpose before that is permitted: asked is the failure",
    ),
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
