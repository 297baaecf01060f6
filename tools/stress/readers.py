"""Give every reader of files what no file should be, and see that it is read or refused in a sentence, within bounded memory.

    python tools/stress/readers.py                   # 100,000 inputs for ten readers
    python tools/stress/readers.py --inputs 5000     # fewer
    python tools/stress/readers.py --seed 7          # others

Good files with bytes changed, cut out and put in; good structures with other values in any place; random bytes; and headers that
claim 10 GB. What raises anything but `InvalidInput` is kept as `reader-…` beside its traceback. Ends with status 1 where
something did, where one input took longer than 20 s, or where memory grew by more than 100 MB at any time.
"""

import argparse
import copy
import json
import random
import resource
import struct
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import Progress

import bubbleskin as bs
from bubbleskin.sim import SimulatedBoard
from bubbleskin.sim.trace_file import read as read_trace

GROWN_MB = 100.0
SLOW_S = 20.0

TOKENS = [
    b"nan", b"inf", b"-inf", b"1e999", b"-1", b"9" * 400, b"9" * 5000, b"1_000", b"0x10", b"1j", b"true", b"null", b"1979-05-27",
    b'"', b"'", b"=", b"#", b";", b"\t", b",", b"\n", b"\r", b"\n\n\n", b"sep=;\n",
    b"[" * 2000, b"{" * 2000, b'{"a":' * 2000, b"]", b"}",
    b"\0", b"\xff\xfe", b"\xfe\xff", b"\xef\xbb\xbf", b"\xc2\xb5", b"\xb5", b"\\ud800", b"\xed\xa0\x80",
    b"PK\x03\x04", b"\xfd7zXZ\0", b"\x1f\x8b", b"\x93NUMPY",
]  # fmt: skip
LONG = [b"A" * 100_000, b"1," * 50_000, b"1\n" * 50_000]
LONG_SHARE = 0.02  # of the tokens: each takes some 0.1 s
VALUES = [
    None, True, False, 0, -1, 1, 2**31, 2**63, 10**400, 0.5, 1e300, float("nan"), float("inf"), "", "x", "6", "\ud800", "\0",
    [], [[]], {}, {"": None}, [1] * 1000, "x" * 1000,
]  # fmt: skip
CLAIMS = [(40_000, 40_000), (10**10,), (2**63,), (-1,), (0, 10**12), (10**5, 10**5, 10**5), ()]


@dataclass
class Reader:
    """One way in which files come in: what reads them, the name they have, and the bytes of a good one."""

    read: Callable[[Path], object]
    name: str
    good: bytes
    counts: Counter[str] = field(default_factory=Counter)
    slowest_s: float = 0.0


def readers(folder: Path) -> dict[str, Reader]:
    """All of them."""
    np.save(folder / "good.npy", np.full((2, 3), 6.0))
    bs.Calibration("wristband7", (bs.build_table(bs.YeohBalloon(), knots=3),)).save(folder / "good.toml")
    board = SimulatedBoard("wristband7", contact=False)
    board.write_plant(folder / "plant.toml")
    board.keep_history()
    recording = board.record(folder / "trouble.jsonl")
    board.step(0.05)
    recording.close()
    sequence = {
        "bubbleskin_sequence": 1,
        "loops": 2,
        "steps": [{"targets_mm": [6, 7], "ramp_s": 1}, {"repeat": 2, "steps": [{"targets_mm": [8, 7], "ramp_s": 0.5}]}],
    }
    layout = {"pitch_mm": 10, "positions_mm": [[0, 0], [10, 0]]}
    return {
        "measurements": Reader(
            bs.read_csv,
            "data.csv",
            b"bubble,step,height [mm],pressure [kPa]\n0,0,6.0,17.9\n0,1,7.0,19.9\n1,0,8.0,21.3\n",
        ),
        "timeline": Reader(bs.Sequence.load, "line.csv", b"time_s,b0,b1\n0,6,7\n1,8,\n"),
        "sequence": Reader(bs.Sequence.load, "sequence.json", json.dumps(sequence).encode()),
        "layout": Reader(bs.Layout.from_file, "layout.json", json.dumps(layout).encode()),
        "layout table": Reader(bs.Layout.from_file, "layout.csv", b"bubble,x_mm,y_mm\n0,0,0\n1,10,0\n"),
        "heightfield table": Reader(bs.shapes.load, "field.csv", b"6,7\n8,9\n"),
        "heightfield": Reader(bs.shapes.load, "field.npy", (folder / "good.npy").read_bytes()),
        "calibration": Reader(bs.Calibration.load, "tables.toml", (folder / "good.toml").read_bytes()),
        "full recording": Reader(read_trace, "trouble.jsonl", (folder / "trouble.jsonl").read_bytes()),
        "plant": Reader(
            lambda path: SimulatedBoard("wristband7", contact=False, plant=str(path)),
            "simulated.toml",
            (folder / "plant.toml").read_bytes(),
        ),
    }


