"""How well the clock knows the device's time: simulated links whose jitter is known, device clocks whose truth is known."""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from bubbleskin.bench.rows import Row, share_of
from bubbleskin.link.clock import Clock

PING = 0.1
"""Seconds between two pings, and up to a tick more by chance: else all could wait for their tick equally long."""
DEVICE_TICK = 0.005
"""s."""
AGES = (1.0, 2.0, 5.0, 10.0, 20.0, 30.0)
"""Lengths of the ping history at which the clock is asked, s; after the last of them at every tenth ping."""
TARGET = 1e-3
"""s."""
_SEEDS = 20
_SECONDS = 120.0
_LEAST_SECONDS = AGES[-1] + 5.0
"""Of one history: long enough to ask once at every age."""

Law = Callable[[np.random.Generator, int], tuple[NDArray[np.float64], NDArray[np.float64]]]
"""Delays out and back of so many pings, s, (n,) each."""


def uniform(rng: np.random.Generator, n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Waits up to 20 ms each way, evenly spread."""
    return rng.uniform(0, 20e-3, n), rng.uniform(0, 20e-3, n)


def _exponential(rng: np.random.Generator, n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return rng.exponential(5e-3, n), rng.exponential(5e-3, n)


def _usb(rng: np.random.Generator, n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Out at once; back when the host's next 1 ms frame polls and its program is woken, which can take 20 ms."""
    woken = np.where(rng.random(n) < 0.3, rng.uniform(0, 20e-3, n), 0.2e-3)
    return rng.uniform(0.1e-3, 0.2e-3, n), rng.uniform(0.1e-3, 1.1e-3, n) + woken


def _one_way(rng: np.random.Generator, n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return np.full(n, 0.1e-3), rng.uniform(0, 20e-3, n)


def _stalls(rng: np.random.Generator, n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Each way is held up by another 20 ms for a second or so, half of the time."""
    held = np.cumsum(rng.random((2, n)) < PING, axis=1) % 2 * 20e-3
    out, back = held + rng.exponential(1e-3, (2, n))
    return out, back


LAWS: dict[str, Law] = {
    "uniform, 0-20 ms each way": uniform,
    "exponential, mean 5 ms each way": _exponential,
    "USB: polled, at times 20 ms late on the way back": _usb,
    "0-20 ms on the way back only": _one_way,
    "20 ms for a second, half of the time": _stalls,
}


class Device:
    """A device clock whose reading is known at every host time: off by up to 50 ppm, warming by up to 0.05 ppm/s for a while."""

    def __init__(self, rng: np.random.Generator):
        self.offset = rng.uniform(0, 1000)
        self._drift = rng.uniform(-50e-6, 50e-6)
        self._ramp = rng.uniform(-0.05e-6, 0.05e-6)
        self._from, self._to = np.sort(rng.uniform(0, _SECONDS, 2))

    def at(self, host: float) -> float:
        """Device time at a host time, s."""
        into = min(max(host - self._from, 0.0), self._to - self._from)
        after = max(host - self._to, 0.0)
        return self.offset + host * (1 + self._drift) + self._ramp * (into**2 / 2 + into * after)


def history(
    law: Law, seed: int, *, reads_every: float = 0.0, seconds: float = _SECONDS
) -> list[tuple[float, float, float]]:
    """A clock that goes through `law` for so many seconds: (age, error, stated uncertainty) of many questions, s.

    `reads_every`: the device looks at its link only at whole multiples of this on its own clock, 0: at once.
    """
    rng = np.random.default_rng(seed)
    device = Device(rng)
    now = 0.0
    clock = Clock(DEVICE_TICK, lambda: now)
    n = int(seconds / PING)
    out, back = law(rng, n)
    asked = []
    for k in range(n):
        sent = max(k * PING + rng.uniform(0, DEVICE_TICK), now)  # The next ping waits for the one before.
        handled = sent + out[k]
        if reads_every:
            handled += -device.at(handled) % reads_every
        now = handled + back[k]
        ticks, rest = divmod(device.at(handled), DEVICE_TICK)
        clock.observe(sent, now, int(ticks) % (1 << 32), int(rest * 1e6))
        for age in AGES:
            if sent <= age < sent + PING or (age == AGES[-1] and sent > age and k % 10 == 0):
                question = now + rng.uniform(0, PING)
                asked.append((age, abs(clock.at(question) - device.at(question)), clock.uncertainty_at(question)))
    return asked


def rows(size: float = 1.0) -> Iterator[Row]:
    """Per law of jitter: the error, the uncertainty stated, how often the truth was inside, and how soon that is so."""
    seeds = range(share_of(_SEEDS, size))
    seconds = max(_SECONDS * min(1.0, size * _SEEDS), _LEAST_SECONDS)
    for name, law in LAWS.items():
        for reads_every in (0.0, DEVICE_TICK):
            asked = np.array(
                [a for seed in seeds for a in history(law, seed, reads_every=reads_every, seconds=seconds)]
            )
            late = asked[asked[:, 0] == AGES[-1]]
            error, stated = (float(np.quantile(late[:, column], 0.99)) * 1e3 for column in (1, 2))
            inside = float((asked[:, 1] <= asked[:, 2]).mean()) * 100
            good = [float(np.quantile(asked[asked[:, 0] == age, 1], 0.99)) <= TARGET for age in AGES]
            soon = AGES[good.index(True)] if any(good) else np.inf
            title = f"{name}; link read {'once a tick' if reads_every else 'at once'}"
            yield Row(f"{title}: error, p99", error, "ms", "≤ 1")
            yield Row("  uncertainty stated, p99", stated, "ms")
            yield Row("  truth inside the uncertainty stated", inside, "%", "≥ 99")
            yield Row("  error within 1 ms after pings for", soon, "s")
