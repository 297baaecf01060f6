"""What `bubbleskin bench` measures. Speeds are ratios to something measured in the same run, wherever one fits.

A bench is a module here with one function, `rows(size)`, and an entry in `BENCHES`. `size` is the share of the full work:
1 gives the published values, less repeats less often, so that the tests run every bench once in small.
"""

from collections.abc import Iterable, Iterator
from importlib import import_module

from bubbleskin.bench.rows import Row

BENCHES: dict[str, str] = {
    "simulation": "how fast simulated wristbands run",
    "membrane": "inversions, tables, fits",
    "contact": "shapes of bubbles that touch, and plans",
    "start": "how soon a simulated board answers, beside `import numpy`",
    "film": "films of sequences, beside an empty figure",
    "codec": "frames, beside pymavlink",
    "link": "round trips over a pseudo-terminal, beside a plain echo",
    "clock": "error of the device's time under jitter",
    "control": "true heights on honest plants, beside those of the first law; some 15 minutes, so only where it is named",
}
"""What runs on the host: the module's name, and what it measures in a few words."""


LONG = ("control",)
"""Those that run only where they are named."""


def measure(bench: str, size: float = 1.0) -> Iterator[Row]:
    """Run one of `BENCHES` with that share of its full work."""
    # Imported when it is measured: each takes its own second of scipy, numba or pymavlink.
    rows: Iterable[Row] = import_module(f"{__name__}.{bench}").rows(size)
    yield from rows
