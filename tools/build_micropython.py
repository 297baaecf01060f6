"""Build the real MicroPython that the project is tested against: the unix port, 32-bit like the RP2040.

The source is Debian's package, fetched through an apt root of its own, so nothing of the machine's apt
changes. The interpreter and its mpy-cross are kept in the cache folder; a second call only finds them.
"""

import argparse
import fcntl
import hashlib
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from bubbleskin.errors import BubbleskinError
from bubbleskin.interpreter import BUILD_OPTIONS, VERSION, build_folder, cache_folder, own_micropython

SUITE = "trixie"
"""The Debian release whose source package is `VERSION`."""
RELEASED = "1744675200"
"""`SOURCE_DATE_EPOCH` of the build: the day 1.25.0 came out, so that two builds are the same."""
KEYRING = Path("/usr/share/keyrings/debian-archive-keyring.gpg")
INSTEAD = "Set MICROPYTHON=/path/to/micropython to use your own 32-bit build instead."

# Taken over from the machine's own sources; the other fields are of no use to source packages.
COPIED_FIELDS = ("Uris", "Signed-By", "Trusted", "Check-Valid-Until")

# These must not reach into the build: a `make` around us hands its own flags down, a shell compiler flags.
KEPT_OUT = [
    "MAKEFLAGS",
    "MFLAGS",
    "MAKELEVEL",
    "CFLAGS",
    "CPPFLAGS",
    "LDFLAGS",
    "CROSS_COMPILE",
    "BUILD",
    "VARIANT",
]

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


# ---- the machine's apt sources, turned to another suite


def read_deb822(text: str) -> list[dict[str, str]]:
    """The stanzas of a `.sources` file, field names in title case, continuation lines kept."""
    stanzas: list[dict[str, str]] = []
    fields: dict[str, str] = {}
    name = ""
    for line in [*text.splitlines(), ""]:
        if line.startswith("#"):
            continue
        if not line.strip():
            if fields:
                stanzas.append(fields)
            fields = {}
        elif line[0] in " \t":
            fields[name] += "\n" + line
        else:
            name, _, value = line.partition(":")
            name = name.strip().title()
            fields[name] = value.strip()
    return stanzas


def read_one_line(text: str) -> list[dict[str, str]]:
    """The entries of a `.list` file as stanzas with the same field names as `read_deb822`."""
    stanzas = []
    for line in text.splitlines():
        entry = re.match(r"\s*deb(?:-src)?\s+(?:\[([^]]*)]\s*)?(\S+)\s+(\S+)([^#]*)", line)
        if not entry:
            continue
        options, uri, suite, components = entry.groups()
        fields = {"Uris": uri, "Suites": suite, "Components": components.strip()}
        for option in (options or "").split():
            name, _, value = option.partition("=")
            fields[name.title()] = value.replace(",", " ")
        stanzas.append(fields)
    return stanzas


def turn_to_suite(stanzas: list[dict[str, str]], suite: str) -> str:
    """The Debian archives among `stanzas` as a `.sources` file for the source packages of `suite`.

    An archive counts by its look (a plain suite, a component `main`): add-ons such as bookworm-security have
    a dash in the suite, and an outsider that slips through has no such suite and is skipped by apt.
    """
    turned: dict[str, None] = {}  # a set that keeps the order
    for fields in stanzas:
        plain = [name for name in fields.get("Suites", "").split() if not re.search("[-/]", name)]
        if not plain or "main" not in fields.get("Components", "").split():
            continue
        if fields.get("Enabled", "yes").lower() in ("no", "false", "0") or fields["Uris"].startswith("cdrom"):
            continue
        copied = {name: fields[name] for name in COPIED_FIELDS if name in fields}
        if "Signed-By" not in copied and KEYRING.is_file():
            copied["Signed-By"] = str(KEYRING)
        wanted = {"Types": "deb-src", "Suites": suite, "Components": "main", **copied}
        turned["".join(f"{name}: {value}\n" for name, value in wanted.items())] = None
    return "\n".join(turned)


