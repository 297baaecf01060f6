"""What time is it on the device? Estimated from ping round trips, with bounds that the truth lies within.

A ping sent at s and received at r (host clock) carries the device time T at which it was handled, somewhere between the
two. So the difference of the clocks, device minus host, was at least T - r at r and at most T - s at s, however slow or
lopsided the link was. One round trip alone says little; the quickest of many on the way back and the quickest of many on
the way out, which need not be the same, say much. For a device clock that runs fast by d, |d| <= D, and whose d changes
by at most W in a second, the difference now lies within

    max_i (T_i - r_i + d a_i - W a_i²/2)   to   min_j (T_j - s_j + d b_j + W b_j²/2),      a, b: how long ago r and s are

and every d for which the two do not cross is possible. That is a regression for delays that are never below zero (Moon,
Skelly and Towsley 1999 fit the same lines by linear programming): a round trip that was held up does not touch the
bounds, so no outlier has to be told from the rest. The estimate is the middle of what is possible, the uncertainty half
of it.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bubble_protocol.schema.system import TICKS_WRAP
from bubbleskin.errors import LinkError
from bubbleskin.link.message import Message

PINGS = 20
"""Round trips after which a clock that has just begun knows enough."""
WINDOW = 60.0
"""Seconds of round trips that are kept, before the newest."""
DRIFT = 200e-6
"""Both crystals together are off by less: 30 ppm each at 25 °C, and then as much again for heat and age."""
WANDER = 0.1e-6
"""Most by which the drift changes in a second, 1/s: a crystal's 1 ppm in 10 s of quick warming."""

_WRAP = 1 << 30
"""Ticks are compared modulo this, which divides 2³²: half of it, 31 days of ticks, may pass between two pings."""
_BUCKETS = 60
"""Of the round trips in a 60th of the window, only the best each way are kept: less to reckon, next to nothing lost."""
_RESOLUTION = 1e-6
"""Seconds: the device's time is told in whole µs, rounded down."""
_HALVINGS = 40
"""Thirds that a search takes away from its interval: (2/3)⁴⁰ of it is left, 10⁻⁷."""


class _Best(NamedTuple):
    """The best round trips of a while: when, and the bound on device minus host time then, s."""

    received: float
    low: float
    sent: float
    high: float
    quickest: float
    pings: int


class _Bounds(NamedTuple):
    """What is possible at one moment: device minus host time, s, and the drift."""

    low: float
    high: float
    drift_low: float
    drift_high: float


