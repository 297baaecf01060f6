"""The file of a full recording: JSON, a line for each block of calls of the firmware, so that a kill loses the last one only.

The first line says what was recorded. Every other one is `{"tick": …, "calls": …, "data": …}`: how many ticks come before it,
how many calls of the firmware are in it, and these, compressed by zlib, in base64. The last is `{"end": ticks}`, where the
recording was closed. `docs/replay.md` says what stands in the data, byte by byte.
"""

import base64
import binascii
import json
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bubble_firmware.drivers.flash import SECTOR
from bubble_firmware.hal.lockstep import LINK_IN, LINK_OUT
from bubble_protocol.schema import system
from bubbleskin import checks, files
from bubbleskin.errors import InvalidInput

TRACE_FORMAT = 1
KIND = "full recording"
TICK, LOOK, POWER_FAILED, LOOP = range(4)
"""What is called: a tick, a look at the link between two, power that fails and comes back, the emergency stop's loop."""
DECIDED = (TICK, LOOK)
"""Calls after which there are decisions."""

_WHAT = "the full recording"
_FILE_MOST = 256 * 2**20
"""Bytes of a file that is read: hours, see docs/replay.md."""
_CALLS_MOST = 4096
_ROW_MOST = 64
_FLASH_MOST = 2**20
_HEAD = 6  # words: kind, phase, bytes in, bytes out, pump, dump
_LEVEL = 5  # of zlib: beyond it a block takes longer and is hardly smaller
_FLASH_CRC = 4  # bytes


class Call(NamedTuple):
    """One call of the firmware: what it was given, and what it decided."""

    kind: int
    """TICK, LOOK, POWER_FAILED or LOOP."""
    phase_us: int
    """Of LOOK: µs since the tick began. Of LOOP: 1 where it opens, as when the stop is pressed, 0 where it closes."""
    counts: bytes
    """Of TICK: one little-endian u16 per sensor, the supply's last."""
    link: bytes
    """What came over the link."""
    pulses: tuple[int, ...]
    """µs per period: fill and vent valve of each bubble in turn. Of others than TICK and LOOK: none."""
    pump: int
    dump: bool
    sent: bytes
    """What went out over the link. Of POWER_FAILED: the CRC-32 of flash, little-endian, where flash can be seen."""


@dataclass(frozen=True)
class Head:
    """What was recorded: the first line."""

    board: str
    bubbles: int
    tick_us: int
    board_crc: int
    """CRC-32 of the board's data, see `board_crc`."""
    interpreter: str
    firmware: str
    """Its version."""
    firmware_sha256: str
    """Of its sources, see `bubbleskin.toolchain.frozen.digest`."""
    boot_id: int
    boot_ticks: int
    """Device time before the first tick."""
    flash: bytes
    """What flash held when power came."""
    recorded: str
    """When the file was begun, ISO 8601."""

    def line(self) -> bytes:
        """The line."""
        facts = asdict(self) | {"flash": _packed(self.flash), "flash_bytes": len(self.flash)}
        return _line({"bubbleskin": KIND, "format": TRACE_FORMAT, **facts})


class Block(NamedTuple):
    """A line with calls."""

    tick: int
    """Ticks before it."""
    line: int
    calls: int
    data: str


class Calls:
    """Calls of a firmware with so many bubbles, gathered until they are a block."""

    def __init__(self, bubbles: int):
        self._bubbles = bubbles
        self._clear()

    def _clear(self) -> None:
        self.heads: list[int] = []
        self.counts, self.pulses, self.link, self.sent = (bytearray() for _ in range(4))

    def __len__(self) -> int:
        return len(self.heads) // _HEAD

    def take(self, tick: int) -> bytes:
        """The line of the block, before which `tick` ticks have been; the gathering begins anew."""
        heads = np.array(self.heads, "<u2").reshape(-1, _HEAD)
        counts = np.frombuffer(self.counts, np.uint16).reshape(-1, self._bubbles + 1)
        pulses = np.frombuffer(self.pulses, np.uint16).reshape(-1, 2 * self._bubbles)
        steps = np.diff(counts, axis=0, prepend=np.uint16(0))
        parts = (heads.T.tobytes(), steps.T.astype("<u2").tobytes(), pulses.T.astype("<u2").tobytes())
        line = _line({"tick": tick, "calls": len(heads), "data": _packed(b"".join((*parts, self.link, self.sent)))})
        self._clear()
        return line


