"""A board of one's own: the example of docs/boards.md, as somebody would have it outside the package."""

import shutil
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[2] / "docs" / "data" / "pad8.py"


@pytest.fixture
def pad8(tmp_path) -> Path:
    """Its file in a folder of its own."""
    return Path(shutil.copy(EXAMPLE, tmp_path / "pad8.py"))