def machine_sources() -> list[dict[str, str]]:
    """Every source the machine's own apt is configured with."""
    apt = Path("/etc/apt")
    lists = [apt / "sources.list", *sorted(apt.glob("sources.list.d/*.list"))]
    stanzas = [fields for path in lists if path.is_file() for fields in read_one_line(path.read_text())]
    for path in sorted(apt.glob("sources.list.d/*.sources")):
        stanzas += read_deb822(path.read_text())
    return stanzas


# ---- steps with a status line and a log


class Steps:
    """Runs the steps of a build, each with a status line and a log of its own in the folder `logs`."""

    def __init__(self, logs: Path) -> None:
        from rich.console import Console  # only a build needs it, and it is most of a cached call's time

        self.console = Console(stderr=True)
        self.logs = logs
        logs.mkdir(parents=True, exist_ok=True)

    def try_run(
        self,
        title: str,
        command: Sequence[str | Path],
        *,
        folder: Path | None = None,
        env: dict[str, str] | None = None,
    ) -> Path | None:
        """Run `command`; the path of its log if it failed, else None."""
        log = self.logs / (re.sub(r"\W+", "-", title.lower()) + ".log")
        started = time.monotonic()
        with self.console.status(f"{title} …"), log.open("wb") as out:
            status = subprocess.run(
                command, cwd=folder, env=env, stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT
            ).returncode
        seconds = time.monotonic() - started
        self.console.print(f"{title}: {'failed' if status else 'done'}, {seconds:.1f} s", highlight=False)
        return log if status else None

    def run(self, title: str, command: Sequence[str | Path], *, env: dict[str, str] | None = None) -> None:
        """Run `command`; if it fails, raise `BubbleskinError` with the end of its log."""
        log = self.try_run(title, command, env=env)
        if log:
            raise BubbleskinError(f"the step “{title}” failed.\n{end_of(log)}")


def end_of(log: Path) -> str:
    """The last 20 lines of a log, and where the rest is."""
    lines = log.read_text(errors="replace").splitlines()[-20:]
    return "\n".join(f"    {line}" for line in lines) + f"\nThe whole log: {log}\n"


# ---- what the machine must have


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


def install(packages: list[str], steps: Steps) -> None:
    """Install Debian packages if we may; else say how."""
    if not packages:
        return
    names = " ".join(packages)
    if not shutil.which("apt-get"):
        raise BubbleskinError(f"this machine lacks what Debian calls {names}. Install it by your own means.")
    if os.geteuid() != 0:
        raise BubbleskinError(f"packages are missing. Run `sudo apt-get install -y {names}`, then try again.")
    quiet = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    options = ["-y", "--no-install-recommends", "-oDPkg::Lock::Timeout=120"]
    command = ["apt-get", "install", *options, *packages]
    # A bare machine has no package lists, and old ones may name files that are gone.
    if steps.try_run(f"Installing {names}", command, env=quiet):
        steps.try_run("Updating apt's lists", ["apt-get", "update"], env=quiet)
        steps.run(f"Installing {names}", command, env=quiet)


# ---- source, build, proof


def fetch_source(folder: Path, steps: Steps) -> Path:
    """Debian's MicroPython source, unpacked inside `folder`."""
    sources = turn_to_suite(machine_sources(), SUITE)
    if not sources:
        raise BubbleskinError("the machine's apt configuration names no Debian archive.")
    for name in ("lists/partial", "cache/archives/partial", "sources"):
        (folder / name).mkdir(parents=True)
    (folder / "sources" / "debian.sources").write_text(sources)
    settings = {
        "Dir::State::lists": folder / "lists",
        "Dir::Cache": folder / "cache",
        "Dir::Etc::sourcelist": os.devnull,
        "Dir::Etc::sourceparts": folder / "sources",
        "APT::Default-Release": "",  # the machine may prefer a release that is not among these sources
        "APT::Sandbox::User": "root",  # the folder is ours alone; apt's own user could not enter it
    }
    apt = ["apt-get", *(f"-o{name}={value}" for name, value in settings.items())]
    # One of several archives may lack the suite; what counts is whether the source then comes.
    update = steps.try_run("Reading the source lists", [*apt, "update"])
    download = [*apt, "source", "--download-only", "micropython"]
    log = steps.try_run("Fetching the source", download, folder=folder)
    if log:
        raise BubbleskinError(f"apt could not fetch its source package.\n{end_of(update or log)}")
    offered = list(folder.glob("micropython_*.dsc"))
    wanted = [path for path in offered if path.name.startswith(f"micropython_{VERSION}")]
    if not wanted:
        names = ", ".join(path.stem for path in offered)
        raise BubbleskinError(f"the tests want version {VERSION}, and apt offers {names}.")
    steps.run("Unpacking the source", ["dpkg-source", "-x", str(wanted[0]), str(folder / "source")])
    return folder / "source"