class Trace:
    """A full recording that has been read: its `head`, how many `ticks` it has, and whether it was `closed`.

    `name`: how sentences call it.
    """

    def __init__(self, name: str, head: Head, blocks: Sequence[Block], ticks: int | None):
        self.name = name
        self.head = head
        self.closed = ticks is not None
        self.blocks = blocks
        self.ticks = ticks or 0

    def calls(self) -> Iterator[Call]:
        """Every call, in order; `InvalidInput` where a block is damaged."""
        for block in self.blocks:
            yield from _unpacked(block, self.head.bubbles, f"{self.name}, line {block.line}")


def end_line(ticks: int) -> bytes:
    """The last line."""
    return _line({"end": ticks})


def board_crc(data: Any) -> int:
    """CRC-32 of the data of a board: its names in capitals and their values."""
    known = sorted((name, value) for name, value in vars(data).items() if name.isupper())
    return zlib.crc32(repr(known).encode())


def read(path: str | Path) -> Trace:
    """The full recording at `path`. `InvalidInput` for any other file, and for one that is damaged before its last line.

    A last line that is torn is what a kill leaves: it is passed over.
    """
    name = f"The recording {files.path_of(path, _WHAT)}"
    lines = files.read_bytes(path, _WHAT, _FILE_MOST).split(b"\n")
    head = _head(lines[0], name)
    last = len(lines) - 1  # what follows the last line's end: nothing, or a line that is torn
    blocks: list[Block] = []
    ticks = None
    for number, line in enumerate(lines[1:last], 2):
        where = f"{name}, line {number}"
        if ticks is not None:
            raise InvalidInput(f"{where}: the recording ends in the line before; {_ADVICE}")
        tree = _tree(line, where)
        if "end" in tree:
            ticks = checks.whole(f"{where}: end", tree["end"], 0, system.TICKS_WRAP)
        else:
            blocks.append(_block(tree, number, where))
    return _continuous(Trace(name, head, blocks, ticks))


_ADVICE = "the file is damaged. Record anew."


def _continuous(trace: Trace) -> Trace:
    """The trace, where every block begins with the tick at which the one before has ended."""
    tick = 0
    for block in trace.blocks:
        where = f"{trace.name}, line {block.line}"
        if block.tick != tick:
            raise InvalidInput(f"{where}: the block begins after {block.tick} ticks, and {tick} have been; {_ADVICE}")
        tick += sum(call.kind == TICK for call in _unpacked(block, trace.head.bubbles, where))
    if trace.closed and tick != trace.ticks:
        raise InvalidInput(f"{trace.name} says that it has {trace.ticks} ticks and has {tick}; {_ADVICE}")
    trace.ticks = tick
    return trace


def _line(tree: dict[str, Any]) -> bytes:
    return json.dumps(tree, separators=(",", ":")).encode() + b"\n"


def _tree(line: bytes, where: str) -> dict[str, Any]:
    try:
        tree = files.parse_json(line.decode("ascii"), where)
    except UnicodeDecodeError:
        raise InvalidInput(f"{where}: this is not text; {_ADVICE}") from None
    if not isinstance(tree, dict):
        raise InvalidInput(f"{where}: this is {checks.shown(tree)}, and an object is due; {_ADVICE}")
    return tree


