"""The parts of the MicroPython build that need neither network nor compiler."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from bubbleskin.errors import BubbleskinError
from bubbleskin.toolchain import commands, debian, interpreter, unix

TOOL = Path(__file__).parents[2] / "tools" / "build_micropython.py"

DEB822 = """\
# the archive
Types: deb
URIs: http://mirror.example/debian
Suites: bookworm bookworm-updates
Components: main contrib
Architectures: amd64
Signed-By: /usr/share/keyrings/archive.gpg

Types: deb
URIs: http://mirror.example/debian-security
Suites: bookworm-security
Components: main
Signed-By: /usr/share/keyrings/archive.gpg

Types: deb
URIs: http://vendor.example/apt
Suites: bookworm
Components: stable

Enabled: no
Types: deb
URIs: http://off.example/debian
Suites: bookworm
Components: main
"""

ONE_LINE = """\
# deb http://commented.example/debian bookworm main
deb cdrom:[Debian]/ bookworm main
deb [arch=amd64 signed-by=/usr/share/keyrings/archive.gpg] http://mirror.example/debian bookworm main contrib
deb-src [signed-by=/usr/share/keyrings/archive.gpg] http://mirror.example/debian bookworm main # and source
deb http://mirror.example/debian bookworm-updates main
deb http://flat.example/ ./
"""

TRIXIE = """\
Types: deb deb-src
Suites: trixie
Components: main
Uris: http://mirror.example/debian
Signed-By: /usr/share/keyrings/archive.gpg
"""


def program(path: Path, answer: str) -> Path:
    """An executable that says `answer` whatever it is asked."""
    path.write_text(f"#!/bin/sh\necho '{answer}'\n")
    path.chmod(0o755)
    return path


@pytest.mark.parametrize("stanzas", [debian.read_deb822(DEB822), debian.read_one_line(ONE_LINE)])
def test_only_the_debian_archive_is_turned_to_the_other_suite(stanzas):
    assert debian.turn_to_suite(stanzas, "trixie") == TRIXIE


def test_a_key_written_into_the_sources_file_is_kept():
    text = DEB822.replace("/usr/share/keyrings/archive.gpg", "\n -----BEGIN\n .\n mQIN\n -----END", 1)
    assert "Signed-By: \n -----BEGIN\n .\n mQIN\n -----END\n" in debian.turn_to_suite(
        debian.read_deb822(text), "trixie"
    )


def test_a_source_without_a_key_gets_debians_own(monkeypatch, tmp_path):
    keyring = tmp_path / "debian.gpg"
    keyring.touch()
    monkeypatch.setattr(debian, "KEYRING", keyring)
    stanzas = debian.read_one_line("deb http://mirror.example/debian bullseye main")
    assert f"Signed-By: {keyring}\n" in debian.turn_to_suite(stanzas, "trixie")


def test_the_key_of_a_build_names_version_and_word_size_and_follows_the_options(monkeypatch):
    before = interpreter.build_key()
    assert before.startswith("1.25.0-32bit-")
    monkeypatch.setattr(interpreter, "BUILD_OPTIONS", (*interpreter.BUILD_OPTIONS, "MICROPY_PY_THREAD=0"))
    assert interpreter.build_key() != before


def test_what_micropython_names_comes_before_what_was_built(monkeypatch, tmp_path):
    monkeypatch.setenv("BUBBLESKIN_CACHE", str(tmp_path))
    monkeypatch.delenv("MICROPYTHON", raising=False)
    with pytest.raises(BubbleskinError, match=r"The first `micropython://` does that.* or set MICROPYTHON"):
        interpreter.find_micropython()
    interpreter.build_folder().mkdir(parents=True)
    built = program(interpreter.build_folder() / "micropython", "built")
    assert interpreter.find_micropython() == built
    own = program(tmp_path / "own", "own")
    monkeypatch.setenv("MICROPYTHON", str(own))
    assert interpreter.find_micropython() == own


def test_a_wrong_micropython_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv("MICROPYTHON", str(tmp_path / "nowhere"))
    with pytest.raises(BubbleskinError, match="nowhere, which is not a file"):
        interpreter.find_micropython()
    (tmp_path / "plain").touch()
    monkeypatch.setenv("MICROPYTHON", str(tmp_path / "plain"))
    with pytest.raises(BubbleskinError, match="plain, which is not executable"):
        interpreter.find_micropython()


def test_an_interpreter_that_differs_from_the_rp2040_is_refused(tmp_path):
    assert unix.prove(program(tmp_path / "right", "-9 True True 1.25.0")) == "1.25.0"
    with pytest.raises(BubbleskinError, match=r"is MicroPython 1\.25\.0, but not a 32-bit build"):
        unix.prove(program(tmp_path / "wide", "8589934583 True False 1.25.0"))
    with pytest.raises(BubbleskinError, match="is not a MicroPython with viper"):
        unix.prove(Path(sys.executable))


def test_the_interpreter_of_this_machine_is_like_the_rp2040():
    try:
        path = interpreter.find_micropython()
    except BubbleskinError as problem:
        if os.environ.get("CI"):
            raise
        pytest.skip(str(problem))
    assert unix.prove(path)


def test_machines_that_cannot_build_are_told_why():
    assert unix.unsupported("Linux", "x86_64") is None
    assert "this is Darwin" in unix.unsupported("Darwin", "arm64")
    assert "this one is aarch64" in unix.unsupported("Linux", "aarch64")


def test_a_checkout_without_micropython_is_refused_before_anything_is_fetched(monkeypatch, tmp_path):
    monkeypatch.setenv("BUBBLESKIN_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(unix, "unsupported", lambda system, machine: None)
    with pytest.raises(BubbleskinError, match=r"not a MicroPython checkout.* MICROPYTHON="):
        unix.micropython(tmp_path)
    assert not (tmp_path / "cache").exists()


def test_the_tool_says_one_sentence_and_fails(tmp_path):
    environment = {**os.environ, "MICROPYTHON": str(tmp_path / "nowhere")}
    run = subprocess.run([sys.executable, TOOL, "--print"], env=environment, capture_output=True, text=True)
    assert run.returncode == 1
    assert run.stdout == ""
    assert len(run.stderr.splitlines()) == 1
    assert "nowhere" in run.stderr


def test_a_failed_step_shows_the_end_of_its_log(tmp_path):
    run = commands.CommandRunner(tmp_path).run
    script = "for line in range(30): print('line', line)\nraise SystemExit(3)"
    with pytest.raises(BubbleskinError) as failure:
        run("Counting", [sys.executable, "-c", script])
    text = str(failure.value)
    assert "line 29" in text
    assert "line 10" in text
    assert "line 9\n" not in text
    assert str(tmp_path / "counting.log") in text


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """What `pip install bubbleskin` puts on a machine without a checkout: a folder that holds the wheel's files."""
    folder = tmp_path_factory.mktemp("wheel")
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    source = Path(__file__).parents[2]
    subprocess.run([*pip, "wheel", "--no-deps", "--no-build-isolation", "-w", folder, source], check=True, timeout=200)
    (made,) = folder.glob("*.whl")
    subprocess.run([*pip, "install", "--no-deps", "--target", folder / "installed", made], check=True, timeout=200)
    return folder / "installed"


