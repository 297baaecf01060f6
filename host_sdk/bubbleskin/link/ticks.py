"""Device time beyond its wrap: a wristband counts ticks up to 2**30 and goes on from 0, after 62 days at 5 ms."""

from bubble_protocol.schema.system import TICKS_WRAP
from bubbleskin.link.message import Message


class DeviceTicks:
    """Makes the `ticks` of messages count on. Right as long as two messages are less than half a wrap apart."""

    def __init__(self) -> None:
        self._latest: int | None = None

    def unwrap(self, message: Message) -> None:
        """Replace the `ticks` of this message, where it has some, by those since boot or since the link was opened."""
        ticks = message.fields.get("ticks")
        if not isinstance(ticks, int):
            return
        if self._latest is not None:
            ahead = (ticks - self._latest) % TICKS_WRAP
            if ahead >= TICKS_WRAP // 2:  # a message that was overtaken, or a wristband that has started again
                ahead -= TICKS_WRAP
            ticks = max(self._latest + ahead, 0)
        message.fields["ticks"] = self._latest = ticks
