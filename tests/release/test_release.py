"""A release: the same bytes from the same commit, what is in it, and that its wheel runs where nothing is."""

import hashlib
import json
import os
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MAKE, TRIAL = ROOT / "tools/release/make.py", ROOT / "tools/release/trial.py"
FOLDERS = ("bubble_firmware", "bubble_protocol", "bubbleskin")


def make(output: Path, *words: str, firmware=False, **settings: str) -> subprocess.CompletedProcess:
    """Make one; the UF2s take minutes where nothing is kept."""
    command = [sys.executable, str(MAKE), "--output", str(output), *([] if firmware else ["--no-firmware"]), *words]
    environment = os.environ | settings
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=300)


@pytest.fixture(scope="module")
def release(tmp_path_factory):
    output = tmp_path_factory.mktemp("release")
    done = make(output)
    assert done.returncode == 0, done.stdout + done.stderr
    (folder,) = output.iterdir()
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.medium
def test_the_same_commit_gives_the_same_bytes(release, tmp_path):
    old = os.umask(0o077)
    try:
        again = make(tmp_path / "elsewhere", TZ="Asia/Tokyo", SOURCE_DATE_EPOCH="1", PYTHONHASHSEED="7", LC_ALL="C")
    finally:
        os.umask(old)
    assert again.returncode == 0, again.stdout + again.stderr
    (folder,) = (tmp_path / "elsewhere").iterdir()
    assert contents(folder) == contents(release)


@pytest.mark.medium
def test_checksums_are_of_all_files(release):
    sums = dict(reversed(line.split("  ")) for line in (release / "SHA256SUMS").read_text().splitlines())
    files = {name: data for name, data in contents(release).items() if name != "SHA256SUMS"}
    assert sums == {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}
    assert subprocess.run(["sha256sum", "--check", "--strict", "SHA256SUMS"], cwd=release, check=False).returncode == 0


@pytest.mark.medium
def test_what_is_in_it(release):
    wheel, source = next(release.glob("*-py3-none-any.whl")), next(release.glob("*.tar.gz"))
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.split("/")[0] for name in names if ".dist-info" not in name} == set(FOLDERS)
    for name in ("bubbleskin/hil/conftest.py", "bubbleskin/toolchain/manifest.py", "bubbleskin/py.typed"):
        assert name in names
    assert not any(name.endswith((".so", ".pyc", ".o")) for name in names)
    with tarfile.open(source) as archive:
        inside = {name.partition("/")[2] for name in archive.getnames()}
    wanted = set(
        subprocess.check_output(["git", "-C", str(ROOT), "ls-tree", "-r", "--name-only", "HEAD"], text=True).split()
    )
    assert wanted <= inside


@pytest.mark.medium
def test_the_bill_is_valid_and_whole(release):
    from cyclonedx.schema import SchemaVersion
    from cyclonedx.validation.json import JsonStrictValidator

    text = next(release.glob("*.cdx.json")).read_text(encoding="utf-8")
    assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(text) is None
    bom = json.loads(text)
    named = {part["name"]: part for part in bom["components"]}
    assert {"numpy", "scipy", "pyserial", "crcmod", "numba", "click", "micropython", "pico-sdk-source"} <= set(named)
    assert "pytest" not in named
    assert all(part.get("licenses") for part in bom["components"]), [
        n for n, p in named.items() if not p.get("licenses")
    ]
    hashed = {part["hashes"][0]["content"] for part in bom["components"] if "hashes" in part}
    from bubbleskin.toolchain.checksums import SHA256

    assert hashed == set(SHA256.values())
    refs = {part["bom-ref"] for part in bom["components"]} | {bom["metadata"]["component"]["bom-ref"]}
    assert {one["ref"] for one in bom["dependencies"]} == refs
    assert {other for one in bom["dependencies"] for other in one.get("dependsOn", ())} < refs


def test_a_commit_that_is_none_is_said(tmp_path):
    done = make(tmp_path, "--commit", "no-such-tag")
    assert done.returncode == 1
    assert "A release is made of a commit" in done.stderr
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_wheel_that_is_none_is_said(tmp_path):
    command = [sys.executable, str(TRIAL), str(tmp_path / "no.whl")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == f"There is no {tmp_path / 'no.whl'}; make release makes one.\n"


@pytest.mark.slow
def test_the_wheel_runs_in_an_empty_environment_without_a_compiler(release, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(TRIAL.parent))
    from trial import trial

    tried = trial(next(release.glob("*.whl")), sys.executable, tmp_path)
    assert not tried.compiled, "crcmod was to be installed without a compiler"
    assert tried.crc == 0xCBF43926, "the CRC-32 of 123456789"
    assert "dome" in tried.said
    # A test of one's own, as docs/hil_test.md has it, finds the suite's fixtures in the wheel.
    found = (
        tmp_path / "venv/bin/python",
        "-c",
        "import importlib.util as u; print(u.find_spec('bubbleskin.hil.conftest'))",
    )
    assert (
        "conftest.py" in subprocess.run(found, capture_output=True, text=True, check=True, cwd=tmp_path, env={}).stdout
    )


@pytest.mark.chip
def test_the_firmware_of_every_board_is_in_it(tmp_path):
    from bubbleskin.boards import NAMES
    from bubbleskin.flash.uf2 import read

    done = make(tmp_path, firmware=True)
    assert done.returncode == 0, done.stdout + done.stderr
    (folder,) = tmp_path.iterdir()
    sums = (folder / "SHA256SUMS").read_text()
    images = [next(folder.glob(f"*-{name}.uf2")) for name in NAMES]
    assert all(image.name in sums for image in images)
    assert len({read(image).data for image in images}) == len(NAMES)
