"""What is said when a link fails."""

from typing import TypeVar

from bubble_protocol.schema import errors
from bubble_protocol.version import PROTOCOL_MAX, PROTOCOL_MIN
from bubbleskin.errors import DeviceRestarted, DeviceSilent, LinkError, WrongDevice
from bubbleskin.link.message import Message
from bubbleskin.link.refusals import describe_refusal
from bubbleskin.link.send_window import Request

_E = TypeVar("_E", bound=LinkError)

_UNKNOWN = "Whether it was applied is unknown; it will not be applied any more."


def connection_lost(name: str, why: object = None) -> LinkError:
    """The port or simulation called `name` has gone."""
    reason = f" ({why})" if why else ""
    return LinkError(f"The connection to {name} is lost{reason}. Check the cable and connect again.")


def silent(request: Request, name: str) -> DeviceSilent:
    """No answer came in time from the wristband at `name`."""
    return _unanswered(
        request, f"The wristband at {name} has not answered {request.name} within {request.allowed:g} s."
    )


def abandoned(request: Request, name: str) -> DeviceSilent:
    """Another request was not answered, and this one went down with it."""
    return _unanswered(request, f"The wristband at {name} has not answered a request before {request.name}.")


def lost(request: Request, problem: LinkError) -> LinkError:
    """The port has gone, and has not come back in time."""
    return _of(request, LinkError(f"{problem} {_fate(request)}"))


def restarted(request: Request, name: str) -> DeviceRestarted:
    """The device is another one than before: it has forgotten everything."""
    sentence = (
        f"The wristband at {name} has restarted, and vents. {_fate(request)} "
        "Its state is read anew and nothing was sent again; send what you still want."
    )
    return _of(request, DeviceRestarted(sentence))


def taken(request: Request, name: str) -> LinkError:
    """Another program has opened a session of its own."""
    sentence = f"Another program talks to the wristband at {name}. {_fate(request)} Close it, or let it go on alone."
    return _of(request, LinkError(sentence))


def other_process(name: str, opened: int, here: int) -> LinkError:
    """A skin is used in a fork of the process that opened it."""
    return LinkError(
        f"The connection to {name} belongs to process {opened}; this is process {here}, forked from it. Nothing was sent. "
        "Connect in this process, once the other one has closed its own, or send what to do to that one."
    )


def no_wristband(name: str, patience: float, heard: bool) -> WrongDevice:
    """What is at `name` has not answered HELLO within `patience` seconds; `heard`: it sends something."""
    what = "It sends data, but not ours." if heard else "It says nothing at all."
    return WrongDevice(
        f"What is at {name} does not answer as a wristband within {patience:g} s. {what} "
        "Check that it is the right port and that the wristband runs bubbleskin firmware."
    )


def turned_away(problem: LinkError, name: str, said: str) -> LinkError:
    """What is at `name` has ended the connection before a session was open; `said`: the text it gave as a reason."""
    if not said or isinstance(problem, WrongDevice):
        return problem
    return LinkError(f"What is at {name} has ended the connection. It says: {said}")


def version(low: int, high: int) -> str:
    """Which side to update when the device speaks protocols `low` to `high`."""
    theirs = f"protocol {low}" if low == high else f"protocols {low} to {high}"
    if high < PROTOCOL_MIN:
        return f"The wristband speaks {theirs}, this SDK {PROTOCOL_MIN} and newer: update the wristband's firmware."
    return f"The wristband speaks {theirs}, this SDK at most {PROTOCOL_MAX}: update it with `pip install --upgrade bubbleskin`."


def refused_hello(reply: Message) -> WrongDevice:
    """The device has refused to open a session."""
    if reply["error"] == errors.NO_COMMON_PROTOCOL:
        return WrongDevice(version(reply["low"], reply["high"]))
    if reply["error"] == errors.WRONG_LENGTH:  # it does not know of sessions
        return WrongDevice(version(1, 1))
    return WrongDevice(describe_refusal(reply))


def _unanswered(request: Request, sentence: str) -> DeviceSilent:
    return _of(request, DeviceSilent(f"{sentence} {_fate(request)} Check its cable and power, then connect again."))


def _of(request: Request, error: _E) -> _E:
    error.outcome_unknown = request.sends > 0
    return error


def _fate(request: Request) -> str:
    return _UNKNOWN if request.sends else f"{request.name} was not applied."
