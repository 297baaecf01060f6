"""Packages and sources from Debian, without touching the machine's own apt: a root of its own, another suite."""

import os
import re
import shutil
from pathlib import Path

from bubbleskin.errors import BubbleskinError
from bubbleskin.toolchain.checksums import verify
from bubbleskin.toolchain.commands import CommandRunner, tail
from bubbleskin.toolchain.interpreter import VERSION

SUITE = "trixie"
"""The Debian release whose source package is `VERSION`."""
KEYRING = Path("/usr/share/keyrings/debian-archive-keyring.gpg")

# Taken over from the machine's own sources; the other fields are of no use to source packages.
COPIED_FIELDS = ("Uris", "Signed-By", "Trusted", "Check-Valid-Until")


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
    """The Debian archives among `stanzas` as a `.sources` file for `suite`.

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
        wanted = {"Types": "deb deb-src", "Suites": suite, "Components": "main", **copied}
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


def install(packages: list[str], runner: CommandRunner) -> None:
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
    if runner.try_run(f"Installing {names}", command, env=quiet):
        runner.try_run("Updating apt's lists", ["apt-get", "update"], env=quiet)
        runner.run(f"Installing {names}", command, env=quiet)


class DebianRoot:
    """An apt root inside `folder`, with the archives of `SUITE` and nothing else in it."""

    def __init__(self, folder: Path, runner: CommandRunner) -> None:
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
        self._apt = ["apt-get", *(f"-o{name}={value}" for name, value in settings.items())]
        self._folder = folder
        self._runner = runner
        # One of several archives may lack the suite; what counts is whether the packages then come.
        self._update = runner.try_run("Reading the source lists", [*self._apt, "update"])

    def micropython(self) -> Path:
        """MicroPython's source, unpacked."""
        self._fetch("Fetching the source", "source", "--download-only", "micropython")
        offered = list(self._folder.glob("micropython_*.dsc"))
        wanted = [path for path in offered if path.name.startswith(f"micropython_{VERSION}")]
        if not wanted:
            names = ", ".join(path.stem for path in offered)
            raise BubbleskinError(f"version {VERSION} is wanted, and apt offers {names}.")
        for path in self._folder.glob("micropython_*"):
            verify(path)
        source = self._folder / "source"
        self._runner.run("Unpacking the source", ["dpkg-source", "-x", str(wanted[0]), str(source)])
        return source

    def package(self, name: str) -> Path:
        """The folder into which the files of the binary package `name` have been unpacked."""
        self._fetch(f"Fetching {name}", "download", name)
        offered = list(self._folder.glob(f"{name}_*.deb"))
        if len(offered) != 1:
            raise BubbleskinError(f"apt brought {len(offered)} packages called {name} where one was asked for.")
        verify(offered[0])
        unpacked = self._folder / name
        self._runner.run(f"Unpacking {name}", ["dpkg-deb", "-x", str(offered[0]), str(unpacked)])
        return unpacked

    def _fetch(self, title: str, *arguments: str) -> None:
        log = self._runner.try_run(title, [*self._apt, *arguments], folder=self._folder)
        if log:
            raise BubbleskinError(f"apt could not fetch {arguments[-1]}.\n{tail(self._update or log)}")
