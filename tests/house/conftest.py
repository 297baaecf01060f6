"""What the house's rules look at: the sources as text, and what is allowed by name."""

import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PRODUCT = ("protocol/bubble_protocol", "firmware/bubble_firmware", "host_sdk/bubbleskin")
PYTHON = (*PRODUCT, "tools", "tests", "hil_tests")


def sources(*folders: str) -> dict[str, str]:
    """The text of every Python file in folders of the repository, by its path from the root."""
    return {
        str(path.relative_to(ROOT)): path.read_text(encoding="utf-8")
        for folder in folders
        for path in sorted((ROOT / folder).rglob("*.py"))
    }


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT


@pytest.fixture(scope="session")
def product() -> dict[str, str]:
    """What is shipped: protocol, firmware, SDK."""
    return sources(*PRODUCT)


@pytest.fixture(scope="session")
def python() -> dict[str, str]:
    """Every Python file of the repository."""
    return sources(*PYTHON)


@pytest.fixture(scope="session")
def pages() -> dict[str, str]:
    """The pages that people read, by their path from the root."""
    paths = [
        ROOT / "README.md",
        ROOT / "CHANGELOG.md",
        *ROOT.glob("CONTRIBUTING.md"),
        *sorted((ROOT / "docs").rglob("*.md")),
    ]
    return {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in paths}


@pytest.fixture(scope="session")
def allowed() -> dict[str, dict]:
    """The exceptions of every rule by name, each with its reason; `open` has what is still to be mended."""
    return tomllib.loads((ROOT / "tests/house/allowed.toml").read_text(encoding="utf-8"))


@pytest.fixture(scope="session")
def judge(allowed):
    """`judge(rule, found)`: fails where something found is not allowed, or something allowed is not found any more."""

    def judge(rule: str, found: dict[str, str]) -> None:
        listed, still_open = allowed.get(rule, {}), allowed.get("open", {}).get(rule, {})
        assert [line for name, line in found.items() if name not in listed and name not in still_open] == []
        assert set(listed) - set(found) == set(), f"listed under {rule} in tests/house/allowed.toml, and not there"

    return judge
