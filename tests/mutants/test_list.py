"""The lists of planted mistakes stay ones of the sources that are there."""

import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
HERE = ROOT / "tests" / "mutants"
MUTANTS = tomllib.loads((HERE / "mutants.toml").read_text(encoding="utf-8"))["mutant"]
SURVIVORS = tomllib.loads((HERE / "survivors.toml").read_text(encoding="utf-8"))["survivor"]


@pytest.mark.parametrize("mutant", MUTANTS, ids=[mutant["name"] for mutant in MUTANTS])
def test_what_a_mutant_replaces_stands_in_one_place(mutant):
    assert (ROOT / mutant["file"]).read_text(encoding="utf-8").count(mutant["old"]) == 1
    assert mutant["old"] != mutant["new"]


def test_names_are_different():
    assert len({mutant["name"] for mutant in MUTANTS}) == len(MUTANTS)


@pytest.mark.parametrize(
    "mutant", [mutant for mutant in MUTANTS if "tests" in mutant], ids=lambda mutant: mutant["name"]
)
def test_the_tests_that_a_mutant_names_are_there(mutant):
    for test in mutant["tests"]:
        path, _, name = test.partition("::")
        assert f"def {name}(" in (ROOT / path).read_text(encoding="utf-8")


@pytest.mark.parametrize("survivor", SURVIVORS, ids=[f"{entry['line']} {entry['now']}" for entry in SURVIVORS])
def test_what_survives_is_still_there_and_has_a_reason(survivor):
    lines = [line.strip() for line in (ROOT / survivor["file"]).read_text(encoding="utf-8").splitlines()]
    assert survivor["line"] in lines
    assert survivor["why"]
