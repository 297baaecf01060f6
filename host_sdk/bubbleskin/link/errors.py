"""What is said when a link fails."""

from bubble_protocol.schema import errors
from bubble_protocol.version import PROTOCOL_MAX, PROTOCOL_MIN
from bubbleskin.errors import DeviceRestarted, DeviceSilent, LinkError, WrongDevice
from bubbleskin.link import message
from bubbleskin.link.send_window import Request

_UNKNOWN = "Whether it was applied is unknown; it will not be applied any more."


def silent(request: Request, where: str) -> DeviceSilent:
    """No answer came in time."""
    error = DeviceSilent(
        f"The wristband at {where} has not answered {request.name} within {request.allowed:g} s. {_fate(request)} "
        "Check its cable and power, then connect again."
    )
    error.outcome_unknown = request.sends > 0
    return error


def abandoned(request: Request, where: str) -> DeviceSilent:
    """Another request was not answered, and this one went down with it."""
    error = DeviceSilent(
        f"The wristband at {where} has not answered a request before {request.name}. {_fate(request)} "
        "Check its cable and power, then connect again."
    )
    error.outcome_unknown = request.sends > 0
    return error


def lost(request: Request, problem: LinkError) -> LinkError:
    """The port has gone, and has not come back in time."""
    error = LinkError(f"{problem} {_fate(request)}")
    error.outcome_unknown = request.sends > 0
    return error


def restarted(request: Request, where: str) -> DeviceRestarted:
    """The device is another one than before: it has forgotten everything."""
    error = DeviceRestarted(
        f"The wristband at {where} has restarted, and vents. {_fate(request)} "
        "Its state is read anew and nothing was sent again; send what you still want."
    )
    error.outcome_unknown = request.sends > 0
    return error


def taken(request: Request, where: str) -> LinkError:
    """Another program has opened a session of its own."""
    error = LinkError(
        f"Another program talks to the wristband at {where}. {_fate(request)} Close it, or let it go on alone."
    )
    error.outcome_unknown = request.sends > 0
    return error


def version(low: int, high: int) -> str:
    """Which side to update when the device speaks protocols `low` to `high`."""
    theirs = f"protocol {low}" if low == high else f"protocols {low} to {high}"
    if high < PROTOCOL_MIN:
        return f"The wristband speaks {theirs}, this SDK {PROTOCOL_MIN} and newer: update the wristband's firmware."
    return f"The wristband speaks {theirs}, this SDK at most {PROTOCOL_MAX}: update it with `pip install --upgrade bubbleskin`."


def refused_hello(reply: message.Message) -> WrongDevice:
    """The device has refused to open a session."""
    if reply["error"] == errors.NO_COMMON_PROTOCOL:
        return WrongDevice(version(reply["low"], reply["high"]))
    if reply["error"] == errors.WRONG_LENGTH:  # it does not know of sessions
        return WrongDevice(version(1, 1))
    return WrongDevice(message.describe_refusal(reply))


def _fate(request: Request) -> str:
    return _UNKNOWN if request.sends else f"{request.name} was not applied."