def shows_from_wheel(wheel, cache, path):
    """`bubbleskin show` on MicroPython out of a wheel: the process, once it has ended."""
    environment = {name: value for name, value in os.environ.items() if name != "MICROPYTHON"}
    environment |= {"PYTHONPATH": str(wheel), "BUBBLESKIN_CACHE": str(cache), "PATH": path}
    command = [
        sys.executable,
        "-m",
        "bubbleskin",
        "show",
        "--all",
        "8",
        "--device",
        "micropython://wristband7?contact=0",
    ]
    return subprocess.run(command, env=environment, cwd=wheel, capture_output=True, text=True, timeout=500)


@pytest.mark.slow
def test_a_wheel_runs_the_micropython_that_was_built_before(wheel):
    done = shows_from_wheel(wheel, interpreter.cache_folder(), os.environ["PATH"])
    assert done.returncode == 0, done.stderr
    assert "settled at" in done.stdout


@pytest.mark.slow
def test_a_wheel_has_the_suite_of_every_target(wheel):
    command = [sys.executable, "-m", "bubbleskin", "hil", "--list", "--only", "silent"]
    environment = {**os.environ, "PYTHONPATH": str(wheel)}
    done = subprocess.run(command, env=environment, cwd=wheel, capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "test_a_shape_is_vented_when_the_host_stays_silent" in done.stdout


@pytest.mark.slow
def test_a_wheel_that_cannot_build_micropython_says_what_to_do(wheel, tmp_path):
    done = shows_from_wheel(wheel, tmp_path, "/nowhere")
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("MicroPython cannot be built here: ")
    assert "Set MICROPYTHON=/path/to/micropython to use your own 32-bit build instead." in done.stderr


@pytest.mark.chip
def test_a_wheel_builds_micropython_where_there_is_none(wheel, tmp_path):
    done = shows_from_wheel(wheel, tmp_path, os.environ["PATH"])
    assert done.returncode == 0, done.stderr
    assert "Compiling MicroPython: done" in done.stderr
    assert "settled at" in done.stdout
    again = shows_from_wheel(wheel, tmp_path, "/nowhere")
    assert (again.returncode, again.stderr) == (0, "")
