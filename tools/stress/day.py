"""A day in the life of a wristband: shows, faults, torn frames and reconnects in virtual time, the firmware in MicroPython.

Everything goes through the SDK. At the end of each virtual hour the wristband is vented and asked for its counters, and
they must be what this end has counted: no tick missed or late, every frame understood but those that were torn on
purpose, no exception, no telemetry lost, every fault there that was injected, and as much free heap as in the first hour.
Ends with exit status 1 at the first thing that is not so.
"""

import argparse
import sys
import time
from dataclasses import dataclass, field

import numpy as np

from bubbleskin import boards
from bubbleskin.async_skin import AsyncSkin
from bubbleskin.errors import BubbleskinError
from bubbleskin.link.link import run_sync
from bubbleskin.sim.board import SimulatedBoard
from bubbleskin.sim.micropython import MicroPythonFirmware
from bubbleskin.sim.plant import Plant, PlantParameters
from bubbleskin.sim.transport import SimulatedTransport
from bubbleskin.skin import Skin

SUBSTEP = 100e-6
"""Twice the simulator's step: a day is long, and the air's last micrometre is not what is looked at here."""
HOUR = 3600.0
WARM = 60.0
"""Seconds of everything before the first counters are taken."""


class Counting(SimulatedTransport):
    """The simulated link, which counts the frames that go each way."""

    sent = 0
    received = 0

    def write(self, data: bytes) -> None:
        """Count the ends of frames; a zero in front only ends what stood on the line."""
        self.sent += data.lstrip(b"\0").count(0)
        super().write(data)

    def read(self, timeout: float) -> bytes:
        """Count what has come."""
        data = super().read(timeout)
        self.received += data.count(0)
        return data


@dataclass
class Day:
    """The wristband, what has been done to it and what it must say of it."""

    board: SimulatedBoard
    link: Counting
    skin: Skin
    rng: np.random.Generator
    torn: int = 0
    done: dict[str, int] = field(default_factory=dict)
    telemetry: int = 0
    lost: int = 0

    def live(self, until: float) -> None:
        """One thing after another, chosen by chance, until virtual time `until`."""
        things = (self.show, self.show, self.show, self.watch, self.fault, self.reconnect, self.stop)
        while self.board.time < until:
            thing = things[self.rng.integers(len(things))]
            self.done[thing.__name__] = self.done.get(thing.__name__, 0) + 1
            thing()

    def show(self) -> None:
        """A random shape, waited for, and kept for a while."""
        heights = self.rng.uniform(5.0, 13.0, self.board.data.BUBBLES)
        self.skin.show(heights, over=float(self.rng.choice([0.0, 0.5, 2.0])))
        self.skin.sleep(float(self.rng.uniform(1.0, 20.0)))

    def watch(self) -> None:
        """Telemetry at some rate, with shows in between."""
        ends = self.board.time + 5.0
        for state in self.skin.telemetry(float(self.rng.choice([5, 20, 50]))):
            self.telemetry += 1
            if self.rng.random() < 0.02:
                self.skin.show(self.rng.uniform(5.0, 13.0, self.board.data.BUBBLES), wait=False)
            if state.time > ends:
                self.lost += state.lost
                break

    def fault(self) -> None:
        """A sensor is torn off in the middle of a shape: the bubble is isolated; mended and cleared, it works again."""
        bubble = int(self.rng.integers(self.board.data.BUBBLES))
        self.skin.show(np.full(self.board.data.BUBBLES, 9.0))
        self.board.inject("sensor_absent", bubble, 1)
        self.skin.sleep(1.0)
        if bubble not in self.skin.faults():
            raise MismatchError(f"bubble {bubble} has no sensor and no fault")
        self.board.inject("sensor_absent", bubble, 0)
        self.skin.vent()
        self.skin.sleep(2.0)
        self.skin.clear_faults()
        self.skin.sleep(0.1)
        if self.skin.faults():
            raise MismatchError(f"mended and cleared, and still there: {self.skin.faults()}")

    def reconnect(self) -> None:
        """The cable is pulled in the middle of a frame, and another program says hello."""
        self.skin.sleep(float(self.rng.uniform(0.0, 3.0)))
        self.link.write(bytes(self.rng.integers(1, 256, int(self.rng.integers(12, 60))).astype(np.uint8)))
        self.link.sent += 1  # ended by the zero of the next hello
        self.torn += 1
        self.board.from_device.clear()
        self.skin = greet(self.link)

    def stop(self) -> None:
        """Stopped, and a while later vented."""
        self.skin.stop()
        self.skin.sleep(float(self.rng.uniform(0.0, 2.0)))
        self.skin.vent()
        self.skin.sleep(float(self.rng.uniform(0.0, 10.0)))

    def check(self, heap: int | None) -> int:
        """The wristband's counters against ours; returns its free heap. `heap`: what it was the last time."""
        self.skin.vent()
        self.skin.sleep(1.0)
        before = round(self.board.time / self.board.tick_s)
        health = self.skin.health()
        ticks = round(health.time / self.board.tick_s)
        said = {
            "ticks counted": (ticks, before),
            "late ticks": (health.late_ticks, 0),
            "exceptions": (health.exceptions, 0),
            "frames good": (health.frames_good, self.link.sent - self.torn),
            "frames bad": (health.frames_bad, self.torn),
            "telemetry dropped": (health.telemetry_dropped, 0),
            "gaps in telemetry": (self.lost, 0),
            "board faults": (len(health.board_faults), 0),
        }
        if heap is not None:
            said["free heap"] = (health.heap_free, heap)
        wrong = [f"{name} {is_}, expected {should}" for name, (is_, should) in said.items() if is_ != should]
        if wrong:
            raise MismatchError("; ".join(wrong))
        return health.heap_free


class MismatchError(Exception):
    """What the wristband says is not what was done to it."""


def greet(link: Counting) -> Skin:
    """A new SDK on the same wristband."""
    return Skin(run_sync(AsyncSkin.open(link, 2.0)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--board", default="wristband7")
    asked = parser.parse_args()
    data = boards.load(asked.board)
    board = SimulatedBoard(asked.board, seed=asked.seed, firmware=MicroPythonFirmware(data, boot_id=asked.seed))
    board.plant = Plant(PlantParameters.nominal(data.BUBBLES), seed=asked.seed, substep=SUBSTEP)
    link = Counting(board, asked.board)
    day = Day(board, link, greet(link), np.random.default_rng(asked.seed))
    began = time.monotonic()
    print(f"{asked.board}, {asked.hours:g} h, seed {asked.seed}", flush=True)
    try:
        day.live(WARM)
        heap = day.check(None)
        hour = 0
        while board.time < asked.hours * HOUR:
            hour += 1
            day.live(min(hour, asked.hours) * HOUR)
            day.check(heap)
            print(
                f"{board.time / HOUR:6.2f} h  {link.sent} frames to it, {link.received} from it, {day.torn} torn, "
                f"{day.telemetry} states, heap {heap} bytes free, {time.monotonic() - began:.0f} s",
                flush=True,
            )
    except (MismatchError, BubbleskinError) as error:
        print(f"{board.time / HOUR:.3f} h: {error}", flush=True)
        sys.exit(1)
    finally:
        board.close()
    done = ", ".join(f"{count} × {name}" for name, count in sorted(day.done.items()))
    print(f"{board.time / HOUR:.1f} h of virtual time, {round(board.time / board.tick_s)} ticks, none missed: {done}.")


if __name__ == "__main__":
    main()
