"""Play what has to be played, and take down what telemetry says; whatever happens, the wristband is vented at the end."""

import contextlib
from collections.abc import AsyncGenerator, Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from bubbleskin.calibrate import excite
from bubbleskin.calibrate.excite import Step
from bubbleskin.calibrate.trace import FIELDS, Trace, of_states
from bubbleskin.device.info import Info
from bubbleskin.device.state import State
from bubbleskin.errors import LinkError
from bubbleskin.layout import Layout

Floats = NDArray[np.float64]

_MOVED_MM = 0.01
_TOLD_EVERY = 50  # readings
_EMPTY_TRIES = 4  # a full bubble is empty after one; whose sensor says otherwise is found by its zero
_RECENT = 5  # readings whose mean is compared with the pressure that stops a bubble


class Wristband(Protocol):
    """What is needed of an `AsyncSkin`."""

    @property
    def info(self) -> Info:
        """Who it is."""

    @property
    def layout(self) -> Layout:
        """Where its bubbles are."""

    def telemetry(self, rate_hz: float = ..., fields: Iterable[str] | None = ...) -> AsyncGenerator[State]:
        """States as they come."""

    async def show(self, heights_mm: Any, over: float = ..., wait: Any = ..., *, fill: str | None = ...) -> Any:
        """Go to heights."""

    async def vent(self) -> None:
        """Open all vents."""

    async def state(self) -> State:
        """The state now."""

    async def sleep(self, seconds: float) -> None:
        """Wait on the device's clock."""


@dataclass(frozen=True)
class CalibrationProgress:
    """How far a calibration is."""

    what: str
    """What is done now."""
    bubbles: tuple[int, ...]
    """Those that move, or are fitted."""
    done: float
    """Share of the device's time that has passed, 0 to 1."""


Progress = Callable[[CalibrationProgress], object]


@dataclass(frozen=True, eq=False)
class Measured:
    """Everything that was taken down."""

    traces: tuple[Trace, ...]
    zero_pa: Floats
    """What each sensor says without pressure, as the device reckons it; (n,)."""
    device_s: float


async def measure(skin: Wristband, bubbles: Sequence[int], progress: Progress | None) -> Measured:
    """Measure `bubbles`, all others vented."""
    tick = skin.info.tick
    groups = excite.groups(skin.layout, bubbles)
    whole = excite.device_seconds(len(groups), tick)
    first = 0.0

    def tell(what: str, which: Sequence[int]) -> Callable[[float], None]:
        def at(now: float) -> None:
            if progress:
                progress(CalibrationProgress(what, tuple(which), min((now - first) / whole, 1.0)))

        return at

    try:
        await _empty(skin)
        first = (await skin.state()).time
        rest = await _run(skin, [], [Step(0.0, excite.REST_S, True)], tell("zeros, at rest", ()))
        zero = 1e3 * np.mean([state.pressure_kpa for state in rest], axis=0)
        last = rest[-1].time
        traces: list[Trace] = []
        for group in groups:
            plan = list(excite.steps(tick))
            states = await _run(skin, group, plan, tell("stretching and stepping", group))
            last = states[-1].time
            stretching = sum(step.seconds for step in plan if step.stretching) + excite.phase(len(group), tick)
            traces.append(of_states(states, group, tick, stretching))
            await skin.vent()
            await skin.sleep(excite.GAP_S)
        return Measured(tuple(traces), zero, last + excite.GAP_S - first)
    finally:
        with contextlib.suppress(LinkError):  # without a host it vents by itself
            await skin.vent()


async def _empty(skin: Wristband) -> None:
    """Vent, and wait for the last pressure to go where a shape stood: it would be taken for the sensors' zeros."""
    await skin.vent()
    for _ in range(_EMPTY_TRIES):
        if (await skin.state()).mode != "venting":
            return
        await skin.sleep(excite.GAP_S)


async def _run(
    skin: Wristband, group: Sequence[int], plan: Sequence[Step], tell: Callable[[float], None]
) -> list[State]:
    """One group through its steps, each bubble a little after the one before: their fillings are told apart by that."""
    info = skin.info
    ends = np.cumsum([step.seconds for step in plan])
    lag = excite.phase(len(group), info.tick) / max(len(group), 1)
    most_kpa = excite.PRESSURE_SHARE * info.pressure_max_kpa
    states: list[State] = []
    asked = np.full(info.bubbles, -1.0)
    top = np.full(info.bubbles, np.inf)
    telemetry = skin.telemetry(1.0 / info.tick, FIELDS)
    try:
        async for state in telemetry:
            if len(states) % _TOLD_EVERY == 0:
                tell(state.time)
            states.append(state)
            since = state.time - states[0].time + 1e-6
            if since > ends[-1] + lag * len(group):
                return states
            wanted = np.zeros(info.bubbles)
            for place, bubble in enumerate(group):
                step = int(np.searchsorted(ends, since - lag * place, side="right"))
                wanted[bubble] = plan[min(step, len(plan) - 1)].height_mm
            pressure = np.mean([one.pressure_kpa for one in states[-_RECENT:]], axis=0)
            stopped = (wanted > asked) & (asked > 0) & (pressure > most_kpa) & ~np.isfinite(top)
            top[stopped] = asked[stopped]
            wanted = np.minimum(wanted, top)
            if np.abs(wanted - asked).max() > _MOVED_MM:
                await skin.show(wanted, wait=False)
                asked = wanted
        raise LinkError(
            "The wristband's telemetry has ended in the middle of a calibration; connect again and repeat it."
        )
    finally:
        await telemetry.aclose()
