"""Sending what takes many messages: tables, the records of a sequence."""

from collections.abc import Callable, Iterable
from itertools import islice

from bubbleskin.link.link import Call, Link
from bubbleskin.link.message import Message

_TOGETHER = 8
"""Messages on their way at once: each has as long as any other call."""


async def upload(
    link: Link, calls: Iterable[Call], answered: Callable[[list[Message]], None] = lambda replies: None
) -> None:
    """Send `calls` in order, eight at a time; `answered` hears the replies to each eight.

    `calls` may be a generator, which makes the next ones only after `answered` has been told of those before. Raises
    what `Link.calls` does.
    """
    each = iter(calls)
    while together := list(islice(each, _TOGETHER)):
        answered(await link.calls(together))
