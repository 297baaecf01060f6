"""Plant the mistakes of tests/mutants/mutants.toml, one at a time, and say what finds them.

python tools/report/mutants.py                  # hil_tests on sim://wristband7, then the tests of the part
python tools/report/mutants.py --only deadman   # those whose names have this word
python tools/report/mutants.py --parts          # the tests of the parts alone

A mutant is found by whatever fails first.
"""

import argparse
import sys
import tomllib
from typing import NamedTuple

from planting import HIL, ROOT, Workshop, workshop
from rich.console import Console
from rich.markup import escape
from rich.table import Table

LIST = ROOT / "tests" / "mutants" / "mutants.toml"
HIL_LEAST = 0.9
"""Of those that can be seen from outside, so many are to be found by hil_tests alone."""
ALL_LEAST = 0.95


class Mutant(NamedTuple):
    """One mistake. `outside`: why no host can see it; empty where one can. `tests`: those that find it where no everyday test
    can. `survives`: why nothing finds it.
    """

    name: str
    file: str
    old: str
    new: str
    outside: str = ""
    tests: tuple[str, ...] = ()
    survives: str = ""


def mutants() -> list[Mutant]:
    """The list, each checked to be one place in its file."""
    entries = tomllib.loads(LIST.read_text(encoding="utf-8"))["mutant"]
    found = [Mutant(**{**entry, "tests": tuple(entry.get("tests", ()))}) for entry in entries]
    for mutant in found:
        places = (ROOT / mutant.file).read_text(encoding="utf-8").count(mutant.old)
        if places != 1:
            sys.exit(
                f"{mutant.name}: what it replaces stands {places} times in {mutant.file}; it has to stand there once."
            )
    return found


def found_by(mutant: Mutant, shop: Workshop, *, parts: bool) -> str:
    """The test that finds it first; empty where none does. `parts`: hil_tests are left out."""
    text = (ROOT / mutant.file).read_text(encoding="utf-8").replace(mutant.old, mutant.new)
    with shop.planted(mutant.file, text):
        if not parts and (found := shop.run(HIL)):
            return found
        return shop.found_by(mutant.file) or (shop.run(mutant.tests, "") if mutant.tests else "")


def main() -> int:
    """Plant, run, tell."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", metavar="WORD", help="mutants whose names have this word")
    parser.add_argument("--parts", action="store_true", help="leave hil_tests out")
    asked = parser.parse_args()
    wanted = [mutant for mutant in mutants() if asked.only in mutant.name]
    if not wanted:
        sys.exit(f"No mutant's name has {asked.only!r}; the list is {LIST.relative_to(ROOT)}.")
    table = Table("mutant", "found by", "why hil_tests cannot, or why it survives")
    console = Console(width=200)
    found = {}
    with workshop() as shop:
        print("the tests without any mistake", flush=True)
        shop.check({mutant.file for mutant in wanted}, *([] if asked.parts else [HIL]))
        for number, mutant in enumerate(wanted, 1):
            test = found[mutant] = found_by(mutant, shop, parts=asked.parts)
            print(f"{number}/{len(wanted)} {mutant.name}: {test or 'NOT FOUND'}", flush=True)
            table.add_row(mutant.name, escape(test) or "nothing", mutant.survives or mutant.outside)
    console.print(table)
    return verdict(found, console)


def verdict(found: dict[Mutant, str], console: Console) -> int:
    """Say how many are found by what; 1 where that is less than it is to be, or a survivor has no reason."""
    by_hil = {mutant for mutant, test in found.items() if test.startswith("hil_tests")}
    visible = {mutant for mutant in found if not mutant.outside}
    survivors = {mutant for mutant, test in found.items() if not test}
    console.print(
        f"{len(found)} mutants. hil_tests find {len(by_hil & visible)} of the {len(visible)} that can be seen from outside, and "
        f"{len(by_hil - visible)} more; the tests of the parts find {len(found) - len(by_hil) - len(survivors)} of the rest; "
        f"{len(survivors)} survive: {', '.join(sorted(mutant.name for mutant in survivors)) or 'none'}."
    )
    enough = len(found) - len(survivors) >= ALL_LEAST * len(found) and all(mutant.survives for mutant in survivors)
    seen = not by_hil or len(by_hil & visible) >= HIL_LEAST * len(visible)
    return 0 if enough and seen else 1


if __name__ == "__main__":
    sys.exit(main())
