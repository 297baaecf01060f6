"""Brings a sequence's records to a device: all of them, or those of a stream as there is room for them."""

import itertools
from collections.abc import Iterator

from bubbleskin.link.link import Call, Link
from bubbleskin.link.message import Message
from bubbleskin.link.upload import upload
from bubbleskin.sequence.compile import Compiled

_WORDS_PER_MESSAGE = 121


class Uploader:
    """The upload of `compiled` as the sequence `identity` into a memory of `capacity` records."""

    def __init__(self, link: Link, identity: int, compiled: Compiled, capacity: int):
        self.id = identity
        self.compiled = compiled
        self.sequence = compiled.sequence
        self.streams = len(compiled) > capacity
        """Whether the memory does not hold it all, so that the rest is sent while it plays."""
        self.total = compiled.total if self.streams else len(compiled)
        """Records to send in all; 0 where there is no end."""
        self.unsent = True
        """Whether there is more to send."""
        self._link = link
        self._order = compiled.stream() if self.streams else iter(range(len(compiled)))
        self._per_message = _WORDS_PER_MESSAGE // compiled.records.shape[1]
        self._sent: list[int] = []  # records, in the order in which they were sent
        self._free = capacity

    def step(self, record: int) -> int:
        """The step that the device's record is; -1 where it is none of ours."""
        return int(self.compiled.steps[self._sent[record]]) if record < len(self._sent) else -1

    def name(self, step: int) -> str:
        """The name of a step; empty where it has none."""
        return self.sequence.each[step].name if step >= 0 else ""

    async def fill(self) -> None:
        """Send all that there is room for."""
        if not self.unsent:
            return
        if not self._free:
            self._free = (await self._link.call("SEQUENCE_STATE"))["free"]
        while self._free:
            before = len(self._sent)
            await upload(self._link, self._writes(), self._answered)
            if len(self._sent) == before:
                break
        self.unsent = self.total == 0 or len(self._sent) < self.total

    def _writes(self) -> Iterator[Call]:
        """Messages with the next records, as many as the memory has room for by what the device has said of it."""
        while self._free:
            part = list(itertools.islice(self._order, min(self._per_message, self._free)))
            if not part:
                return
            words = self.compiled.records[part].reshape(-1, 1).tolist()
            first = len(self._sent) & 0xFFFF
            self._sent += part
            self._free -= len(part)
            yield "SEQUENCE_WRITE", (self.id, first), words

    def _answered(self, replies: list[Message]) -> None:
        self._free = replies[-1]["free"]
