"""What the generator of docs/promises.md complains of; that there is nothing, `--check` says in `make generated`."""

import importlib.util
import sys

import pytest


@pytest.fixture(scope="module")
def tool(root):
    """`tools/generate/promises.py`."""
    folder = str(root / "tools/generate")
    sys.path.insert(0, folder)
    try:
        spec = importlib.util.spec_from_file_location("promises", f"{folder}/promises.py")
        module = importlib.util.module_from_spec(spec)
        sys.modules["promises"] = module  # dataclasses look there
        spec.loader.exec_module(module)
        return module
    finally:
        sys.path.remove(folder)


ELSEWHERE = {"micropython": "why", "rp2040": "why", "board": "why"}


def test_what_fits_is_taken(tool):
    known = [tool.Promise("kept", "safety", "", "", not_on=ELSEWHERE)]
    assert (
        tool.complaints(known, {"why": ""}, [tool.Shown("a::test_b", ["kept"], {"sim": ""})], {"a::test_b": {}}) == []
    )


def test_what_does_not_fit_is_found(tool):
    known = [
        tool.Promise("untried", "safety", "", ""),
        tool.Promise("silent", "safety", "", "", not_on={"micropython": "why", "board": "why"}),
        tool.Promise("too much", "safety", "", "", not_on={"sim": "why", **ELSEWHERE}),
        tool.Promise("lost", "nowhere", "", "", not_on=ELSEWHERE | {"board": "none"}),
    ]
    shown = [tool.Shown("a::test_b", ["silent", "too much", "lost", "no promise"], {"sim": ""})]
    assert tool.complaints(known, {"why": ""}, shown, {"a::test_gone": {}}) == [
        "a::test_b names the promise 'no promise', which is not in hil_tests/promises.toml",
        "no test shows the promise untried",
        "silent is tried on no rp2040, and not_on does not say why",
        "too much is tried on sim, or its test says why not; not_on need not",
        "lost is of the page 'nowhere', which has no promises",
        "lost has the reason 'none', which is none",
        "docs/data/promises.json has figures of a::test_gone, which names no promise",
    ]


@pytest.mark.parametrize(
    ("name", "kept"), [("late, s (at most 1)", 0.9), ("isolated, s (at least 1)", 0.2), ("seen", 0.2)]
)
def test_of_several_figures_the_one_nearest_to_its_limit_is_kept(tool, name, kept):
    assert tool.worst(name, 0.9, 0.2) == kept
