"""Telemetry that has come: it waits for whoever reads it, is counted, and is handed to those who listen."""

from collections import deque
from collections.abc import Callable

from bubble_protocol.schema import messages
from bubbleskin.link.message import Message

UNASKED = (messages.TELEMETRY, messages.TELEMETRY_FIELDS)
"""Messages that answer no request."""

_LENGTH = 4096
"""Messages that wait at most: of more, the oldest are dropped."""


class TelemetryQueue(deque[Message]):
    """The newest telemetry, oldest first. `listeners` are called with each message and `lost` as it comes.

    `lost` counts the messages that were due since `begin` and have not come: gaps in the sequence numbers, whether
    the device found no room or the link lost them.
    """

    def __init__(self) -> None:
        super().__init__(maxlen=_LENGTH)
        self.listeners: list[Callable[[Message, int], None]] = []
        self.lost = 0
        self._sequence = 0

    def begin(self) -> None:
        """A new subscription: sequence numbers begin at 1."""
        self.clear()
        self.lost = 0
        self._sequence = 0

    def go_on(self) -> None:
        """The same subscription anew, in another session: sequence numbers begin at 1, and what has come stays."""
        self._sequence = 0

    def append(self, message: Message) -> None:
        """Take one message."""
        gap = (message.sequence - self._sequence - 1) & 0xFFFF
        if gap < 0x8000:  # else one of a subscription that has ended, still on its way
            self.lost += gap
            self._sequence = message.sequence
        super().append(message)
        for listener in tuple(self.listeners):
            listener(message, self.lost)
