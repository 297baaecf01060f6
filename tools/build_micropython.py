"""Build the real MicroPython that the project is tested against: the unix port, 32-bit like the RP2040.

The source is Debian's package, fetched through an apt root of its own, so nothing of the machine's apt
changes. The interpreter and its mpy-cross are kept in the cache folder; a second call only finds them.
"""

import argparse
import sys
from pathlib import Path

from bubbleskin.errors import BubbleskinError
from bubbleskin.toolchain.unix import micropython


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