def compile_source(source: Path, folder: Path, steps: Steps, tag: str | None) -> list[Path]:
    """Compile mpy-cross and the interpreter from `source`, with everything that is written in `folder`."""
    settings = {"SOURCE_DATE_EPOCH": RELEASED, "PYTHONDONTWRITEBYTECODE": "1"}
    settings["GIT_CEILING_DIRECTORIES"] = str(source.parent)  # a repository around it is not its version
    if tag:
        settings["MICROPY_GIT_TAG"] = tag
    environment = {name: value for name, value in os.environ.items() if name not in KEPT_OUT} | settings
    # Newer compilers find new things to warn of in old source.
    make = ["make", f"-j{os.cpu_count() or 1}", f"PYTHON={sys.executable}", "CFLAGS_EXTRA=-Wno-error"]
    cross, unix = folder / "mpy-cross", folder / "unix"
    command = [*make, f"--directory={source}/mpy-cross", f"BUILD={cross}"]
    steps.run("Compiling mpy-cross", command, env=environment)
    command = [*make, f"--directory={source}/ports/unix", f"BUILD={unix}", *BUILD_OPTIONS]
    steps.run("Compiling MicroPython", command, env=environment)
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
            "ptr32 differ from the RP2040's. Build it with MICROPY_FORCE_32BIT=1, or unset MICROPYTHON and "
            "run `python tools/build_micropython.py`."
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


@contextmanager
def locked(path: Path, steps: Steps) -> Iterator[None]:
    """Hold the lock file `path`; a second build waits for the first."""
    with path.open("w") as file:
        with steps.console.status("Waiting for another build of MicroPython …"):
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def build(folder: Path, checkout: Path | None, *, force: bool) -> None:
    """Build into `folder` from one's own `checkout`, else the package source, unless it is built by now.

    Raises `BubbleskinError` where that cannot be done.
    """
    try:
        check_machine(checkout)
        home = folder.parent
        steps = Steps(home / "logs")
        asked = time.time()
        with locked(home / "lock", steps):
            interpreter = folder / "micropython"
            if interpreter.is_file() and (not force or interpreter.stat().st_ctime > asked):
                return  # another call built it while we waited
            install(missing_packages(from_package=checkout is None), steps)
            with tempfile.TemporaryDirectory(prefix="micropython-") as name:
                source = checkout or fetch_source(Path(name), steps)
                tag = None if checkout else f"v{VERSION}"  # a checkout describes itself
                keep(compile_source(source, Path(name) / "build", steps, tag), folder)
    except (BubbleskinError, OSError) as problem:
        raise BubbleskinError(f"MicroPython cannot be built here: {problem}\n{INSTEAD}") from problem


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


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--micropython", metavar="DIR", type=Path, help="build your own checkout instead")
    parser.add_argument("--force", action="store_true", help="build even if there is a build already")
    parser.add_argument("--print", action="store_true", help="print nothing but the interpreter's path")
    options = parser.parse_args()
    try:
        interpreter = micropython(options.micropython, force=options.force)
    except BubbleskinError as problem:
        print(problem, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    if options.print:
        print(interpreter)
        return 0
    print(f"MicroPython, 32-bit: {interpreter}")
    if options.micropython:
        print(f"To use it: export MICROPYTHON={interpreter}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
