"""Plant small changes drawn by chance from those that mutmut knows, one at a time, and say how many the tests find.

python tools/report/mutation_score.py                # a sample of 90
python tools/report/mutation_score.py --sample 300   # more of the same: the first 90 are those of before
python tools/report/mutation_score.py --only deadman # those in files whose paths have this word

mutmut's own run is not for device code: it puts all variants of a function into its module and a call in front that picks one.
Viper functions, which it leaves out, are compiled from their source, constants are folded by name, and the same files run on
MicroPython. So its operators alone are used, in decorated functions too, and each variant is planted as a whole source.
Sample and order are the same in every run; every part has its share. A survivor is to stand in tests/mutants/survivors.toml, with
the reason why no test can tell it from the source, or why none does.
"""

import argparse
import math
import random
import sys
import tomllib
from collections.abc import Iterator
from itertools import chain, zip_longest
from typing import NamedTuple

import libcst as cst
from mutmut.mutation.file_mutation import MutationVisitor
from mutmut.mutation.mutators import mutation_operators
from mutmut.mutation.pragma_handling import IgnoredCode
from planting import ROOT, workshop
from rich.console import Console
from rich.table import Table

SURVIVORS = ROOT / "tests" / "mutants" / "survivors.toml"
PARTS = {
    "control": ("firmware/bubble_firmware/control/*.py",),
    "safety": ("firmware/bubble_firmware/safety/*.py",),
    "link of the firmware": ("firmware/bubble_firmware/link/*.py",),
    "frame": ("protocol/bubble_protocol/frame.py",),
    "codec": ("protocol/bubble_protocol/codec.py", "protocol/bubble_protocol/packing.py"),  # which it packs with
    "link of the SDK": ("host_sdk/bubbleskin/link/*.py",),
}
SEED = 1
SAMPLE = 90
LEAST = 0.85
_Z = 1.96  # of an interval that has the true score in 95 of 100 cases


class Change(NamedTuple):
    """One change: `name` is file, line and which of that line's changes; `was` and `now` are what stands in `line`."""

    name: str
    part: str
    file: str
    line: str
    was: str
    now: str
    module: cst.Module
    node: cst.CSTNode
    other: cst.CSTNode

    @property
    def text(self) -> str:
        """The whole file with it."""
        return str(self.module.deep_replace(self.node, self.other).code)  # type: ignore[union-attr, arg-type]

    @property
    def key(self) -> tuple[str, ...]:
        """By what the reasons of survivors are found: a line's number does not stay."""
        return self.file, self.line, self.was, self.now


class _Visitor(MutationVisitor):
    """mutmut's, but that it goes into functions with decorators."""

    def _skip_node_and_children(self, node: cst.CSTNode) -> bool:
        if isinstance(node, cst.FunctionDef):
            return False
        return bool(super()._skip_node_and_children(node))


def changes(part: str, file: str) -> Iterator[Change]:
    """All changes of one file, in functions and methods: what stands outside is run when it is imported, or is generated."""
    source = (ROOT / file).read_text(encoding="utf-8")
    lines = source.splitlines()
    wrapper = cst.MetadataWrapper(cst.parse_module(source))
    visitor = _Visitor(mutation_operators, IgnoredCode(set(), set(), set()))
    module = wrapper.visit(visitor)
    positions = wrapper.resolve(cst.metadata.PositionProvider)
    numbers: dict[int, int] = {}
    for mutation in visitor.mutations:
        if mutation.contained_by_top_level_function is None:
            continue
        line = positions[mutation.original_node].start.line
        numbers[line] = numbers.get(line, 0) + 1
        was, now = (module.code_for_node(node).strip() for node in (mutation.original_node, mutation.mutated_node))
        name = f"{file}:{line}#{numbers[line]}"
        yield Change(
            name, part, file, lines[line - 1].strip(), was, now, module, mutation.original_node, mutation.mutated_node
        )


