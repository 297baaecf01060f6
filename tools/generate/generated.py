"""What all generators share: write the files, or with --check compare and fail."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def main(files: dict[Path, Callable[[], str]], pictures: dict[Path, Callable[[Path], None]] | None = None) -> None:
    """Write `files`, and draw `pictures`, by what writes each to a path; pictures differ by library, so they are not compared."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--check", action="store_true", help="write nothing; fail if a file is out of date")
    check = parser.parse_args().check
    for name, draw in ({} if check else pictures or {}).items():
        draw(ROOT / name)
        print(f"drew {name}")
    stale = []
    for name, make in files.items():
        path, text = ROOT / name, make()
        if check:
            if not path.exists() or path.read_text(encoding="utf-8") != text:
                stale.append(name)
        else:
            path.write_text(text, encoding="utf-8")
            print(f"wrote {name}")
    for name in stale:
        print(
            f"{name} is out of date: run python {Path(sys.argv[0]).name} in tools/generate/ and commit what it writes"
        )
    sys.exit(bool(stale))
