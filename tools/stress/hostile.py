"""Give the firmware, in a real MicroPython with the board's heap, inputs that nobody should send: frames whose CRC is right.

    python tools/stress/hostile.py                                     # 100,000 for each board, some minutes
    python tools/stress/hostile.py --board wristband7 --inputs 2000    # fewer
    python tools/stress/hostile.py --seed 2                            # others

Any message of the schema with fields at random, at their limits and beyond, too long and too short; honest conversations
(shapes, tables, trims, sequences, settings, faults) with something wrong in them; numbers out of turn; unknown ids; sessions
that come and go; and between them frames with a wrong CRC, torn ones, junk and silence. Ends with status 1 where the heap,
collected, is not to the byte what it was after boot, where less than half of it was ever free, where an exception was
raised, or where the next honest PING is not answered.
"""

import argparse
import random
import struct
import subprocess
import sys
import tempfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from bubble_firmware import boards
from bubble_firmware.control import nominal
from bubble_protocol import codec, steps
from bubble_protocol.frame import PAYLOAD_MAX
from bubble_protocol.schema import messages, sequences
from bubbleskin.sim.micropython import HEAP, source_path
from bubbleskin.toolchain.interpreter import find_micropython

RAW, GOOD, BAD, PAUSE = range(4)
BLOCK = 256
BOARDS = ("wristband7", "wristband19")
INPUTS = 100_000
ENDS = {
    messages.U8: (0, 0xFF),
    messages.U16: (0, 0xFFFF),
    messages.I32: (-0x80000000, 0x7FFFFFFF),
    messages.U32: (0, 0xFFFFFFFF),
}
_SCRIPT = "import sys; sys.path[:] = {path!r}\nimport gc; gc.threshold(16384)\nfrom hostile_device import run\nrun({board!r})\n"


@dataclass
class Outcome:
    """What became of the firmware, over all its starts (it may be asked to start again)."""

    free: int
    """Bytes of the heap that were free after a start, at the least."""
    used: int
    """Bytes taken since a start and not collected yet, at the most."""
    lost: int
    """Bytes by which the heap, collected, was not what it was after its start, at the most."""
    exceptions: int
    answered: bool
    frames: tuple[int, ...]
    """Taken, refused as none, sent."""
    ticks: tuple[int, ...]
    """Ticks; and ticks of bubbles with the fill valve, the vent valve or neither open."""
    starts: int
    """Of the firmware: it was asked to start again."""

    @property
    def harmless(self) -> bool:
        """Whether nothing is lost."""
        return not self.lost and 2 * self.used <= self.free and not self.exceptions and self.answered