def drawn(only: str = "") -> list[Change]:
    """All changes in the order in which they are drawn: one of each part in turn, of a part by chance."""
    by_part = []
    for part, patterns in PARTS.items():
        files = sorted(str(path.relative_to(ROOT)) for pattern in patterns for path in ROOT.glob(pattern))
        found = list(chain.from_iterable(changes(part, file) for file in files))
        random.Random(f"{SEED} {part}").shuffle(found)
        by_part.append([change for change in found if only in change.file])
    return [change for turn in zip_longest(*by_part) for change in turn if change]


def interval(found: int, of: int) -> tuple[float, float]:
    """Wilson's, at 95 %: between what and what the share of all may be, when so many of a sample were found."""
    share, z2 = found / of, _Z * _Z
    middle = (share + z2 / (2 * of)) / (1 + z2 / of)
    half = _Z / (1 + z2 / of) * math.sqrt(share * (1 - share) / of + z2 / (4 * of * of))
    return max(0.0, middle - half), min(1.0, middle + half)


def main() -> int:
    """Draw, plant, run, tell."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sample", type=int, default=SAMPLE, metavar="N", help="how many (%(default)s)")
    parser.add_argument("--skip", type=int, default=0, metavar="N", help="leave out the first of them")
    parser.add_argument("--only", default="", metavar="WORD", help="in files whose paths have this word")
    asked = parser.parse_args()
    everything = drawn(asked.only)
    sample = everything[asked.skip : asked.sample]
    if not sample:
        sys.exit("There is nothing to plant: no file has this word, or all is skipped.")
    known = tomllib.loads(SURVIVORS.read_text(encoding="utf-8")) if SURVIVORS.exists() else {}
    reasons = {
        tuple(entry[name] for name in ("file", "line", "was", "now")): entry for entry in known.get("survivor", [])
    }
    found: dict[Change, str] = {}
    with workshop() as shop:
        print("the tests without any change", flush=True)
        shop.check({change.file for change in sample})
        for number, change in enumerate(sample, 1):
            with shop.planted(change.file, change.text):
                found[change] = shop.found_by(change.file)
            print(
                f"{number}/{len(sample)} {change.name} {change.was!r} -> {change.now!r}: {found[change] or 'NOT FOUND'}",
                flush=True,
            )
    return verdict(everything, found, reasons)


def verdict(everything: list[Change], found: dict[Change, str], reasons: dict[tuple[str, ...], dict[str, str]]) -> int:
    """The table, the score, and the survivors; 1 where the score is too low or a survivor has no reason."""
    console = Console(width=200)
    table = Table("part", "changes there are", "planted", "found", "the same as before", "survive")
    survivors = [change for change, test in found.items() if not test]
    same = {change for change in survivors if reasons.get(change.key, {}).get("same")}
    for part in PARTS:
        ours = [change for change in found if change.part == part]
        left = sum(change in survivors and change not in same for change in ours)
        equal = sum(change in same for change in ours)
        there_are = sum(change.part == part for change in everything)
        table.add_row(part, *map(str, (there_are, len(ours), len(ours) - left - equal, equal, left)))
    console.print(table)
    for change in survivors:
        console.print(
            f"{change.name}: {change.was} -> {change.now}: {reasons.get(change.key, {}).get('why', 'NO REASON')}",
            markup=False,
        )
    of, hits = len(found) - len(same), len(found) - len(survivors)
    low, high = interval(hits, of)
    console.print(
        f"{hits} of {of} changes are found, {hits / of:.1%} (95 % of such samples have the true score between {low:.1%} and "
        f"{high:.1%}); with the {len(same)} that change nothing {hits / len(found):.1%}."
    )
    unexplained = [change for change in survivors if change.key not in reasons]
    return 0 if hits >= LEAST * of and not unexplained else 1


if __name__ == "__main__":
    sys.exit(main())
