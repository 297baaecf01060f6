"""PING and its reply: the one request that has no turn, changes nothing and tells the time. No I/O, no clock."""

from bubble_protocol.schema import messages
from bubbleskin.link.message import Message, encode

_KEPT = 16


class Pings:
    """The PINGs that have been sent and not been answered yet."""

    def __init__(self) -> None:
        self.number = 0
        """Of the last one sent."""
        self.unanswered = 0
        """How many have been sent since one was answered."""
        self._sent: dict[int, float] = {}  # when, by number
        self._answers: dict[int, Message] = {}

    @property
    def waiting(self) -> bool:
        """Whether the last one has not been answered."""
        return self.number in self._sent

    def answer(self, number: int) -> Message | None:
        """The reply to PING `number`, where it has come."""
        return self._answers.get(number)

    def forget(self) -> None:
        """A new session: what was sent before is not answered any more."""
        self.unanswered = 0
        self._sent.clear()
        self._answers.clear()

    def frame(self, token: int, now: float, key: bytes) -> bytes:
        """One more."""
        self.number = self.number + 1 & 0xFFFF
        if len(self._sent) > _KEPT:
            self._sent.clear()
        self._sent[self.number] = now
        self.unanswered += 1
        return encode("PING", self.number, (token,), key=key)

    def settle(self, message: Message) -> float | None:
        """When the PING was sent that this replies to; None where there is none."""
        sent_at = self._sent.pop(message.sequence, None)
        if sent_at is None or message.id != messages.PING | messages.REPLY:
            return None
        self.unanswered = 0
        if len(self._answers) > _KEPT:
            self._answers.clear()
        self._answers[message.sequence] = message
        return sent_at
