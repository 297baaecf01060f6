"""What holds the heights: the firmware as it is, and the law of the first release, on boards that are watched tick by tick."""

from abc import ABC, abstractmethod
from array import array
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bubble_firmware.control.flow import flow_gain
from bubble_firmware.control.state_layout import FOLLOW, VENT
from bubble_firmware.control.supply import Supply
from bubbleskin import boards
from bubbleskin.async_skin import AsyncSkin
from bubbleskin.bench.control.first_law import Bubbles, Figures
from bubbleskin.bench.control.plants import BOARD, Sheet
from bubbleskin.link.link import run_sync
from bubbleskin.membrane import Table, YeohBalloon, build_table
from bubbleskin.sim.board import SimulatedBoard
from bubbleskin.sim.firmware import Firmware, Outputs
from bubbleskin.sim.plant import Plant
from bubbleskin.sim.transport import SimulatedTransport
from bubbleskin.skin import Skin

PRESENT, FIRST = "this firmware", "the first law"
_TESTED_S = 1.0  # after power comes: the self-test, and what is in the bubbles has gone
_PATIENCE_S = 2.0
CONDITIONED_MM = 14.0
"""Real rubber has been this high once, before anybody measured it."""


class Watched(SimulatedBoard):
    """A board that keeps true heights, and for how long each valve has current, of every tick."""

    def __init__(self, sheet: Sheet, firmware: Firmware | None = None):
        super().__init__(BOARD, seed=sheet.seed, contact=False, firmware=firmware, parameters=sheet.parameters)
        self.plant.soften(CONDITIONED_MM)
        self._heights: list[NDArray[np.float64]] = []
        self._energised: list[NDArray[np.float64]] = []

    def tick(self) -> None:
        """See `SimulatedBoard`."""
        super().tick()
        self._heights.append(self.alone_mm)
        self._energised.append(self.pulses.copy())

    def begin(self) -> None:
        """Forget what has been seen."""
        self._heights.clear()
        self._energised.clear()

    def seen(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """True heights in mm, (ticks, n), and seconds with current, (ticks, n, 2), since `begin`."""
        return np.array(self._heights), np.array(self._energised)


class Told(NamedTuple):
    """What a contender says of all bubbles; `sd_mm` is NaN where it does not know."""

    height_mm: NDArray[np.float64]
    sd_mm: NDArray[np.float64]
    settled: NDArray[np.bool_]
    faulty: NDArray[np.bool_]


class Contender(ABC):
    """One of those that are compared, on a board of its own."""

    board: Watched

    @property
    def plant(self) -> Plant:
        """The plant on which heights are held."""
        return self.board.plant

    @property
    def rest_mm(self) -> NDArray[np.float64]:
        """Heights without pressure, (n,)."""
        p = self.plant.parameters
        return np.asarray(2e3 * p.radius + (1e3 * p.neck if p.rubber == "real" else 0.0))

    @abstractmethod
    def show(self, heights_mm: NDArray[np.float64]) -> None:
        """Go there, as fast as the valves can."""

    @abstractmethod
    def run(self, seconds: float) -> None:
        """Let time pass."""

    @abstractmethod
    def told(self) -> Told:
        """What it says now."""

    @abstractmethod
    def clear_faults(self) -> None:
        """Begin again with the bubbles that were isolated."""


class Present(Contender):
    """The firmware in this repository, whole, as a script uses it."""

    def __init__(self, sheet: Sheet):
        self.board = Watched(sheet)
        opened = AsyncSkin.open(SimulatedTransport(self.board, f"sim://{BOARD}"), _PATIENCE_S, simulated=self.board)
        self._skin = skin = Skin(run_sync(opened))
        skin.sleep(_TESTED_S)
        if sheet.tables and sheet.trim:
            skin.upload_tables(sheet.tables, anyway=True)
            skin.upload_trim(sheet.trim, anyway=True)
        skin.configure(atmosphere_kpa=sheet.parameters.supply.atmosphere * 1e-3)

    def show(self, heights_mm: NDArray[np.float64]) -> None:
        """See `Contender`."""
        self._skin.show(heights_mm, wait=False)

    def run(self, seconds: float) -> None:
        """See `Contender`."""
        self._skin.sleep(seconds)

    def told(self) -> Told:
        """See `Contender`."""
        state = self._skin.state()
        sd = np.full(len(state.height_mm), np.nan) if state.sd_mm is None else state.sd_mm
        faulty = [bool(faults) or bool(state.board_faults) for faults in state.faults]
        return Told(state.height_mm, sd, np.array(state.status) == "settled", np.array(faulty))

    def clear_faults(self) -> None:
        """See `Contender`."""
        self._skin.clear_faults()


class First(Contender):
    """The law of the first release in the firmware's place, with the same supply and what its own trim could say."""

    def __init__(self, sheet: Sheet):
        self._firmware = _FirstFirmware(sheet)
        self.board = Watched(sheet, self._firmware)
        self.run(_TESTED_S)

    def show(self, heights_mm: NDArray[np.float64]) -> None:
        """See `Contender`."""
        self._firmware.mode = FOLLOW
        self._firmware.law.set_targets(np.rint(1e3 * heights_mm).tolist())

    def run(self, seconds: float) -> None:
        """See `Contender`."""
        self.board.step(seconds)

    def told(self) -> Told:
        """See `Contender`."""
        bubbles = self._firmware.law.bubbles
        height = np.array([bubble.height for bubble in bubbles])
        off = np.abs(height - [bubble.target for bubble in bubbles])
        faulty = np.array([bubble.faulty for bubble in bubbles])
        settled = (off <= self.board.data.SETTLED_UM) & ~faulty
        return Told(1e-3 * height, np.full(len(height), np.nan), settled, faulty)

    def clear_faults(self) -> None:
        """See `Contender`."""
        for bubble in self._firmware.law.bubbles:
            bubble.faulty = False


class _FirstFirmware(Firmware):
    def __init__(self, sheet: Sheet):
        board = boards.load(BOARD)
        self.law = Bubbles(board, _figures(sheet, board))
        self.mode = VENT
        self._supply = Supply(board)
        self._pulses = array("H", [0, board.TICK_US] * board.BUBBLES)

    def tick(self, counts: array, link: bytes) -> Outputs:
        """See `Firmware`."""
        supply = self._supply
        supply.sense(counts[-1], self._pulses, 0)
        self.law.step(counts, supply.metering_pa, self.mode)
        self._pulses = array("H", self.law.pulses())
        return Outputs(self._pulses, supply.pump, bool(supply.dump), b"")

    def listen(self, link: bytes, phase_us: int) -> Outputs:
        """Nobody speaks to it."""
        return Outputs(self._pulses, self._supply.pump, bool(self._supply.dump), b"")

    def reset(self) -> None:
        """Its power does not fail."""

    def close(self) -> None:
        """Nothing to end."""


def _figures(sheet: Sheet, board: Any) -> list[Figures]:
    """What its trim could say: dead times and flow of both valves as one."""
    if sheet.tables is None or sheet.trim is None:
        knots = _knots(build_table(YeohBalloon()))
        nominal = Figures(board.SENSOR_ZERO, board.VALVE_OPENS_US, board.VALVE_CLOSES_US, flow_gain(board), knots)
        return [nominal] * board.BUBBLES
    trim = sheet.trim
    fill = np.array([trim.opens_us, trim.closes_us, trim.flow_gain])
    vent = np.array([trim.vent_opens_us, trim.vent_closes_us, trim.vent_flow_gain])
    opens, closes, flow = (fill + vent) / 2
    rows = zip(trim.zero, opens, closes, flow, map(_knots, sheet.tables), strict=True)
    return [Figures(*row) for row in rows]


def _knots(table: Table) -> list[tuple[float, float]]:
    return list(zip(table.height_um.tolist(), table.pressure_pa.tolist(), strict=True))


CONTENDERS = {PRESENT: Present, FIRST: First}
