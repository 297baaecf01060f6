"""What a bring-up does to a board, through the SDK's public calls only: pulses, rest, shapes; it leaves everything vented."""

from collections.abc import Sequence
from contextlib import closing, suppress
from typing import TYPE_CHECKING

import numpy as np

from bubbleskin.bringup.evidence import Pulse, Reservoir, Rest, Trace, read_pulse
from bubbleskin.errors import BubbleskinError, DeviceRefused, LinkError

if TYPE_CHECKING:
    from bubbleskin.device.state import State
    from bubbleskin.skin import Skin

_FIELDS = ("pressure", "fill", "vent", "faults")
_BEFORE_S, _PULSE_S, _AFTER_S = 0.05, 0.07, 0.5
_FLAT_KPA, _FLAT_S = 0.4, 1.5
_REST_S = 1.0
_TRIES = 6
OPEN_SHARE, SHUT_SHARE = 0.08, 0.02
"""Heights of a pulse, as shares of the way from rest to the greatest: into an open line, where it must last for a whole period
to be seen, and into one that is shut, where 4 kPa are enough."""
LOW_SHARE = 0.15
"""And of the first shapes."""
_DRAWS_MOST = 20
_DUMP_S, _FILL_MOST_S = 2.0, 10.0


class Board:
    """The board behind `skin`. `zero_kpa`: what its sensors say without pressure, (n,), as `rest` has found."""

    def __init__(self, skin: "Skin"):
        self.skin = skin
        self.zero_kpa = np.zeros(skin.info.bubbles)

    def height_mm(self, share: float) -> float:
        """A height, as a share of the way from rest to the greatest."""
        info = self.skin.info
        return round(info.height_rest_mm + share * (info.height_max_mm - info.height_rest_mm), 2)

    def heights(self, bubbles: Sequence[int], height_mm: float) -> list[float]:
        """These bubbles at that height, all others without pressure."""
        return [height_mm if bubble in bubbles else 0.0 for bubble in range(self.skin.info.bubbles)]

    def estop(self) -> bool:
        """Whether the firmware says now that the emergency stop is pressed.

        It acknowledges by what its last tick has seen: a stop just released is pressed still until the next.
        """
        self.skin.sleep(2 * self.skin.info.tick)
        self.skin.clear_faults()
        return "emergency_stop" in self.skin.health().board_faults

    def await_supply(self, enough_kpa: float, seconds: float) -> float:
        """Wait until the reservoir has that much, or for so long; what it has, kPa."""
        begin = self.skin.health().time
        while True:
            health = self.skin.health()
            if health.supply_kpa >= enough_kpa or health.time - begin > seconds:
                return health.supply_kpa
            self.skin.sleep(0.1)

    def rest(self) -> Rest:
        """Sensors with everything vented."""
        self.skin.vent()
        self.flatten()
        states = []
        with closing(self.skin.telemetry(1.0 / self.skin.info.tick, ("pressure", "faults"))) as telemetry:
            for state in telemetry:
                states.append(state)
                if state.time - states[0].time > _REST_S:
                    break
        pressure = np.array([state.pressure_kpa for state in states])
        self.zero_kpa = pressure.mean(axis=0)
        return Rest(
            tuple(np.round(1e3 * self.zero_kpa, 1).tolist()),
            tuple(np.round(1e3 * pressure.std(axis=0), 1).tolist()),
            states[-1].faults,
        )

    def flatten(self) -> None:
        """Wait until nothing is left under pressure, or can be waited for; acknowledge what the pulse has led to."""
        begin = self.skin.state().time
        while True:
            state = self.skin.state()
            if np.abs(state.pressure_kpa - self.zero_kpa).max() < _FLAT_KPA or state.time - begin > _FLAT_S:
                break
            self.skin.sleep(0.05)
        if self.skin.faults() or self.skin.health().board_faults:
            self.skin.clear_faults()

    def pulse(self, asked: tuple[int, ...], off: int | None) -> Pulse:
        """Let these bubbles rise a little for less than a tenth of a second, then vent."""
        heights = self.heights(asked, self.height_mm(SHUT_SHARE if off is None else OPEN_SHARE))
        for _ in range(_TRIES):
            try:
                trace = self._trace(heights)
            finally:
                self.skin.vent()
                self.flatten()
            if trace:
                return read_pulse(trace, asked, off)
        raise BubbleskinError(
            f"Telemetry had gaps in {_TRIES} pulses, which tell nothing so; try the line with `bubbleskin doctor --link 5`."
        )

    def _trace(self, heights_mm: Sequence[float]) -> Trace | None:
        """Telemetry around a pulse; None where some of it is missing, or the wristband did not follow."""
        tick = self.skin.info.tick
        states = self._watched(heights_mm, max(round(_PULSE_S / tick), 9), round(_AFTER_S / tick))
        times = np.array([state.time for state in states])
        active = np.flatnonzero([state.mode == "active" for state in states])
        if not len(active):
            return None
        shown, vented = int(active[0]), int(active[-1]) + 1
        if np.any(np.abs(np.diff(times[shown - 2 : vented + 1]) - tick) > 0.5 * tick):
            return None
        pressure = np.array([one.pressure_kpa for one in states]) - self.zero_kpa
        fill, vent = (np.array([getattr(one, name) for one in states]) for name in ("fill_ms", "vent_ms"))
        return Trace(pressure, fill, vent, shown, vented, tick)

    def _watched(self, heights_mm: Sequence[float], rows: int, after: int) -> "list[State]":
        """States before, during and after a SHOW of `rows` periods, by what the wristband says itself: lines may be slow."""
        skin, before = self.skin, round(_BEFORE_S / self.skin.info.tick)
        states: list[State] = []
        active = left = 0
        with closing(skin.telemetry(1.0 / skin.info.tick, _FIELDS)) as telemetry:
            for state in telemetry:
                states.append(state)
                active += state.mode == "active"
                if len(states) == before:
                    skin.show(heights_mm, wait=False, plan=False)
                elif active == rows and state.mode == "active":
                    skin.vent()
                elif len(states) > before and state.mode != "active":
                    left += 1
                if left > after:
                    return states
        raise LinkError("The wristband's telemetry has ended in the middle of a pulse.")

    def draw(self) -> tuple[float, float | None, float]:
        """Take air from the reservoir until the firmware notices that its pump is off: kPa before, then, and after the dump."""
        skin = self.skin
        before = skin.health().supply_kpa
        everybody = self.heights(range(skin.info.bubbles), self.height_mm(LOW_SHARE))
        for _ in range(_DRAWS_MOST):
            health = skin.health()
            if "supply_lost" in health.board_faults:
                skin.sleep(_DUMP_S)
                return before, health.supply_kpa, skin.health().supply_kpa
            with suppress(DeviceRefused):  # where it has noticed in between
                skin.show(everybody, wait=False, plan=False)
            skin.sleep(0.25)
            skin.vent()
            skin.sleep(0.3)
        return before, None, skin.health().supply_kpa

    def refill(self, before_kpa: float, noticed_kpa: float | None, dumped_kpa: float) -> Reservoir:
        """With the pump on again."""
        self.skin.clear_faults()
        begin = self.skin.health().time
        filled = self.await_supply(0.95 * before_kpa, _FILL_MOST_S)
        return Reservoir(before_kpa, noticed_kpa, dumped_kpa, filled, self.skin.health().time - begin)
