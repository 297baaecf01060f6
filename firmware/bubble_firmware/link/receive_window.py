# mypy: disable-error-code="valid-type,index,operator,arg-type"
"""What makes every request count once: its session, its turn, and the replies kept for those that come again.

Frames of another boot or another session are no frames here: their CRC is mixed with another key. Within a
session requests are applied in the order of their numbers. One that comes too early waits in a slot; one that
comes again is answered from the replies kept, and not run again.
"""

from array import array

from bubble_protocol.buffers import copy
from bubble_protocol.crc import crc32_into
from bubble_protocol.frame import CRC, FRAME_MAX, NO_KEY
from bubble_protocol.mpy_compat import TYPE_CHECKING, const, micropython, ptr8

if TYPE_CHECKING:
    from bubble_protocol.mpy_compat import Buffer

WINDOW = const(8)
"""Requests that may be under way at once; as many slots for those that come too early."""

# [constants] bubble_protocol.schema.system: REPLIES_KEPT
_REPLIES_KEPT = const(16)
# [end of constants]

_SESSIONS = const(64)  # bytes: the last sixteen sessions

# What `open` says of a session.
SAME = const(0)  # it is open already
STALE = const(1)  # it was open before the one that is
OPENED = const(2)
NO_SESSION = const(3)  # its number is 0


@micropython.viper
def _find(words: ptr8, end: int, word: ptr8, at: int) -> int:
    """Where in `words[:end]` the four bytes `word[at:]` stand, -1 where nowhere."""
    i = 0
    while i < end:
        if (
            words[i] == word[at]
            and words[i + 1] == word[at + 1]
            and words[i + 2] == word[at + 2]
            and words[i + 3] == word[at + 3]
        ):
            return i
        i += 4
    return -1


class ReceiveWindow:
    """The open session of this boot; `boot_id` is an integer of 32 bits. `open` and `advance` are all that changes it."""

    def __init__(self, boot_id: int):
        self.key = bytearray(CRC)
        self.expected = 1  # the number whose turn it is, 16 bits
        self.early = 0  # how many requests wait for their turn
        # The reply to request n stands in place n modulo _REPLIES_KEPT.
        self.replies = [bytearray(FRAME_MAX) for _ in range(_REPLIES_KEPT)]
        self.lengths = array("H", bytearray(2 * _REPLIES_KEPT))  # 0: never answered, overtaken
        self._identity = bytearray(boot_id.to_bytes(4, "little") + NO_KEY)
        self._sessions = bytearray(_SESSIONS)
        self._session_at = 0
        self._slots = [bytearray(FRAME_MAX) for _ in range(WINDOW)]
        self._sizes = bytearray(WINDOW)  # 0: empty
        self._begin()

    def open(self, word: "Buffer", at: int) -> int:
        """Take up the session whose number is `word[at:at + 4]`: SAME, STALE, OPENED, or NO_SESSION."""
        if _find(NO_KEY, 4, word, at) == 0:
            return NO_SESSION
        place = _find(self._sessions, _SESSIONS, word, at)
        if place >= 0:  # a late repetition must not end the session that is open
            return SAME if place == self._session_at else STALE
        self._session_at = (self._session_at + 4) % _SESSIONS
        copy(word, at, at + 4, self._sessions, self._session_at)
        copy(word, at, at + 4, self._identity, 4)
        self._begin()
        return OPENED

    def _begin(self) -> None:
        crc32_into(self._identity, 0, 8, self.key, 0)
        self.expected = 1
        self.early = 0
        for index in range(WINDOW):
            self._sizes[index] = 0
        for index in range(_REPLIES_KEPT):
            self.lengths[index] = 0

    def advance(self) -> None:
        """The number whose turn it is has had it: applied, or overtaken."""
        expected = self.expected
        slot = expected % WINDOW
        if self._sizes[slot]:
            self._sizes[slot] = 0
            self.early -= 1
        self.lengths[expected % _REPLIES_KEPT] = 0
        self.expected = (expected + 1) & 0xFFFF

    def keep(self, number: int, frame: bytearray, length: int) -> None:
        """Keep a decoded request, `length` bytes from its id on, until its turn comes."""
        slot = number % WINDOW
        if not self._sizes[slot]:
            self._sizes[slot] = length
            self.early += 1
            copy(frame, 1, 1 + length, self._slots[slot], 1)

    def waiting(self) -> int:
        """The length of the request whose turn it is, 0 where it has not come. It is `slot()`."""
        return self._sizes[self.expected % WINDOW]

    def slot(self) -> bytearray:
        """The frame of the request whose turn it is."""
        return self._slots[self.expected % WINDOW]
