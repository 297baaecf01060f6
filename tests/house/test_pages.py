"""Pages name what is there: every path in them exists, every link leads somewhere."""

import re
from pathlib import Path

ROOTS = (
    "",
    "protocol",
    "firmware",
    "host_sdk",
    "protocol/bubble_protocol",
    "firmware/bubble_firmware",
    "host_sdk/bubbleskin",
)
FOLDERS = ("protocol", "firmware", "host_sdk", "tools", "tests", "docs")
PATH = re.compile(r"`((?:\.?[\w*-]+/)+[\w.*-]*|[\w/-]+\.(?:py|md|toml|json|txt))`")
LINK = re.compile(r"\]\(([^)#:]+)(?:#[^)]*)?\)")


def exists(name: str, root: Path) -> bool:
    """Whether a path is in the repository or in a package; a name without a folder may be in any room of these."""
    folders = ROOTS if "/" in name else (*ROOTS, *(f"{folder}/**" for folder in FOLDERS))
    return any(next(iter(root.glob(f"{folder}/{name}".strip("/"))), None) for folder in folders)


def missing(pages: dict[str, str], root: Path) -> list[str]:
    """Paths in backquotes that are nowhere, and links without a file. NAME stands for whatever a reader chooses."""
    said = []
    for page, text in pages.items():
        said += [f"{page}: {name}" for name in PATH.findall(text) if "NAME" not in name and not exists(name, root)]
        for name in LINK.findall(re.sub(r"```.*?```", "", text, flags=re.DOTALL)):
            if not ((root / page).parent / name).exists():
                said.append(f"{page}: {name}")
    return said


def test_every_path_of_the_pages_exists(pages, root, judge):
    judge("pages", {line: line for line in missing(pages, root)})


def test_every_room_is_in_the_architecture(pages, root):
    """A room that the page does not name would be found by nobody."""
    text = pages["docs/architecture.md"]
    for package in ("firmware/bubble_firmware", "host_sdk/bubbleskin", "tools"):
        rooms = {path.name for path in (root / package).iterdir() if path.is_dir() and list(path.glob("*.py"))}
        assert {room for room in rooms if f"{room}/" not in text} == set()


def test_every_decision_is_in_the_list(pages):
    listed = set(LINK.findall(pages["docs/decisions/README.md"]))
    assert listed == {Path(page).name for page in pages if page.startswith("docs/decisions/0")}


def test_a_path_that_is_not_there_is_found(root):
    text = "See `link/nowhere.py`, `link/clock.py`, `bubble_firmware/boards/` and [this](control.md), [that](gone.md)."
    assert missing({"docs/planted.md": text}, root) == ["docs/planted.md: link/nowhere.py", "docs/planted.md: gone.md"]


def unknown_names(glossary: str, code: str) -> list[str]:
    """Names in the second column of the glossary that no code has."""
    cells = [line.split("|")[2] for line in glossary.splitlines() if line.startswith("|") and line.count("|") == 5]
    names = {name for cell in cells for name in re.findall(r"`([\w.]+)`", cell)}
    return sorted(name for name in names if not re.search(rf"\b_?{name.rpartition('.')[2]}\b", code))


def test_the_glossarys_names_are_names(pages, product, judge):
    found = unknown_names(pages["docs/glossary.md"], "\n".join(product.values()))
    judge("glossary", {name: f"{name} is in docs/glossary.md and in no code" for name in found})


def test_a_name_that_is_no_name_is_found():
    text = "| term | name | unit | what |\n|---|---|---|---|\n| air | A; `AIR`, `WIND` | µJ | `NOT_LOOKED_AT` |\n"
    assert unknown_names(text, "_AIR = const(10)\n") == ["WIND"]