class Clock:
    """The device's clock as seen from the host: feed it round trips with `observe`, then ask.

    `tick`: length of a device tick, s. `host`: the host's clock, s, by which pings are timed. Device time is that of
    `State.time`: seconds since the device's boot. What is asked before the first ping raises `LinkError`.
    """

    def __init__(self, tick: float, host: Callable[[], float], *, window: float = WINDOW):
        self._tick = tick
        self._host = host
        self._window = window
        self._best: dict[int, _Best] = {}
        self._newest = 0.0
        self._ticks: int | None = None  # the newest reading, unwrapped
        self._arrays: tuple[NDArray[np.float64], ...] | None = None
        self._drift = 0.0  # one that was possible when last all were reckoned

    def observe(self, sent: float, received: float, device_ticks: int, phase_us: int) -> None:
        """Take one round trip: host times in s, and the device's answer."""
        device = self._unwrapped(device_ticks) * self._tick + phase_us * 1e-6
        self._keep(sent, received, device)
        if self._is_impossible():  # the device has restarted, or one of us was asleep: what was known is no longer so
            self.reset()
            device = self._unwrapped(device_ticks) * self._tick + phase_us * 1e-6
            self._keep(sent, received, device)

    def hear(self, sent: float, reply: Message, received: float) -> None:
        """Take a PING's reply: what a link calls as its `on_ping`."""
        self.observe(sent, received, reply["ticks"], reply["phase_us"])

    def reset(self) -> None:
        """Forget everything, as after the device's reboot."""
        self._best.clear()
        self._ticks = None
        self._arrays = None

    @property
    def pings(self) -> int:
        """Round trips in the window."""
        return sum(best.pings for best in self._best.values())

    @property
    def age(self) -> float:
        """Seconds since the newest ping came back; infinite before the first."""
        return self._host() - self._newest if self._best else float("inf")

    @property
    def round_trip(self) -> float:
        """The quickest round trip in the window, s."""
        self._points()
        return min(best.quickest for best in self._best.values())

    @property
    def offset(self) -> float:
        """Device time minus host time now, s."""
        bounds = self._bounds(self._host())
        return (bounds.low + bounds.high) / 2

    @property
    def uncertainty(self) -> float:
        """By how much `now()` can be wrong, s. It grows while no pings come."""
        return self.uncertainty_at(self._host())

    @property
    def drift_ppm(self) -> float:
        """By how much faster the device's clock runs than the host's, in millionths: the middle of what is possible."""
        bounds = self._bounds(self._host())
        return (bounds.drift_low + bounds.drift_high) / 2 * 1e6

    def now(self) -> float:
        """Device time now, s."""
        return self.at(self._host())

    def at(self, host_time: float) -> float:
        """Device time, s, when the host's clock stands at `host_time`."""
        bounds = self._bounds(host_time)
        return host_time + (bounds.low + bounds.high) / 2

    def uncertainty_at(self, host_time: float) -> float:
        """By how much `at(host_time)` can be wrong, s."""
        bounds = self._bounds(host_time)
        return (bounds.high - bounds.low) / 2

    def host_time(self, device_time: float) -> float:
        """The host's time, s, when the device's clock stands at `device_time`."""
        host = device_time - self.offset
        for _ in range(3):  # each step is nearer by a factor of one over the drift
            host += device_time - self.at(host)
        return host

    def _unwrapped(self, ticks: int) -> int:
        """Ticks since boot, from a count that begins again at some power of two."""
        if self._ticks is None:
            self._ticks = int(ticks)
        else:
            ahead = (int(ticks) - self._ticks) % _WRAP
            self._ticks += ahead if ahead < _WRAP // 2 else ahead - _WRAP
        return self._ticks

    def _keep(self, sent: float, received: float, device: float) -> None:
        low, high = device - received, device + _RESOLUTION - sent
        best = _Best(received, low, sent, high, received - sent, 1)
        bucket = int(received * _BUCKETS // self._window)
        old = self._best.get(bucket)
        if old:
            best = _Best(
                *((received, low) if low > old.low else (old.received, old.low)),
                *((sent, high) if high < old.high else (old.sent, old.high)),
                min(old.quickest, received - sent),
                old.pings + 1,
            )
        self._best[bucket] = best
        self._newest = received
        if self._arrays and old and next(reversed(self._best)) == bucket:
            for of_all, of_newest in zip(self._arrays, best, strict=False):
                of_all[-1] = of_newest
            return
        for gone in [key for key in self._best if key <= bucket - _BUCKETS]:
            del self._best[gone]
        self._arrays = None

    def _points(self) -> tuple[NDArray[np.float64], ...]:
        """When the best came and when they were sent, and their bounds: received, low, sent, high."""
        if not self._best:
            raise LinkError("The device's time is not known yet: no ping has come back.")
        if self._arrays is None:
            self._arrays = tuple(np.array(list(self._best.values()))[:, :4].T)
        return self._arrays

    def _is_impossible(self) -> bool:
        """Whether no drift agrees with all round trips. One that did before mostly does now."""
        received, low, sent, high = self._points()
        a, b = self._newest - received, self._newest - sent
        lowest, highest = low + a * (self._drift - WANDER / 2 * a), high + b * (self._drift + WANDER / 2 * b)
        if lowest.max() <= highest.min():
            return False
        bounds = self._bounds(self._newest)
        self._drift = (bounds.drift_low + bounds.drift_high) / 2 if np.isfinite(bounds.drift_low) else 0.0
        return bounds.drift_low > bounds.drift_high

    def _bounds(self, host_time: float) -> _Bounds:
        """The extremes over all drifts that are possible; `drift_low > drift_high` where none is."""
        received, low, sent, high = self._points()
        a, b = host_time - received, host_time - sent
        low = low - WANDER / 2 * a**2
        high = high + WANDER / 2 * b**2
        # No low may be above any high: low_i + d a_i <= high_j + d b_j for all pairs, each a limit of d.
        room = high - low[:, None]
        apart = a[:, None] - b
        with np.errstate(divide="ignore", invalid="ignore"):
            limit = room / apart
        drift_high = min(DRIFT, limit[apart > 0].min(initial=np.inf))
        drift_low = max(-DRIFT, limit[apart < 0].max(initial=-np.inf))
        if room[apart == 0].min(initial=0.0) < 0.0 or drift_low > drift_high:
            return _Bounds(low.max(), high.min(), np.inf, -np.inf)
        # The lower bound is convex in d and the upper one concave; for times after the last ping, both rise with d.
        at_low = drift_low if a.min() >= 0 else _least(lambda d: float((low + d * a).max()), drift_low, drift_high)
        at_high = drift_high if b.min() >= 0 else _least(lambda d: -float((high + d * b).min()), drift_low, drift_high)
        return _Bounds((low + at_low * a).max(), (high + at_high * b).min(), drift_low, drift_high)


class DeviceTicks:
    """Makes the `ticks` of messages count on: a wristband counts up to 2³⁰ and goes on from 0, after 62 days at 5 ms.

    Right as long as two messages are less than half of that apart.
    """

    def __init__(self) -> None:
        self._latest: int | None = None

    def unwrap(self, message: Message) -> None:
        """Replace the `ticks` of this message, where it has some, by those since boot or since the link was opened."""
        ticks = message.fields.get("ticks")
        if not isinstance(ticks, int):
            return
        if self._latest is not None:
            ahead = (ticks - self._latest) % TICKS_WRAP
            if ahead >= TICKS_WRAP // 2:  # a message that was overtaken, or a wristband that has started again
                ahead -= TICKS_WRAP
            ticks = max(self._latest + ahead, 0)
        message.fields["ticks"] = self._latest = ticks


def _least(value: Callable[[float], float], left: float, right: float) -> float:
    """Where a convex function is least between two numbers."""
    for _ in range(_HALVINGS):
        third = (right - left) / 3
        if value(left + third) > value(right - third):
            left += third
        else:
            right -= third
    return (left + right) / 2
