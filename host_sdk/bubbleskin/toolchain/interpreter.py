"""Where the real MicroPython lies: the interpreter that `toolchain.unix` builds, or one's own."""

import hashlib
import os
from pathlib import Path

import platformdirs

from bubbleskin.errors import BubbleskinError

VERSION = "1.25.0"
WORD_BITS = 32
"""As on the RP2040: small integers of 31 bits, `ptr32` reads signed words, viper's products wrap."""

BUILD_OPTIONS = (
    "MICROPY_FORCE_32BIT=1",
    "MICROPY_PY_FFI=0",
    "MICROPY_PY_SSL=0",
    "MICROPY_SSL_MBEDTLS=0",
    "MICROPY_PY_BTREE=0",
    "MICROPY_PY_BLUETOOTH=0",
    "FROZEN_MANIFEST=",
)
"""What `make -C ports/unix` is given."""


def cache_folder() -> Path:
    """The folder of everything built once and kept; `BUBBLESKIN_CACHE` names another."""
    chosen = os.environ.get("BUBBLESKIN_CACHE")
    return Path(chosen).expanduser().absolute() if chosen else platformdirs.user_cache_path("bubbleskin")


def build_key() -> str:
    """The name of one build: version, word size and a hash of the build options."""
    options = hashlib.sha256("\n".join(BUILD_OPTIONS).encode()).hexdigest()
    return f"{VERSION}-{WORD_BITS}bit-{options[:12]}"


def build_folder() -> Path:
    """Where the built `micropython`, and the `mpy-cross` that belongs to it, are kept. It need not exist."""
    return cache_folder() / "micropython" / build_key()


def own_micropython() -> Path | None:
    """The interpreter that the environment variable `MICROPYTHON` names, or None when it names none.

    Raises `BubbleskinError` when there is no such program.
    """
    named = os.environ.get("MICROPYTHON")
    if not named:
        return None
    path = Path(named).expanduser().absolute()
    if not path.is_file():
        raise BubbleskinError(
            f"MICROPYTHON is set to {named}, which is not a file. Set it to the path of a 32-bit MicroPython "
            "(unix port), or unset it: then one is built where it is needed first."
        )
    if not os.access(path, os.X_OK):
        raise BubbleskinError(
            f"MICROPYTHON is set to {named}, which is not executable. Run `chmod +x {named}` if it is a "
            "MicroPython, or unset MICROPYTHON."
        )
    return path


def find_micropython() -> Path:
    """The interpreter to use: the one `MICROPYTHON` names, else the one built and cached.

    Raises `BubbleskinError` when there is neither.
    """
    own = own_micropython()
    if own is not None:
        return own
    built = build_folder() / "micropython"
    if not built.is_file():
        raise BubbleskinError(
            f"MicroPython {VERSION} has not been built on this machine yet. The first `micropython://` does that, in a minute "
            "or two, on Linux with apt-get; or set MICROPYTHON to the path of a 32-bit MicroPython (unix port)."
        )
    return built
