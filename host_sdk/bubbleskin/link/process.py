"""Which process a port belongs to. A fork has a copy of everything: session, numbers, locks, descriptors."""

import os
import weakref

from bubbleskin.link import errors
from bubbleskin.link.transport import Transport


class Owner:
    """The process that opened `transport`. In a fork of it every call is refused, and the copy of the port is let go of.

    One request from a fork would make the wristband take the next one of the process that opened it for a duplicate.
    """

    def __init__(self, transport: Transport):
        self.left_behind = False
        """Whether this is a copy in a fork."""
        self._transport = transport
        self._process = os.getpid()
        _owners.add(self)

    def check(self) -> None:
        """`LinkError` in a fork. Called before any lock is waited for: it may be held by a thread that is not here."""
        if self.left_behind:
            raise errors.other_process(self._transport.name, self._process, os.getpid())

    def leave_behind(self) -> None:
        """This is a copy in a fork."""
        self.left_behind = True
        self._transport.leave_behind()


_owners: "weakref.WeakSet[Owner]" = weakref.WeakSet()


def _leave_all_behind() -> None:
    for owner in tuple(_owners):
        owner.leave_behind()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_leave_all_behind)
