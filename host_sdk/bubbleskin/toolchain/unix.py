"""The MicroPython that the project is tested against: the unix port, 32-bit like the RP2040.

The source is Debian's package, fetched through an apt root of its own, so nothing of the machine's apt
changes. The interpreter and its mpy-cross are kept in the cache folder; a second call only finds them.
"""

import hashlib
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from bubbleskin.errors import BubbleskinError
from bubbleskin.toolchain.commands import CommandRunner, environment, locked
from bubbleskin.toolchain.debian import DebianRoot, install
from bubbleskin.toolchain.interpreter import BUILD_OPTIONS, VERSION, build_folder, cache_folder, own_micropython

INSTEAD = "Set MICROPYTHON=/path/to/micropython to use your own 32-bit build instead."

PROOF = """
import gc, sys
from array import array

@micropython.viper
def total(values, n: int) -> int:
    p = ptr32(values)
    s = 0
    for i in range(n):
        s += p[i]
    return s

def allocated(bits, one=1):
    before = gc.mem_alloc()
    number = one << bits
    return gc.mem_alloc() - before

small, large = allocated(29), allocated(30)
print(total(array("i", [-5, 3, -7]), 3), small == 0, large > 0, ".".join(map(str, sys.implementation[1][:3])))
"""


def unsupported(system: str, machine: str) -> str | None:
    """Why MicroPython cannot be built 32-bit on such a machine, or None where it can."""
    if system != "Linux":
        return f"the build needs Linux, and this is {system}."
    if machine not in ("x86_64", "AMD64"):
        return f"the 32-bit build needs an x86-64 CPU, and this one is {machine}."
    return None


def check_machine(checkout: Path | None) -> None:
    """Raise `BubbleskinError` where no build can succeed."""
    reason = unsupported(platform.system(), platform.machine())
    if reason:
        raise BubbleskinError(reason)
    if checkout is None and not shutil.which("apt-get"):
        raise BubbleskinError(
            "its source comes as a Debian package, and this machine has no apt-get. "
            "`--micropython DIR` builds a checkout of your own."
        )
    if checkout and not (checkout / "ports/unix/Makefile").is_file():
        raise BubbleskinError(f"{checkout} is not a MicroPython checkout: it has no ports/unix/Makefile.")


def missing_packages(*, from_package: bool) -> list[str]:
    """The Debian packages that the build needs and this machine lacks."""
    missing = [] if shutil.which("make") else ["make"]
    if from_package and not shutil.which("dpkg-source"):
        missing.append("dpkg-dev")
    compiler = ["gcc", "-m32", "-x", "c", "-", "-o", os.devnull]
    program = b'#include <stdio.h>\nint main(void) { return puts("") < 0; }\n'
    if not shutil.which("gcc") or subprocess.run(compiler, input=program, capture_output=True).returncode:
        missing.append("gcc-multilib")
    return missing


def compile_source(source: Path, folder: Path, runner: CommandRunner, tag: str | None) -> list[Path]:
    """Compile mpy-cross and the interpreter from `source`, with everything that is written in `folder`."""
    settings = {"MICROPY_GIT_TAG": tag} if tag else {}
    # A repository around the source is not its version.
    env = environment(GIT_CEILING_DIRECTORIES=str(source.parent), **settings)
    # Newer compilers find new things to warn of in old source.
    make = ["make", f"-j{os.cpu_count() or 1}", f"PYTHON={sys.executable}", "CFLAGS_EXTRA=-Wno-error"]
    cross, unix = folder / "mpy-cross", folder / "unix"
    command = [*make, f"--directory={source}/mpy-cross", f"BUILD={cross}"]
    runner.run("Compiling mpy-cross", command, env=env)
    command = [*make, f"--directory={source}/ports/unix", f"BUILD={unix}", *BUILD_OPTIONS]
    runner.run("Compiling MicroPython", command, env=env)
    return [cross / "mpy-cross", unix / "micropython"]


def prove(interpreter: Path) -> str:
    """Run a few lines in `interpreter`; its version, if it computes like the RP2040."""
    try:
        run = subprocess.run([interpreter, "-c", PROOF], capture_output=True, text=True, timeout=20)
    except (OSError, subprocess.TimeoutExpired) as problem:
        raise BubbleskinError(f"{interpreter} does not run: {problem}.") from problem
    answer = run.stdout.split()
    if run.returncode or len(answer) != 4:
        last = (run.stderr.strip() or run.stdout.strip() or "no output").splitlines()[-1]
        raise BubbleskinError(f"{interpreter} is not a MicroPython with viper. It said: {last}")
    *sums, version = answer
    if sums != ["-9", "True", "True"]:
        raise BubbleskinError(
            f"{interpreter} is MicroPython {version}, but not a 32-bit build: its small integers and viper's "
            "ptr32 differ from the RP2040's. Build it with MICROPY_FORCE_32BIT=1, or unset MICROPYTHON: "
            "then one is built where it is needed first."
        )
    return version


def keep(programs: list[Path], folder: Path) -> None:
    """Prove the interpreter, the last of `programs`, and put all of them in `folder`, it last.

    Each is moved into place whole, so that whoever finds the interpreter finds everything.
    """
    folder.mkdir(parents=True, exist_ok=True)
    staged = [Path(shutil.copy2(program, folder / f".{program.name}.new")) for program in programs]
    try:
        prove(staged[-1])
        for program, new in zip(programs, staged, strict=True):
            new.replace(folder / program.name)
    finally:
        for new in staged:
            new.unlink(missing_ok=True)


def build(folder: Path, checkout: Path | None, *, force: bool) -> None:
    """Build into `folder` from one's own `checkout`, else the package source, unless it is built by now.

    Raises `BubbleskinError` where that cannot be done.
    """
    try:
        check_machine(checkout)
        home = folder.parent
        runner = CommandRunner(home / "logs")
        asked = time.time()
        with locked(home / "lock", runner):
            interpreter = folder / "micropython"
            if interpreter.is_file() and (not force or interpreter.stat().st_ctime > asked):
                return  # another call built it while we waited
            install(missing_packages(from_package=checkout is None), runner)
            with tempfile.TemporaryDirectory(prefix="micropython-") as name:
                source = checkout or DebianRoot(Path(name), runner).micropython()
                tag = None if checkout else f"v{VERSION}"  # a checkout describes itself
                keep(compile_source(source, Path(name) / "build", runner, tag), folder)
    except (BubbleskinError, OSError) as problem:
        said = str(problem)
        after = "\n" if "\n" in said else " "  # the end of a log keeps its lines
        raise BubbleskinError(f"MicroPython cannot be built here: {said}{after}{INSTEAD}") from problem


def micropython(checkout: Path | None = None, *, force: bool = False) -> Path:
    """The interpreter to test with: the one `MICROPYTHON` names, else the built one, built now if need be.

    With `checkout` or `force` it is built in any case. An own checkout's build lies beside the package's and
    is never found by itself: it is used where `MICROPYTHON` names it.
    """
    if checkout:
        checkout = checkout.expanduser().resolve()
        folder = cache_folder() / "micropython" / ("own-" + hashlib.sha256(bytes(checkout)).hexdigest()[:12])
        build(folder, checkout, force=True)
        return folder / "micropython"
    own = own_micropython()
    if own and not force:
        prove(own)
        return own
    built = build_folder() / "micropython"
    if force or not built.is_file():
        build(built.parent, None, force=force)
    return built