def inputs(good: bytes, structure: Any, chance: random.Random) -> Iterator[bytes]:
    """Without end, what no file should be."""
    while True:
        kind = chance.random()
        if kind < 0.1:
            yield chance.randbytes(chance.randrange(300))
        elif kind < 0.4 and structure is not None:
            yield other_structure(structure, chance)
        else:
            yield damaged(good, chance)


def damaged(good: bytes, chance: random.Random) -> bytes:
    """With bytes changed, cut out and put in."""
    whole = bytearray(good)
    for _ in range(chance.randint(1, 4)):
        begin = chance.randint(0, len(whole))
        end = min(len(whole), begin + chance.choice([0, 0, 1, 2, 12, 1000]))
        tokens = LONG if chance.random() < LONG_SHARE else TOKENS
        whole[begin:end] = chance.choice(tokens) if chance.random() < 0.6 else chance.randbytes(chance.randrange(6))
    if chance.random() < 0.1:
        try:
            return bytes(whole).decode().encode(chance.choice(["utf-16", "utf-16-le", "utf-16-be", "cp1252", "utf-32"]))
        except UnicodeError:
            pass
    return bytes(whole)


def other_structure(structure: Any, chance: random.Random) -> bytes:
    """With another value in any place, one place more, or one less."""
    whole = copy.deepcopy(structure)
    for _ in range(chance.randint(1, 3)):
        places = list(_places(whole))
        if not places:
            break
        holder, key = chance.choice(places)
        if chance.random() < 0.2:
            del holder[key]
        elif chance.random() < 0.2:
            if isinstance(holder, dict):
                holder[chance.choice(["", "x", "loops", "board", "layout", "name", "\ud800"])] = copy.deepcopy(
                    chance.choice(VALUES)
                )
            else:
                holder.insert(key, copy.deepcopy(chance.choice(VALUES)))
        else:
            holder[key] = copy.deepcopy(chance.choice(VALUES))
    return json.dumps(whole).encode("utf-8", "surrogatepass")


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    for key in list(value) if isinstance(value, dict) else range(len(value)):
        yield value, key
        if isinstance(value[key], dict | list):
            yield from _places(value[key])


def claims() -> Iterator[bytes]:
    """Headers of .npy files that claim more than there is."""
    for shape in CLAIMS:
        for kind in ("<f8", "|S1000000000", "|O", [("a", "<f8")], "<c16", ">u8"):
            header = repr({"descr": kind, "fortran_order": False, "shape": shape}).encode().ljust(117) + b"\n"
            yield b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + b"\0" * 64
            yield b"\x93NUMPY\x02\x00" + struct.pack("<I", 0xFFFFFFFF) + header


def peak_mb() -> float:
    """The most that this process has had in memory."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def try_one(reader: Reader, data: bytes, path: Path) -> str | None:
    """What is wrong with how `data` was taken, if anything."""
    path.write_bytes(data)
    begin = time.monotonic()
    try:
        reader.read(path)
        reader.counts["read"] += 1
    except bs.InvalidInput as problem:
        reader.counts["refused"] += 1
        said = str(problem)
        if "\n" in said or not said.endswith((".", "?")) or len(said) > 1500:
            return f"no sentence: {said[:300]!r}"
    except Exception:
        reader.counts["raised"] += 1
        return traceback.format_exc()
    finally:
        reader.slowest_s = max(reader.slowest_s, time.monotonic() - begin)
    return None


def fuzz(count: int, seed: int) -> bool:
    """Give all readers so many inputs together; whether all went well."""
    chance = random.Random(seed)
    warnings.simplefilter("ignore")
    console, good = Console(stderr=True), True
    with tempfile.TemporaryDirectory() as name, Progress(console=console, disable=not console.is_terminal) as bar:
        folder = Path(name)
        all_readers = readers(folder)
        each = count // len(all_readers)
        for reader in all_readers.values():
            assert try_one(reader, reader.good, folder / reader.name) is None
            assert reader.counts["read"], "a good file is read"
        before, found = peak_mb(), set()
        for title, reader in all_readers.items():
            source = inputs(reader.good, json.loads(reader.good) if reader.name.endswith(".json") else None, chance)
            special = list(claims()) if reader.name.endswith(".npy") else []
            for number in bar.track(range(each), description=title):
                data = special[number] if number < len(special) else next(source)
                wrong = try_one(reader, data, folder / reader.name)
                if wrong and wrong.strip().splitlines()[-1][:60] not in found:
                    found.add(wrong.strip().splitlines()[-1][:60])
                    kept = Path(f"reader-{len(found)}-{reader.name}")
                    kept.write_bytes(data)
                    print(f"{title}, input {number}, kept as {kept}:\n{wrong}", flush=True)
                    good = False
            counts = ", ".join(f"{number} {what}" for what, number in sorted(reader.counts.items()))
            print(f"{title:18} {counts}; slowest {reader.slowest_s:.2f} s", flush=True)
            good &= reader.slowest_s < SLOW_S
        grown = peak_mb() - before
        print(f"memory at its most {grown:+.0f} MB, of {before:.0f}")
    return good and grown < GROWN_MB


def main() -> int:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    return 0 if fuzz(options.inputs, options.seed) else 1


if __name__ == "__main__":
    sys.exit(main())
