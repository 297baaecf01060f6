"""HELLO and its reply: which session is open, with which boot of the device, and whether both ends can talk. No I/O, no clock."""

import logging
import secrets
import struct

from bubble_protocol.schema import messages
from bubble_protocol.schema.errors import OVERTAKEN
from bubble_protocol.version import PROTOCOL_MAX, PROTOCOL_MIN
from bubbleskin.errors import WrongDevice
from bubbleskin.link import errors
from bubbleskin.link.framing import crc32
from bubbleskin.link.message import Message, encode, session_key

_log = logging.getLogger(__name__)


class Handshake:
    """The session that is wanted or open, and the HELLOs that have been sent for it. Times are the transport's, in s."""

    def __init__(self) -> None:
        self.session = 0
        """A number that this host has drawn; never 0 once there is one."""
        self.boot_id: int | None = None
        """Of the device's boot in which a session was opened last; None before the first."""
        self.asked_at = 0.0
        """When the last HELLO was sent."""
        self.reply: Message | None = None
        """What has come since the last HELLO was sent while no session was open: a reply, or a refusal."""
        self._number = 0
        self._sent: dict[int, float] = {}  # when those were sent that asked for this session, by number

    def new_session(self, virtual_time: float | None = None) -> None:
        """Draw another session. With `virtual_time`, the same run twice draws the same."""
        if virtual_time is None:
            self.session = secrets.randbits(32) or 1
        else:
            self.session = crc32(struct.pack("<dH", virtual_time, self._number)) or 1
        self._sent.clear()

    def hello(self, now: float, *, again: bool) -> bytes:
        """Ask for the session; `again`: whether it is open, and this asks whether the device still is the same."""
        self._number = self._number + 1 & 0xFFFF
        if again:
            self._sent.clear()  # an answer to an earlier one may be of an earlier boot
        self._sent[self._number] = now
        self.reply = None
        self.asked_at = now
        frame = encode("HELLO", self._number, (PROTOCOL_MIN, PROTOCOL_MAX, self.session))
        if _log.isEnabledFor(logging.DEBUG):
            _log.debug("sent HELLO %d, %d bytes", self._number, len(frame))
        return b"\0" + frame  # the zero ends whatever half frame stands on the line

    def sent_at(self, message: Message) -> float | None:
        """When the HELLO was sent that this answers; None where it was none of this session."""
        return self._sent.get(message.sequence)

    def began(self, reply: Message) -> bytes:
        """The session is open, or open anew after a restart; the key of its frames."""
        boot_id = reply["boot_id"]
        if self.is_restart(reply):
            _log.info("the device has restarted: boot %08x, before it was %08x", boot_id, self.boot_id)
        else:
            _log.info("session %08x is open, boot %08x", self.session, boot_id)
        self.boot_id = boot_id
        return session_key(boot_id, self.session)

    def is_restart(self, reply: Message) -> bool:
        """Whether this reply is of another boot than the last session's."""
        return self.boot_id not in (None, reply["boot_id"])


def is_accepted(reply: Message) -> bool:
    """Whether the session is open with this reply to HELLO; if not, another one is to be drawn.

    `WrongDevice` where the device refuses for good, or speaks no protocol that this side knows.
    """
    if reply.id == messages.ERROR:
        if reply["error"] == OVERTAKEN:
            return False
        raise errors.refused_hello(reply)
    low, high = reply["protocol_min"], reply["protocol_max"]
    if high < PROTOCOL_MIN or low > PROTOCOL_MAX:
        raise WrongDevice(errors.version(low, high))
    return True
