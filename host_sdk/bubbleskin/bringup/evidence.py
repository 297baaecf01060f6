"""What was seen of a board, without what it means: sensors at rest, the emergency stop, what sensors made of pulses."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

NONE, OPEN, FELL, HELD, ROSE = "none", "open", "fell", "held", "rose"
"""What a sensor saw of a pulse: nothing; pressure that was gone at once, as of a line without its bubble; that fell slowly, as
through an open vent; that stayed; that rose after the pulse was over."""

SEEN_KPA = 0.3
"""Less is noise, which is 0.05 RMS."""
_OPEN_SEEN_KPA = 1.0
_OPEN_SHARE = 0.15  # what is left two periods later where the line is open: air leaves in a millisecond
_LONG_S = 0.02
_LONG_SHARE = 0.35  # an open vent takes nine tenths in that time; soft rubber gives way by less than half
_STEP_SHARE = 0.65  # what is left after one period, where another pulse follows: an open vent takes half
_ROSE_KPA = 0.4  # in each period
_CLOSES_MS = 1.2  # so late a valve may close


@dataclass(frozen=True, eq=False)
class Trace:
    """Telemetry around a pulse, a row per period: pressures less what the sensors say at rest, and what valves were told."""

    pressure_kpa: Floats
    """(k, n)."""
    fill_ms: Floats
    """(k, n); plays in the period after the next row."""
    vent_ms: Floats
    """The same."""
    shown: int
    """The row at which the pulse was asked for."""
    vented: int
    """The row at which VENT was."""
    tick_s: float
    """The period."""


@dataclass(frozen=True)
class Pulse:
    """One short pulse: the bubbles that were asked to rise at once, the one that was pulled off, and what each sensor saw."""

    asked: tuple[int, ...]
    off: int | None
    """The bubble that was off its barb; None where all were on."""
    seen: tuple[str, ...]
    """One of `NONE`, `OPEN`, `FELL`, `HELD`, `ROSE` for each sensor."""
    rise_kpa: tuple[float, ...]
    """The most that each sensor saw."""
    left_kpa: tuple[float, ...]
    """What was left half a second after VENT."""
    heard: bool | None = None
    """Whether valves were heard to click; None where nobody was asked."""

    def with_heard(self, heard: bool) -> "Pulse":
        """The same, and whether it was heard."""
        return replace(self, heard=heard)

    @property
    def channels(self) -> list[int]:
        """The sensors that saw something, the strongest first."""
        return sorted((c for c, seen in enumerate(self.seen) if seen != NONE), key=lambda c: -self.rise_kpa[c])


@dataclass(frozen=True)
class EmergencyStop:
    """Whether the firmware said that the emergency stop was pressed: before, while it was, and after."""

    released: bool
    pressed: bool
    released_again: bool


@dataclass(frozen=True)
class Rest:
    """What sensors say without pressure: mean and RMS noise of each bubble's in Pa, and the faults that the firmware found."""

    zero_pa: tuple[float, ...]
    noise_pa: tuple[float, ...]
    faults: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Reservoir:
    """What the reservoir did with its pump off: before, when the firmware noticed, two seconds later; and with the pump on."""

    before_kpa: float
    noticed_kpa: float | None
    """None where the firmware has not noticed."""
    dumped_kpa: float
    filled_kpa: float
    fill_s: float


def read_pulse(trace: Trace, asked: tuple[int, ...], off: int | None) -> Pulse:
    """What each sensor saw of a pulse."""
    n = trace.pressure_kpa.shape[1]
    before_vent = trace.pressure_kpa[trace.shown : trace.vented + 1]
    return Pulse(
        asked,
        off,
        tuple(_seen(trace, list(asked), off, channel) for channel in range(n)),
        tuple(np.round(before_vent.max(axis=0), 2).tolist()),
        tuple(np.round(trace.pressure_kpa[-5:].mean(axis=0), 2).tolist()),
    )


def _seen(trace: Trace, asked: list[int], off: int | None, channel: int) -> str:
    pressure = trace.pressure_kpa[trace.shown : trace.vented + 1, channel]
    peak = float(pressure.max())
    if peak < SEEN_KPA:
        return NONE
    before, after = pressure[:-2], pressure[2:]  # two periods: the pulse may end within the first
    if off is not None and np.any((before > max(_OPEN_SEEN_KPA, 0.5 * peak)) & (after < _OPEN_SHARE * before)):
        return OPEN
    rows = np.flatnonzero(_quiet(trace, asked) & (pressure[:-1] >= SEEN_KPA))
    return _line(pressure, rows, max(round(_LONG_S / trace.tick_s), 2))


def _quiet(trace: Trace, asked: list[int]) -> NDArray[np.bool_]:
    """For each row from SHOW to VENT, whether from it to the next one no fill was open, and every vent asked to be shut was."""
    rows = np.arange(trace.shown, trace.vented)
    fill, vent = trace.fill_ms[:, asked], trace.vent_ms[:, asked]
    late = fill[rows - 2] > 1e3 * trace.tick_s - _CLOSES_MS  # one that closes within the period after its own
    undisturbed = (fill[rows - 1] <= 0) & (vent[rows - 1] <= 0) & ~late
    return np.asarray(undisturbed.all(axis=1))


def _line(pressure: Floats, rows: NDArray[np.intp], long: int) -> str:
    """How the pressure of a line went on in the periods after `rows`, with no valve open; `long`: how many tell it all."""
    if not len(rows):
        return FELL
    if (pressure[rows + 1] - pressure[rows])[:long].mean() > _ROSE_KPA:
        return ROSE
    gaps = np.flatnonzero(np.diff(rows) > 1)
    run = int(gaps[0]) + 1 if len(gaps) else len(rows)
    if run >= long:
        return HELD if pressure[rows[0] + run] >= _LONG_SHARE * pressure[rows[0]] else FELL
    return HELD if np.median(pressure[rows + 1] / pressure[rows]) >= _STEP_SHARE else FELL
