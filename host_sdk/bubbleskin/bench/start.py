"""How soon a simulated board answers, beside a Python that imports numpy."""

import resource
import subprocess
import sys
from collections.abc import Iterator

from bubbleskin.bench.rows import REPEATS, Row, share_of

_STATE = "import bubbleskin as bs; bs.connect('sim://wristband7').state()"
_HELP = "from bubbleskin.cli.command import main; main(['--help'])"
_INFO = "from bubbleskin.cli.command import main; main(['info', '--device', 'sim://wristband7'])"


def rows(size: float = 1.0) -> Iterator[Row]:
    """Processor time of whole processes, best of several, with everything compiled."""
    repeats = share_of(REPEATS, size)
    _seconds(_STATE)  # Compiled and kept.
    numpy = min(_seconds("import numpy") for _ in range(repeats))
    for what, code, target in (("a first state", _STATE, "< 1"), ("info", _INFO, "< 1.5"), ("--help", _HELP, "")):
        seconds = min(_seconds(code) for _ in range(repeats))
        yield Row(f"{what}, from the start of Python", seconds, "s", target)
        yield Row(f"{what}, by `import numpy`", seconds / numpy, "×")


def _seconds(code: str) -> float:
    """Processor time that a Python takes for `code`."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-c", code], capture_output=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