def _head(line: bytes, name: str) -> Head:
    advice = "Make one with skin.record('trouble.jsonl', full=True), of a simulated board."
    try:
        tree = _tree(line, name)
    except InvalidInput:
        raise InvalidInput(f"{name} is no full recording. {advice}") from None
    if tree.get("bubbleskin") != KIND:
        raise InvalidInput(f"{name} is no full recording. {advice}")
    if tree.get("format") != TRACE_FORMAT:
        raise InvalidInput(
            f"{name} has the format {checks.shown(tree.get('format'))}; this bubbleskin reads {TRACE_FORMAT}. "
            "Replay it with the bubbleskin that made it, or record anew."
        )
    missing = [field.name for field in fields(Head) if field.name not in tree]
    if missing:
        raise InvalidInput(f"{name} does not say its {missing[0]}; {_ADVICE}")
    whole = {
        key: checks.whole(f"{name}: {key}", tree[key], low, high)
        for key, low, high in (
            ("bubbles", 1, _ROW_MOST),
            ("tick_us", 1, 65535),
            ("board_crc", 0, 0xFFFFFFFF),
            ("boot_id", 0, 0xFFFFFFFF),
            ("boot_ticks", -1, system.TICKS_WRAP),
        )
    }
    texts = {
        key: checks.text(f"{name}: {key}", tree[key])
        for key in ("board", "interpreter", "firmware", "firmware_sha256", "recorded")
    }
    size = checks.whole(f"{name}: flash_bytes", tree.get("flash_bytes", 0), 0, _FLASH_MOST)
    if size % (2 * SECTOR):
        raise InvalidInput(f"{name}: flash_bytes is {size}; whole sectors for two slots are due. {_ADVICE}")
    flash = _inflated(tree["flash"], size, f"{name}: flash")
    if len(flash) != size:
        raise InvalidInput(f"{name}: flash has {len(flash)} bytes, and {size} are due; {_ADVICE}")
    return Head(flash=flash, **texts, **whole)  # type: ignore[arg-type]


def _block(tree: dict[str, Any], number: int, where: str) -> Block:
    if not {"tick", "calls", "data"} <= tree.keys():
        raise InvalidInput(f"{where}: this is no block of a recording; {_ADVICE}")
    tick = checks.whole(f"{where}: tick", tree["tick"], 0, system.TICKS_WRAP)
    count = checks.whole(f"{where}: calls", tree["calls"], 1, _CALLS_MOST)
    return Block(tick, number, count, checks.text(f"{where}: data", tree["data"]))


def _packed(data: bytes) -> str:
    return base64.b64encode(zlib.compress(data, _LEVEL)).decode()


def _inflated(text: Any, most: int, where: str) -> bytes:
    """What `_packed` made a text of, which is at most so long."""
    try:
        packed = base64.b64decode(checks.text(where, text), validate=True)
        inflate = zlib.decompressobj()
        data = inflate.decompress(packed, most + 1)
        whole = inflate.eof and not inflate.unused_data
    except (binascii.Error, ValueError, zlib.error):
        whole = False
    if not whole or len(data) > most:
        raise InvalidInput(f"{where} cannot be unpacked; {_ADVICE}")
    return data


def _unpacked(block: Block, bubbles: int, where: str) -> Iterator[Call]:
    """The calls of a block; the other way round is `Calls.take`."""
    count, sensors, valves = block.calls, bubbles + 1, 2 * bubbles
    most = count * (2 * (_HEAD + sensors + valves) + LINK_IN + LINK_OUT)
    data = _inflated(block.data, most, where)
    damaged = InvalidInput(f"{where}: the block does not hold what it says; {_ADVICE}")
    if len(data) < 2 * _HEAD * count:
        raise damaged
    heads = np.frombuffer(data, "<u2", _HEAD * count).reshape(_HEAD, count).T
    kinds, _, ins, outs, _, dumps = heads.T
    ticks, decisions = int((kinds == TICK).sum()), int(np.isin(kinds, DECIDED).sum())
    at = 2 * _HEAD * count
    rest = at + 2 * (ticks * sensors + decisions * valves)
    if (
        len(data) != rest + int(ins.sum()) + int(outs.sum())
        or kinds.max() > LOOP
        or ins.max() > LINK_IN
        or outs.max() > LINK_OUT
        or dumps.max() > 1
    ):
        raise damaged
    steps = np.frombuffer(data, "<u2", ticks * sensors, at).reshape(sensors, ticks).T
    counts = iter(np.cumsum(steps, axis=0, dtype=np.uint16).astype("<u2"))
    pulses = iter(
        np.frombuffer(data, "<u2", decisions * valves, at + 2 * ticks * sensors).reshape(valves, -1).T.tolist()
    )
    came, went = rest, rest + int(ins.sum())
    for kind, phase, size_in, size_out, pump, dump in heads.tolist():
        yield Call(
            kind,
            phase,
            next(counts).tobytes() if kind == TICK else b"",
            data[came : came + size_in],
            tuple(next(pulses)) if kind in DECIDED else (),
            pump,
            bool(dump),
            data[went : went + size_out],
        )
        came += size_in
        went += size_out
