"""Write `build.lock` and `requirements.lock`: versions and hashes of everything that `make setup` installs, by uv.

python tools/generate/lock.py            # write them; asks the package index
python tools/generate/lock.py --check    # fail if they do not belong to pyproject.toml and constraints.txt; asks nobody

Each is for every Python from 3.11 on and every system: markers say what is for some of them only.
"""

import argparse
import hashlib
import json
import re
import subprocess
import sys
import tomllib

from generated import ROOT

CONSTRAINTS = "constraints.txt"
LOCKS = {"build.lock": ["--group", "build"], "requirements.lock": ["pyproject.toml", "--group", "dev"]}
HEAD = (
    "# Made by tools/generate/lock.py of pyproject.toml and constraints.txt, whose requirements have the SHA-256 {}.\n"
)


def name_of(pin: str) -> str:
    """The name in a line such as `Pygments==2.21.0`, as package indexes compare it."""
    return re.sub(r"[-_.]+", "-", re.split(r"[=;\s]", pin, maxsplit=1)[0]).lower()


def pins() -> list[str]:
    """The lines of the constraints."""
    return (ROOT / CONSTRAINTS).read_text(encoding="utf-8").split()


def digest() -> str:
    """Of all that decides what is locked."""
    data = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    project = data["project"]
    decides = [project["requires-python"], project["dependencies"], data["dependency-groups"], pins()]
    return hashlib.sha256(json.dumps(decides).encode()).hexdigest()


def compiled(sources: list[str]) -> str:
    """What uv finds: every package with its version and the hashes of its files."""
    command = [sys.executable, "-m", "uv", "pip", "compile", "--quiet", "--no-header", "--no-annotate", "--universal"]
    command += ["--python-version", "3.11", "--generate-hashes", "--constraint", CONSTRAINTS, *sources]
    return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout


def problems() -> list[str]:
    """What is wrong with the locks that are there."""
    found = []
    locked: dict[str, str] = {}
    for lock in LOCKS:
        path = ROOT / lock
        text = path.read_text(encoding="utf-8") if path.exists() else ""
        if not text.startswith(HEAD.format(digest())):
            found.append(f"{lock} is not of today's requirements")
        for entry in re.split(r"\n(?=\S)", text):
            if entry and not entry.startswith("#"):
                locked[name_of(entry)] = entry
                if "--hash=sha256:" not in entry:
                    found.append(f"{lock} has no hash of {name_of(entry)}")
    for pin in pins():
        if not locked.get(name_of(pin), "").lower().startswith(f"{name_of(pin)}=={pin.partition('==')[2]}"):
            found.append(f"{pin} of {CONSTRAINTS} is not what is locked")
    return found


def main() -> int:
    """See the module."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--check", action="store_true", help="write nothing, ask nobody; fail if a lock is out of date")
    if not parser.parse_args().check:
        for lock, sources in LOCKS.items():
            (ROOT / lock).write_text(HEAD.format(digest()) + compiled(sources), encoding="utf-8")
            print(f"wrote {lock}")
    found = problems()
    for problem in found:
        print(f"{problem}: run python tools/generate/lock.py and commit what it writes")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
