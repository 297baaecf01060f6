"""What handles requests, and what it is given: the request's values, and the ways to answer."""

from bubble_protocol.mpy_compat import TYPE_CHECKING, const
from bubble_protocol.steps import copy_word

if TYPE_CHECKING:
    from collections.abc import Callable

    from bubble_firmware.device_clock import DeviceClock
    from bubble_firmware.link.sender import Sender

# [constants] bubble_protocol.schema.messages: ERROR REPLY
# [constants] message ERROR as ERROR: *
_ERROR = const(127)
_REPLY = const(128)
_ERROR_REQUEST = const(0)
_ERROR_ERROR = const(1)
_ERROR_FIELD = const(2)
_ERROR_ELEMENT = const(3)
_ERROR_ASKED = const(4)
_ERROR_LOW = const(5)
_ERROR_HIGH = const(6)
# [end of constants]


class Reply:
    """The one answer to the request that is being handled.

    `values` holds the request's fields, in the order of the schema, when the handler is called with the count of its
    repetitions; lengths and the schema's limits have been checked. The handler puts the reply's fields in the same
    place and calls `reply`, or it calls `acknowledge` or `refuse`: once.

    `request` is the id of that request, 0 once it is answered.
    """

    def __init__(self, sender: "Sender", clock: "DeviceClock"):
        self.values = sender.values
        self.request = 0
        self._sender = sender
        self._clock = clock
        self._number = 0
        self._ordered = False

    def begin(self, request: int, number: int, ordered: bool) -> None:
        """A request is going to be handled; the answer to one that has a turn is `ordered`: it is kept."""
        self.request = request
        self._number = number
        self._ordered = ordered

    def reply(self, count: int) -> None:
        """Answer with the request's own reply: its fields, and `count` repetitions, stand in `values`."""
        self._answer(self.request | _REPLY, count)

    def acknowledge(self) -> None:
        """Answer with a reply that has nothing to say but the device's time."""
        self.values[0] = self._clock.ticks
        self.reply(0)

    def refuse(self, error: int, field: int, element: int, asked: int, low: int, high: int) -> None:
        """Answer with an ERROR of the schema's `errors`; nothing has been changed.

        `field`: index of the field that is at fault. `element`: which repetition, or NO_ELEMENT. `asked`: its value.
        `low`, `high`: what is allowed.
        """
        self.values[_ERROR_ASKED] = asked
        self._refuse(error, field, element, low, high)

    def refuse_value(self, error: int, field: int, element: int, at: int, low: int, high: int) -> None:
        """Answer with an ERROR about `values[at]`, whatever its size: as an integer of MicroPython it could be an allocation."""
        copy_word(self.values, at, self.values, _ERROR_ASKED)
        self._refuse(error, field, element, low, high)

    def _refuse(self, error: int, field: int, element: int, low: int, high: int) -> None:
        values = self.values
        values[_ERROR_REQUEST] = self.request
        values[_ERROR_ERROR] = error
        values[_ERROR_FIELD] = field
        values[_ERROR_ELEMENT] = element
        values[_ERROR_LOW] = low
        values[_ERROR_HIGH] = high
        self._answer(_ERROR, 0)

    def _answer(self, message_id: int, count: int) -> None:
        self.request = 0
        if self._ordered:
            self._sender.answer(message_id, self._number, count)
        else:
            self._sender.send(message_id, self._number, count)


class Handlers:
    """A group of requests that belong together, for `Server.register`.

    `capabilities`: what the host may count on where they are registered, bits of the schema. `slow`: the ids of those that
    take most of a tick on the chip.
    """

    capabilities = 0
    slow: "tuple[int, ...]" = ()

    def requests(self) -> "dict[int, Callable[[int], None]]":
        """What handles which message: a method, given the count of repetitions, that answers once by its `Reply`."""
        raise NotImplementedError
