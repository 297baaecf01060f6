"""Write `docs/promises.md`: each promise of the pages, the tests that show it, and what they measured last on each target.

python tools/generate/promises_page.py            # write it
python tools/generate/promises_page.py --check    # fail if it is not what would be written, or a promise and its tests do not fit

Nothing is measured here; `python tools/generate/promise_figures.py JUNIT…` takes figures from runs.
"""

import sys
from pathlib import Path
from typing import Any

import generated
from promises import FIGURES, KINDS, LIMIT, PAGES, PROMISES, Promise, Shown, complaints, promises, read_figures, tests

PATH = Path("docs/promises.md")
HEADS = {"sim": "`sim://`", "micropython": "`micropython://`", "rp2040": "`rp2040://`", "board": "a real board"}
HEAD = f"""# Promises

<!-- made by tools/generate/promises_page.py from {PROMISES}, the tests' marks and {FIGURES} -->

What [Safety](safety.md), [The link](link.md), [The store](store.md) and [Control](control.md) promise, each with who keeps it,
what it assumes, the tests that show it, and what these measured last on each target. *True* means by the simulated plant's truth,
which the firmware does not see. *Alone*: without neighbours that lift it. Of several
numbers the one nearest to its limit is shown.

"""
TESTS = "| promise | shown by | " + " | ".join(HEADS.values()) + " |\n|---|---|" + "---|" * len(HEADS) + "\n"
LEGEND = """*Held*: the test passed, and has no number. *Always*: a test of parts, in every `make test` or, of the chip,
`make chip`. *Not yet*: `bubbleskin hil` tries it there, and nobody has sent what came out.

"""
TAIL = """## Where figures come from

    pytest hil_tests --target sim://wristband7 --target micropython://wristband7 --junit-xml hil.xml
    bubbleskin hil --device /dev/ttyACM0 --junit board.xml
    python tools/generate/promise_figures.py hil.xml board.xml
    python tools/generate/promises_page.py

A test names its promises, `@pytest.mark.promise("silence")`, and tells what it measured with pytest's own `record_property`
([Writing a HIL test](hil_test.md)). The last command, and `make generated`, fail where a promise has no test, a test names one
that there is not, or nothing says why a target is left out.
"""


def cell(promise: Promise, test: Shown, kind: str, figures: dict[str, Any], first: bool) -> str:
    """What a test says of a target."""
    if measured := figures.get(test.test, {}).get(kind):
        return "<br>".join(_figure(name, value) for name, value in measured["figures"].items()) or "held"
    if test.tried(kind):
        return "not yet" if set(test.reasons) == set(KINDS) else "always"
    if kind in test.reasons:
        return f"*{test.reasons[kind]}*"
    return f"*{promise.not_on[kind]}*" if first and kind in promise.not_on else ""


def _figure(name: str, value: float) -> str:
    """`held after, s (at most 0.26)` and 0.25: "held after 0.25 s, at most 0.26"."""
    limit = LIMIT.search(name)
    what, _, unit = name[: limit.start() if limit else None].strip().rpartition(", ")
    what, unit = (what, f" {unit}") if what else (unit, "")
    return f"{what}: **{value:.3g}**{unit}" + (f", at {limit[1]} {limit[2]}" if limit else "")


def section(page: str, known: list[Promise], shown: list[Shown], figures: dict[str, Any]) -> str:
    """The promises of one page."""
    own = [promise for promise in known if promise.page == page]
    lines = [f"## {PAGES[page]}\n", "| promise | what | kept by | assumes |", "|---|---|---|---|"]
    lines += [f"| `{promise.id}` | {promise.says} | {promise.by} | {promise.assumes} |" for promise in own]
    rows = []
    for promise in own:
        of_it = [test for test in shown if promise.id in test.promises]
        of_it.sort(key=lambda test: not test.test.startswith("hil_tests/"))
        for test in of_it:
            first = test is of_it[0]
            name = f"`{promise.id}`" if first else ""
            path, _, words = test.test.partition("::test_")
            cells = (cell(promise, test, kind, figures, first) for kind in KINDS)
            rows.append(f"| {name} | `{path}`: {words.replace('_', ' ')} | {' | '.join(cells)} |\n")
    return "\n".join(lines) + "\n\n" + TESTS + "".join(rows) + "\n"


def measured_when(figures: dict[str, Any]) -> str:
    """When the oldest and the newest figure of each target were taken."""
    lines = []
    for kind in KINDS:
        dates = sorted(kinds[kind]["date"] for kinds in figures.values() if kind in kinds)
        if dates:
            lines.append(f"{HEADS[kind]} {dates[0]}" + (f" to {dates[-1]}" if dates[0] != dates[-1] else ""))
    return f"Measured: {'; '.join(lines) or 'nothing yet'}.\n"


def page() -> str:
    """All of it; ends the program where promises and tests do not fit."""
    known, reasons = promises((generated.ROOT / PROMISES).read_text(encoding="utf-8"))
    shown, figures = tests(), read_figures()
    if wrong := complaints(known, reasons, shown, figures):
        sys.exit("Promises and tests do not fit:\n" + "\n".join(wrong))
    legend = "".join(f"- *{name}*: {meaning}.\n" for name, meaning in reasons.items())
    said = HEAD + LEGEND + "Why a target is left out:\n\n" + legend + "\n" + measured_when(figures) + "\n"
    return said + "".join(section(name, known, shown, figures) for name in PAGES) + TAIL


if __name__ == "__main__":
    generated.main({PATH: page})