class Hostile:
    """Makes inputs, blocks as `hostile_device.py` takes them: `block` after `block`, the same for the same seed."""

    def __init__(self, board: str, seed: int):
        self.n = boards.load(board).BUBBLES
        self.crc = zlib.crc32(board.encode())
        self.chance = random.Random(seed)
        self.requests = [
            message
            for message in codec.BY_ID.values()
            if not message.id & messages.REPLY and message.id | messages.REPLY in codec.BY_ID
        ]
        self.talk = iter(())  # what is left of a conversation

    def block(self) -> bytes:
        """The next input."""
        kinds = (self.anything, self.honest, self.wrong_size, self.unknown, self.junk, self.silence)
        what, offset, message_id, payload = self.chance.choices(kinds, (35, 45, 8, 4, 6, 2))[0]()
        return bytes((what, offset, message_id, len(payload))).ljust(4, b"\0") + payload.ljust(BLOCK - 4, b"\0")

    # Each returns what it is, 128 plus how far its number is from the one whose turn it is, id, and payload.

    def frame(self, message_id: int, payload: bytes) -> tuple[int, int, int, bytes]:
        """Mostly whole and in its turn."""
        chance = self.chance
        what = BAD if chance.random() < 0.03 else GOOD
        offset = chance.choice([*range(-17, 18), -128, 127]) if chance.random() < 0.15 else 0
        return what, 128 + offset, message_id, payload[:PAYLOAD_MAX]

    def anything(self) -> tuple[int, int, int, bytes]:
        """Any request, with any values."""
        message = self.chance.choice(self.requests)
        room = (PAYLOAD_MAX - message.fixed_size) // message.stride if message.stride else 0
        count = min(room, self.chance.choice([0, 1, self.n - 1, self.n, self.n, self.n, self.n + 1, room]))
        payload = self.fields(message.fixed) + b"".join(self.fields(message.repeated) for _ in range(count))
        return self.frame(message.id, payload)

    def fields(self, fields: tuple) -> bytes:
        """Values at random, or at the edges of what is allowed and of what can be said."""
        out = b""
        for _, kind, _, low, high, _ in fields:
            least, most = ENDS[kind]
            edges = [
                least,
                most,
                low or least,
                high or most,
                (low or 0) - 1,
                (high or 0) + 1,
                1,
                self.n - 1,
                self.n,
                14_000,
            ]
            value = self.chance.choice([*edges, self.chance.randint(least, most), self.chance.randrange(64)])
            out += (value & (1 << 8 * (kind & 15)) - 1).to_bytes(kind & 15, "little")
        return out

    def wrong_size(self) -> tuple[int, int, int, bytes]:
        """A request cut off or drawn out."""
        _, _, message_id, payload = self.anything()
        size = self.chance.choice(
            [len(payload) - 1, len(payload) + 1, self.chance.randrange(PAYLOAD_MAX + 1), PAYLOAD_MAX]
        )
        return self.frame(message_id, payload[: max(size, 0)].ljust(size, b"\x5a"))

    def unknown(self) -> tuple[int, int, int, bytes]:
        """An id that is no request's: replies, and what nobody has heard of."""
        return self.frame(self.chance.randrange(1, 256), self.chance.randbytes(self.chance.randrange(40)))

    def junk(self) -> tuple[int, int, int, bytes]:
        """Bytes that are no frame, without an end, or with many."""
        data = self.chance.randbytes(self.chance.choice([1, 10, BLOCK - 4]))
        style = self.chance.randrange(3)
        if style == 1:  # longer than any frame, with the next
            data = data.replace(b"\0", b"\1")
        elif style == 2:
            data = bytes(byte & 3 for byte in data)
        return RAW, 0, 0, data

    def silence(self) -> tuple[int, int, int, bytes]:
        """Ticks without anything: bubbles move, the host seems gone."""
        return PAUSE, 0, 0, bytes(self.chance.choice([1, 10, 60, 250]))

    def honest(self) -> tuple[int, int, int, bytes]:
        """The next of a conversation that makes sense, at times with something wrong in it."""
        step = next(self.talk, None)
        if step is None:
            talk = self.chance.choice([self.shapes, self.tables, self.trims, self.sequence, self.asks, self.session])
            self.talk = talk()
            step = next(self.talk)
        name, values = step[0], step[1:]
        if name == "PAUSE":
            return PAUSE, 0, 0, bytes(values[0])
        message = next(one for one in self.requests if one.name == name)
        payload = bytearray(
            b"".join(
                (value & (1 << 8 * (field[1] & 15)) - 1).to_bytes(field[1] & 15, "little")
                for value, field in zip(values, self.kinds(message, len(values)), strict=True)
            )
        )
        if payload and self.chance.random() < 0.05:
            payload[self.chance.randrange(len(payload))] ^= 1 << self.chance.randrange(8)
        return self.frame(message.id, bytes(payload))

    def kinds(self, message: codec.Message, count: int) -> list[tuple]:
        """The field of each of so many values."""
        return [*message.fixed, *message.repeated * count][:count]

    # Conversations: names of requests, with all their values in a row.

    def heights(self) -> list[int]:
        return [self.chance.choice([0, 4000, 6500, 9000, 12_000, 14_000]) for _ in range(self.n)]

    def shapes(self) -> Iterator[tuple]:
        yield "SUBSCRIBE", self.chance.choice([0, 1, 10])
        for _ in range(self.chance.randrange(1, 6)):
            yield "SHOW", self.chance.choice([0, 0, 50, 1000]), *self.heights()
            yield "PAUSE", self.chance.choice([5, 40, 45])
            yield ("STATE",)
        yield self.chance.choice([("STOP",), ("VENT",), ("CLEAR",)])

    def tables(self) -> Iterator[tuple]:
        knots = [value for knot in nominal.KNOTS for value in knot]
        count = len(knots) // 2
        for bubble in range(self.n):
            for first in range(0, count, messages.KNOTS_PER_MESSAGE):
                yield "TABLE_WRITE", bubble, first, count, *knots[2 * first : 2 * (first + messages.KNOTS_PER_MESSAGE)]
        yield "TABLE_COMMIT", zlib.crc32(struct.pack(f"<{len(knots)}H", *knots) * self.n)
        yield "TABLE_READ", self.chance.randrange(self.n), 0

    def trims(self) -> Iterator[tuple]:
        board = self.chance.randrange(150, 190)
        yield ("VENT",)
        yield "PAUSE", 250
        yield "TRIM_WRITE", *[value for _ in range(self.n) for value in (board, 1100, 900, 4000)]
        yield ("TRIM_READ",)
        yield self.chance.choice([("STORE_SAVE",), ("STORE_RESET",), ("STORE_INFO",)])

    def sequence(self) -> Iterator[tuple]:
        name, blank = self.chance.randrange(1, 9), [0] * (self.n + 2)
        words = [steps.REPEAT, self.chance.choice([0, 3]), *blank]
        for until in (steps.TIME, steps.SETTLE):
            words += [steps.flags(steps.SMOOTH, until, 0), 40, 60, 300 * until, *self.heights()]
        words += [steps.END, 0, *blank]
        records = self.chance.choice([4, 4, 4, 0, 5])
        yield (
            "SEQUENCE_BEGIN",
            name,
            self.n,
            self.chance.choice([0, self.crc]),
            records,
            zlib.crc32(struct.pack(f"<{len(words)}H", *words)),
        )
        yield "SEQUENCE_WRITE", name, 0, *words
        yield "SEQUENCE_ARM", name
        yield "SEQUENCE_START", name, 0
        for verb in (sequences.PAUSE, sequences.RESUME, sequences.END):
            yield "PAUSE", self.chance.choice([1, 30, 200])
            yield ("SEQUENCE_STATE",)
            yield "SEQUENCE_CONTROL", name, verb

    def asks(self) -> Iterator[tuple]:
        yield "SUBSCRIBE_FIELDS", self.chance.choice([0, 2, 20]), self.chance.randrange(256)
        yield "FAULTS_READ", self.chance.randrange(20)
        yield "FAULTS_ACK", self.chance.randrange(20)
        yield "SETTING_WRITE", 0, self.chance.choice([50, 250, 5000]), 1, self.chance.choice([100, 1000, 60_000])
        for name in ("SETTING_READ", "INFO", "TICKS", "STORE_INFO", "CLEAR"):
            yield (name,)
        yield ("LAYOUT",)

    def session(self) -> Iterator[tuple]:
        yield "HELLO", 2, 2, self.chance.randrange(40)
        yield "PING", self.chance.randrange(1 << 32)
        yield "RESTART", self.chance.randrange(3)


