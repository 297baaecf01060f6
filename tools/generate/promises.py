"""What the promises' page is made of: `hil_tests/promises.toml`, the tests that name a promise, and what they have measured."""

import contextlib
import io
import json
import re
import sys
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import generated
import pytest

sys.path.append(str(generated.ROOT))  # for hil_tests, which are no package of ours
from hil_tests.conftest import KINDS, why_not

PROMISES = Path("hil_tests/promises.toml")
FIGURES = Path("docs/data/promises.json")
PAGES = {"safety": "Safety", "link": "The link", "store": "The store", "control": "Control"}
LIMIT = re.compile(r"\(at (most|least) ([\d.e+-]+)\)")


@dataclass(frozen=True)
class Promise:
    """One of the pages' promises."""

    id: str
    page: str
    says: str
    by: str
    assumes: str = "–"
    not_on: dict[str, str] = field(default_factory=dict)
    """A name of a reason by the kind of target that no test tries it on."""


@dataclass
class Shown:
    """A test that shows promises."""

    test: str
    """File and name."""
    promises: list[str] = field(default_factory=list)
    reasons: dict[str, str] = field(default_factory=dict)
    """Why it is not tried, by kind of target; a kind that is missing is no target of this test."""

    def tried(self, kind: str) -> bool:
        """Whether it is run there."""
        return self.reasons.get(kind) == ""


def promises(text: str) -> tuple[list[Promise], dict[str, str]]:
    """All promises, and what reasons mean."""
    said = tomllib.loads(text)
    reasons = said.pop("reasons")
    return [Promise(id=name, **what) for name, what in said.items()], reasons


class _Collector:
    """A plugin of pytest that keeps tests with a promise."""

    def __init__(self) -> None:
        self.found: dict[str, Shown] = {}

    def pytest_itemcollected(self, item: pytest.Item) -> None:
        """One test, with one set of parameters."""
        ids = [name for mark in item.iter_markers("promise") for name in mark.args]
        if not ids:
            return
        test = item.nodeid.partition("[")[0]
        shown = self.found.setdefault(test, Shown(test, ids))
        for kind in KINDS if "target" in item.fixturenames else [_own_kind(item)]:
            if not shown.tried(kind):  # with one set of parameters is enough
                shown.reasons[kind] = why_not(item, kind)


def _own_kind(item: Any) -> str:
    """What runs the firmware in a test that brings its own."""
    said = [
        *item.fixturenames,
        *(str(value) for value in getattr(getattr(item, "callspec", None), "params", {}).values()),
    ]
    if item.get_closest_marker("chip") and "micropython" not in said:
        return "rp2040"
    return "micropython" if any(word.partition(":")[0] == "micropython" for word in said) else "sim"


def tests() -> list[Shown]:
    """Every test that names a promise, as pytest finds them."""
    root = generated.ROOT
    paths = [path for folder in ("hil_tests", "tests") for path in sorted((root / folder).rglob("test_*.py"))]
    named = [str(path) for path in paths if "mark.promise(" in path.read_text(encoding="utf-8")]
    collector, said = _Collector(), io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        status = pytest.main(
            [
                "--collect-only",
                "-q",
                "-p",
                "no:cacheprovider",
                f"--rootdir={root}",
                f"--config-file={root}/pyproject.toml",
                *named,
            ],
            plugins=[collector],
        )
    if status != pytest.ExitCode.OK:
        sys.exit(f"Tests cannot be collected:\n{said.getvalue()[-3000:]}")
    return list(collector.found.values())


def complaints(known: list[Promise], reasons: dict[str, str], shown: list[Shown], figures: dict[str, Any]) -> list[str]:
    """What does not fit: a promise without a test, a test of none, a reason that is missing or not needed, figures of nobody."""
    said = []
    ids = {promise.id for promise in known}
    said += [
        f"{test.test} names the promise {name!r}, which is not in {PROMISES}"
        for test in shown
        for name in test.promises
        if name not in ids
    ]
    for promise in known:
        own = [test for test in shown if promise.id in test.promises]
        if not own:
            said.append(f"no test shows the promise {promise.id}")
        for kind in KINDS if own else ():
            tried = any(test.tried(kind) for test in own)
            told = any(test.reasons.get(kind) for test in own)
            if (tried or told) and kind in promise.not_on:
                said.append(f"{promise.id} is tried on {kind}, or its test says why not; not_on need not")
            elif not (tried or told or kind in promise.not_on):
                said.append(f"{promise.id} is tried on no {kind}, and not_on does not say why")
        said += (
            [f"{promise.id} is of the page {promise.page!r}, which has no promises"]
            if promise.page not in PAGES
            else []
        )
        said += [
            f"{promise.id} has the reason {why!r}, which is none"
            for why in promise.not_on.values()
            if why not in reasons
        ]
    names = {test.test for test in shown}
    said += [f"{FIGURES} has figures of {test}, which names no promise" for test in figures if test not in names]
    return said


def read_figures() -> dict[str, dict[str, Any]]:
    """What tests have measured: by test and kind of target, a date and numbers by their names."""
    found: dict[str, dict[str, Any]] = json.loads((generated.ROOT / FIGURES).read_text(encoding="utf-8"))
    return found


def worst(name: str, one: float, other: float) -> float:
    """Of two numbers the one nearer to the limit that stands in their name; the later where there is none."""
    limit = LIMIT.search(name)
    return other if limit is None else max(one, other) if limit[1] == "most" else min(one, other)
