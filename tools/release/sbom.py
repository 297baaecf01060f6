"""The bill of materials of a release, as CycloneDX: what the wheel needs, as it was tested, and what the UF2s are made of."""

import re
import sys
import tomllib
from datetime import UTC, datetime
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path
from runpy import run_path
from uuid import NAMESPACE_URL, uuid5

from cyclonedx.factory.license import LicenseFactory
from cyclonedx.model import HashAlgorithm, HashType
from cyclonedx.model.bom import Bom
from cyclonedx.model.component import Component, ComponentType
from cyclonedx.model.license import LicenseAcknowledgement
from cyclonedx.output.json import JsonV1Dot6
from packageurl import PackageURL
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

NAME = "bubbleskin"
FIRMWARES = {"micropython": "MIT", "pico-sdk-source": "BSD-3-Clause", "tinyusb-source": "MIT"}
"""What the UF2s are made of besides our own files, with its licence."""
LONGEST = 60
"""Letters of a licence's name; what is longer is its text."""


def locked(lock: Path) -> set[tuple[str, str]]:
    """Name and version of every package of a lock; some have one for each Python."""
    pins = re.findall(r"^([\w.-]+)==([\w.+!-]+)", lock.read_text(encoding="utf-8"), re.MULTILINE)
    return {(canonicalize_name(name), version) for name, version in pins}


def needed(requirements: list[str]) -> dict[str, tuple[Distribution, list[str]]]:
    """All packages that these requirements lead to, each with the names of those that it needs itself."""
    found: dict[str, tuple[Distribution, list[str]]] = {}
    waiting = names_of(requirements)
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        try:
            package = distribution(name)
        except PackageNotFoundError:
            sys.exit(f"{name} is not installed, so its licence is not known: make setup.")
        found[name] = package, names_of(package.requires or [])
        waiting += found[name][1]
    return found


def names_of(requirements: list[str]) -> list[str]:
    """Names of those that are needed here, extras apart."""
    parsed = [Requirement(text) for text in requirements]
    return sorted(
        {canonicalize_name(one.name) for one in parsed if not one.marker or one.marker.evaluate({"extra": ""})}
    )


def licence(package: Distribution) -> str | None:
    """The name of a package's licence: as an expression, else as its field or its classifiers have it."""
    about = package.metadata
    text = about.get("License-Expression") or about.get("License") or ""
    if 0 < len(text) <= LONGEST and "\n" not in text:
        return text
    classified = [line.split(" :: ")[-1] for line in about.get_all("Classifier", []) if line.startswith("License :: ")]
    return " AND ".join(sorted(classified)) or None


def bill(source: Path, version: str, commit: str, epoch: int) -> str:
    """The bill of the release that is made of the files in `source`, as JSON: the same commit gives the same text."""
    project = tomllib.loads((source / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    versions = locked(source / "requirements.lock")
    factory = LicenseFactory()
    ours = component(factory, NAME, version, project["license"], "pypi", ComponentType.APPLICATION)
    packages = needed(project["dependencies"])
    parts = {}
    for name, (package, _) in packages.items():
        if (name, package.version) not in versions:
            sys.exit(
                f"{name} {package.version} is installed here and not in requirements.lock: make setup, then again."
            )
        parts[name] = component(factory, name, package.version, licence(package), "pypi", ComponentType.LIBRARY)
    fetched = [of_firmware(factory, file, digest) for file, digest in sources(source).items()]
    bom = Bom(components=[*parts.values(), *fetched])
    bom.serial_number = uuid5(NAMESPACE_URL, f"{NAME}:{commit}")
    bom.metadata.component = ours
    bom.metadata.timestamp = datetime.fromtimestamp(epoch, UTC)
    bom.register_dependency(ours, [parts[name] for name in names_of(project["dependencies"])] + fetched)
    for name, (_, wants) in packages.items():
        bom.register_dependency(parts[name], [parts[other] for other in wants])
    return JsonV1Dot6(bom).output_as_string(indent=2) + "\n"


def component(
    factory: LicenseFactory, name: str, version: str, terms: str | None, kind: str, role: ComponentType
) -> Component:
    """A package with its version, its licence and its address."""
    licences = (
        [factory.make_from_string(terms, license_acknowledgement=LicenseAcknowledgement.DECLARED)] if terms else []
    )
    address = PackageURL(kind, "debian" if kind == "deb" else None, name, version)
    return Component(name=name, version=version, type=role, licenses=licences, purl=address, bom_ref=str(address))


def sources(source: Path) -> dict[str, str]:
    """The files that the firmware is built of, with their SHA-256: the build takes no others."""
    return run_path(str(source / "host_sdk/bubbleskin/toolchain/checksums.py"))["SHA256"]


def of_firmware(factory: LicenseFactory, file: str, digest: str) -> Component:
    """A file that Debian has."""
    name, version = re.match(r"([^_]+)_(.+?)(?:_all)?\.(?:dsc|deb|orig\.tar\.xz|debian\.tar\.xz)$", file).groups()
    made = component(factory, name, version, FIRMWARES[name], "deb", ComponentType.FIRMWARE)
    made.bom_ref.value = f"{made.purl}?file={file}"
    made.description = file
    made.hashes.add(HashType(alg=HashAlgorithm.SHA_256, content=digest))
    return made