def attack(board: str, inputs: int, seed: int = 1, progress: bool = False) -> Outcome:
    """Give a board so many inputs and see what becomes of it."""
    hostile = Hostile(board, seed)
    path = [str(Path(__file__).parent), *source_path()]
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder, "script.py")
        script.write_text(_SCRIPT.format(path=path, board=board), encoding="utf-8")
        command = [find_micropython(), "-X", f"heapsize={HEAP}", script]
        with subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        ) as process:
            assert process.stdin
            try:
                for number in range(inputs):
                    process.stdin.write(hostile.block())
                    if progress and not (number + 1) % max(1, inputs // 10):
                        print(f"{board}: {number + 1} of {inputs} inputs", flush=True)
            except BrokenPipeError:
                pass  # it says below why it has ended
            said, problem = process.communicate()
    if process.returncode:
        raise RuntimeError(f"MicroPython ended with status {process.returncode}:\n{problem.decode()}")
    lines = {name: tuple(map(int, rest)) for name, *rest in map(str.split, said.decode().splitlines())}
    return Outcome(
        *lines["heap"],
        *lines["exceptions"],
        lines["answered"] == (1,),
        lines["frames"],
        lines["ticks"],
        *lines["starts"],
    )


def main() -> int:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--board", choices=BOARDS, help="this one; without it, one after the other")
    parser.add_argument("--inputs", type=int, default=INPUTS)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    good = True
    for board in [asked.board] if asked.board else BOARDS:
        outcome = attack(board, asked.inputs, asked.seed, progress=True)
        frames, ticks = outcome.frames, outcome.ticks
        print(
            f"{board}, seed {asked.seed}, {asked.inputs} inputs: heap free after a start {outcome.free} bytes, "
            f"{outcome.used} used at the most, {outcome.lost} lost; {frames[0]} frames taken, {frames[1]} refused as none, "
            f"{frames[2]} sent, {outcome.starts} starts, {ticks[0]} ticks, "
            f"valves open in {ticks[1] + ticks[2]} of {sum(ticks[1:])}; "
            f"{outcome.exceptions} exceptions, {'answers' if outcome.answered else 'does not answer'}",
            flush=True,
        )
        good = good and outcome.harmless
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
