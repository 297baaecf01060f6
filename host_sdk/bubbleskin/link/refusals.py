"""Sentences for the device's refusals, from the schema: what was refused, which field, what is allowed, what to do."""

from collections.abc import Callable

from bubble_protocol import codec, steps
from bubble_protocol.schema import errors, sequences
from bubble_protocol.schema.faults import BOARD_FAULTS, VENTING
from bubble_protocol.schema.modes import MODES
from bubbleskin.link.message import Message, name_of

_STEP_WORDS = ("flags", "ramp (ms)", "time or timeout (ms)", "tolerance (µm)")


def describe_refusal(error: Message) -> str:
    """A sentence for an ERROR message: what was refused, which field, what is allowed."""
    if sentence := _SENTENCES.get(error["error"]):
        return sentence(error)
    if reason := _REASONS.get(error["error"]):
        return f"The wristband refused {name_of(error['request'])}: {reason(error)}"
    return _other(error)


def _other(error: Message) -> str:
    return f"The wristband refused {name_of(error['request'])} with error {error['error']}."


def _out_of_range(error: Message) -> str:
    request = codec.BY_ID.get(error["request"])
    fields = request.fixed + request.repeated if request else ()
    if request is None or error["field"] >= len(fields):
        return _other(error)
    name, _, unit, *_ = fields[error["field"]]
    unit = f" {unit}" if unit else ""
    where = f" (entry {error['element']})" if error["field"] >= len(request.fixed) else ""
    return (
        f"The wristband refused {request.name}: {name}{where} is {error['asked']}{unit}; "
        f"{error['low']} to {error['high']}{unit} is allowed."
    )


def _board_fault(error: Message) -> str:
    faults = [sentence for bit, _, sentence in BOARD_FAULTS if error["asked"] & bit & VENTING]
    return f"{'; '.join(faults)}. Mend the cause, then `clear_faults()`."


def _not_vented(error: Message) -> str:
    mode = {number: mode for number, mode, _ in MODES}.get(error["asked"], "busy")
    return f"The wristband refused {name_of(error['request'])} because it is {mode}, not vented. Call `vent()` first."


def _bad_step(error: Message) -> str:
    field = error["field"]
    word = _STEP_WORDS[field] if field < steps.HEAD else f"target (µm) of bubble {field - steps.HEAD}"
    return (
        f"the {word} of record {error['element']} in this message is {error['asked']}; "
        f"{error['low']} to {error['high']} is allowed."
    )


def _not_ready(error: Message) -> str:
    state = {number: name for number, name, _ in sequences.STATES}.get(error["asked"], "unknown")
    return (
        f"its sequence is {state}, with {error['low']} of {error['high']} records, or is another one. "
        "Upload the sequence and arm it first."
    )


_SENTENCES: dict[int, Callable[[Message], str]] = {
    errors.OUT_OF_RANGE: _out_of_range,
    errors.NOT_VENTED: _not_vented,
    errors.NOT_PERMITTED: lambda error: (
        "The wristband makes nothing fail on purpose before that is permitted, anew after each start: call "
        "`permit_injection()` first."
    ),
    errors.BAD_TABLE: lambda error: (
        f"The wristband refused the table of bubble {error['element']} at knot {error['asked']}: heights must rise to the "
        f"board's greatest height, where pressure may be {error['low']} Pa (more, and it would take more air than a bubble "
        f"of this board may have), and pressures stay within {error['high']} Pa."
    ),
    errors.FAULTED: lambda error: (
        f"The wristband failed at {name_of(error['request'])} and vents. `bubbleskin info` counts its exceptions."
    ),
    errors.UNKNOWN_MESSAGE: lambda error: (
        f"The wristband does not know {name_of(error['request'])}: its firmware is older than this SDK. Update the firmware."
    ),
}
"""Whole sentences, by error."""

_REASONS: dict[int, Callable[[Message], str]] = {
    errors.WRONG_COUNT: lambda error: f"{error['asked']} entries for its {error['high']} bubbles; send one per bubble.",
    errors.WRONG_LENGTH: lambda error: (
        f"a payload of {error['asked']} bytes; {error['low']} to {error['high']} are allowed. Update SDK or firmware."
    ),
    errors.BAD_CRC: lambda error: "what it received is not what was sent. Upload the tables again.",
    errors.BOARD_FAULT: _board_fault,
    errors.OVERTAKEN: lambda error: "a later STOP or VENT has overtaken it. It was not applied.",
    errors.STORE_FOREIGN: lambda error: (
        "its store holds what newer firmware or another board has saved. "
        "Update the firmware, or give that up with `factory_reset()`."
    ),
    errors.STORE_FAILED: lambda error: "its flash does not hold what was written, or it has none for a store.",
    errors.NO_SETTING: lambda error: (
        f"it has no setting {error['asked']}; they are numbered {error['low']} to {error['high']}. Update its firmware."
    ),
    errors.WRONG_BOARD: lambda error: "the sequence is for other hardware. Make one for this board.",
    errors.BAD_STEP: _bad_step,
    errors.BAD_LOOP: lambda error: (
        f"repeats and their ends do not fit at record {error['element']}: depth {error['asked']}, "
        f"0 to {error['high']} is allowed, and none is empty."
    ),
    errors.OUT_OF_ORDER: lambda error: f"record {error['asked']} came where {error['low']} was expected. Upload again.",
    errors.NO_ROOM: lambda error: (
        f"{error['asked']} records, with room for {error['high']}. Send what there is room for."
    ),
    errors.NOT_READY: _not_ready,
    errors.TOO_LATE: lambda error: (
        f"tick {error['asked']}, at which to start, has passed; the next is {error['low']}. Start later, or at once."
    ),
}
"""What stands after "The wristband refused REQUEST: ", by error."""
