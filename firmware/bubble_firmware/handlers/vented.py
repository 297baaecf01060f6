"""What may only be done while all bubbles are vented."""

from bubble_protocol.mpy_compat import TYPE_CHECKING, const

if TYPE_CHECKING:
    from bubble_firmware.link.reply import Reply
    from bubble_firmware.safety.state import SafetyState

# [constants] bubble_protocol.schema.errors: NO_ELEMENT NOT_VENTED
# [constants] bubble_protocol.schema.modes: IDLE
_NO_ELEMENT = const(255)
_NOT_VENTED = const(15)
_IDLE = const(0)
# [end of constants]


def is_vented(reply: "Reply", safety: "SafetyState") -> bool:
    """Whether all bubbles are vented; refuses the request where they are not."""
    if not safety.control_mode:
        return True
    reply.refuse(_NOT_VENTED, 0, _NO_ELEMENT, safety.mode, _IDLE, _IDLE)
    return False
