"""Make a release: sdist, wheel, UF2s, a bill of materials and checksums, of one commit. Nothing is uploaded.

python tools/release/make.py                          # into dist/bubbleskin-VERSION, which is replaced
python tools/release/make.py --no-firmware            # without the UF2s, which take minutes the first time
python tools/release/make.py --commit v0.1.0

What is not committed is not in it. The same commit gives the same bytes, whenever and in whichever folder it is made.
"""

import argparse
import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from sbom import bill

ROOT = Path(__file__).resolve().parents[2]
SUMS = "SHA256SUMS"
PACKAGES = ("protocol", "firmware", "host_sdk")
UF2S = """
import shutil, sys
from bubbleskin.toolchain import rp2040
begin, *boards = sys.argv[1:]
for board, uf2 in rp2040.firmware(boards).items():
    shutil.copyfile(uf2, f"{begin}-{board}.uf2")
"""
"""What `bubbleskin firmware build` does, without a look at the heap on an emulated chip."""


def git(*words: str) -> bytes:
    """What git says of this repository; a sentence where it says no."""
    done = subprocess.run(["git", "-C", str(ROOT), *words], capture_output=True, check=False)
    if done.returncode:
        said = done.stderr.decode(errors="replace").strip()
        sys.exit(f"A release is made of a commit, and git says: {said}. Run this in a clone of the repository.")
    return done.stdout


def export(commit: str, folder: Path) -> None:
    """The files of a commit."""
    folder.mkdir()
    archive = git("archive", "--format=tar", commit)
    subprocess.run(["tar", "--extract", "--file=-", f"--directory={folder}"], input=archive, check=True)


def environment(source: Path, epoch: str) -> dict[str, str]:
    """Where everything is imported from `source`, and is dated as the commit."""
    path = os.pathsep.join(str(source / name) for name in PACKAGES)
    return os.environ | {"SOURCE_DATE_EPOCH": epoch, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"}


def run(command: list[str], source: Path, epoch: str) -> None:
    """A step of the release; what it prints is seen only where it fails."""
    done = subprocess.run(
        command, cwd=source, env=environment(source, epoch), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    if done.returncode:
        sys.exit(f"{done.stdout}\nThe release ends here: {' '.join(command)}")


def packages(source: Path, target: Path, epoch: str) -> None:
    """sdist, and the wheel made of it, with the backend that is installed here."""
    run([sys.executable, "-m", "build", "--no-isolation", "--outdir", str(target), str(source)], source, epoch)


def firmware(source: Path, target: Path, epoch: str, version: str) -> None:
    """A UF2 for each board of the package."""
    names = sorted(path.stem for path in (source / "firmware/bubble_firmware/boards").glob("[!_]*.py"))
    run([sys.executable, "-c", UF2S, str(target / f"bubbleskin-{version}"), *names], source, epoch)


def checksums(folder: Path) -> str:
    """Lines as `sha256sum --check` reads them, by name."""
    files = sorted(path for path in folder.iterdir() if path.name != SUMS)
    return "".join(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in files)


def make(commit: str, output: Path, with_firmware: bool) -> Path:
    """The folder of the release, complete or not there."""
    commit = git("rev-parse", "--verify", f"{commit}^{{commit}}").decode().strip()
    epoch = git("log", "-1", "--format=%ct", commit).decode().strip()
    with tempfile.TemporaryDirectory() as scratch:
        source, made = Path(scratch, "source"), Path(scratch, "made")
        made.mkdir()
        export(commit, source)
        version = tomllib.loads((source / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
        packages(source, made, epoch)
        if with_firmware:
            firmware(source, made, epoch, version)
        (made / f"bubbleskin-{version}.cdx.json").write_text(
            bill(source, version, commit, int(epoch)), encoding="utf-8"
        )
        (made / SUMS).write_text(checksums(made), encoding="utf-8")
        release = output / f"bubbleskin-{version}"
        shutil.rmtree(release, ignore_errors=True)
        shutil.copytree(made, release)
    return release


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(description="Make a release of a commit. Nothing is uploaded.")
    parser.add_argument("--commit", default="HEAD", help="what is released (default: HEAD)")
    parser.add_argument("--output", type=Path, default=ROOT / "dist", help="the folder that gets it (default: dist)")
    parser.add_argument("--no-firmware", action="store_true", help="leave the UF2s out")
    asked = parser.parse_args()
    if changed := git("status", "--porcelain", "--untracked-files=no").decode().splitlines():
        print(f"Not committed, so not in the release: {', '.join(line[3:] for line in changed)}", file=sys.stderr)
    release = make(asked.commit, asked.output, not asked.no_firmware)
    print((release / SUMS).read_text(encoding="utf-8"), end="")
    print(release)


if __name__ == "__main__":
    main()
