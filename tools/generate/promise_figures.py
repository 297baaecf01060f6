"""Keep what tests of promises measured, from JUnit files, in `docs/data/promises.json`; the page of promises is made from it.

python tools/generate/promise_figures.py hil.xml [board.xml …]

Figures of the same test and target are replaced, others stay. A run in which something failed is not taken.
"""

import argparse
import json
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import generated
from promises import FIGURES, KINDS, Shown, read_figures, tests, worst


def taken(path: Path, shown: dict[str, Shown]) -> dict[str, dict[str, Any]]:
    """Of one file: date and numbers, by test and kind of target."""
    try:
        suite = ET.parse(path).getroot().find("testsuite")
    except (OSError, ET.ParseError) as error:
        sys.exit(f"{path} is no JUnit file: {error}")
    if suite is None or int(suite.get("failures", "0")) or int(suite.get("errors", "0")):
        sys.exit(f"{path} is of a run in which something failed; mend that first.")
    found: dict[str, dict[str, Any]] = {}
    for case in suite.iter("testcase"):
        name = f"{case.get('file')}::{case.get('name', '').partition('[')[0]}"
        test = shown.get(name) or shown.get(f"hil_tests/{name}")  # `bubbleskin hil` begins at its folder
        if test is None or case.find("skipped") is not None:
            continue
        said = [(each.get("name", ""), each.get("value", "")) for each in case.iter("property")]
        kind = dict(said).get("target") or next(iter(test.reasons))
        entry = found.setdefault(test.test, {}).setdefault(
            kind, {"date": suite.get("timestamp", "")[:10], "figures": {}}
        )
        for what, value in said:
            if what != "target":
                number = float(f"{float(value):.4g}")
                entry["figures"][what] = worst(what, entry["figures"].get(what, number), number)
    return found


def main() -> None:
    """Read the files, and write what there is afterwards."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("junit", nargs="+", type=Path)
    paths = parser.parse_args().junit
    shown = {test.test: test for test in tests()}
    figures = {test: kinds for test, kinds in read_figures().items() if test in shown}
    for path in paths:
        for test, kinds in taken(path, shown).items():
            figures.setdefault(test, {}).update(kinds)
    ordered = {test: {kind: figures[test][kind] for kind in KINDS if kind in figures[test]} for test in sorted(figures)}
    (generated.ROOT / FIGURES).write_text(json.dumps(ordered, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    print(f"{FIGURES}: {sum(len(kinds) for kinds in ordered.values())} figures of {len(ordered)} tests")


if __name__ == "__main__":
    main()
