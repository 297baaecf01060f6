"""Look for bytes that harm the firmware: coverage-guided, on decoder, dispatcher and every handler.

    python tools/stress/fuzz.py                  # ten minutes
    python tools/stress/fuzz.py --seconds 60     # less

It begins with the inputs of `tests/firmware/corpus.txt`, one in hexadecimal on each line, and in the end writes
those back that together reach what was reached. An everyday test runs them all. What fails stays in `crash-…`.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

PACKAGES = ["bubble_protocol", "bubble_firmware"]
"""Atheris takes packages whole, whatever module is asked for."""
WATCHED = [
    "bubble_protocol.frame",
    *(f"bubble_firmware.{name}" for name in ("app", "commands", "link.server", "link.receive_window", "link.reply")),
    *(
        f"bubble_firmware.handlers.{name}"
        for name in ("session", "shape", "faults", "settings", "sequence", "tables", "trim")
    ),
]
"""Modules whose branches lead the search: it does not begin where one of them is not followed."""
CORPUS = Path(__file__).parents[2] / "tests/firmware/corpus.txt"


def unwatched(names: list[str]) -> list[str]:
    """Those of the modules that are not loaded, or not by Atheris, which is what makes their branches seen."""
    loaders = {name: type(getattr(sys.modules.get(name), "__loader__", None)) for name in names}
    return [name for name, loader in loaders.items() if not loader.__module__.startswith("atheris.")]


def worker(arguments: list[str]) -> None:
    """One libFuzzer process."""
    import atheris

    with atheris.instrument_imports(include=PACKAGES):
        import fuzz_target

    blind = unwatched(WATCHED)
    if blind:
        sys.exit(
            f"The search would be blind in {', '.join(blind)}: no such module is loaded, or not by Atheris. "
            "Name what there is in WATCHED, tools/stress/fuzz.py."
        )
    # When it merges, libFuzzer has its first argument run by a shell.
    atheris.Setup([f"{sys.executable} {__file__} --worker", *arguments], fuzz_target.one_input)
    atheris.Fuzz()


def run(*arguments: str) -> int:
    return subprocess.run([sys.executable, __file__, "--worker", *arguments], check=False).returncode


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=int, default=600)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found, small = Path(folder, "found"), Path(folder, "small")
        found.mkdir()
        small.mkdir()
        for number, line in enumerate(CORPUS.read_text().split() if CORPUS.exists() else []):
            (found / f"{number:04}").write_bytes(bytes.fromhex(line))
        status = run(f"-max_total_time={options.seconds}", "-max_len=600", "-timeout=20", str(found))
        if status:
            sys.exit(status)
        run("-merge=1", str(small), str(found))
        lines = sorted({path.read_bytes().hex() for path in small.iterdir()} - {""}, key=lambda line: (len(line), line))
        CORPUS.write_text("\n".join(lines) + "\n")
        print(f"{len(lines)} inputs in {CORPUS.name}; nothing has failed")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--worker"]:
        worker(sys.argv[2:])
    else:
        main()
