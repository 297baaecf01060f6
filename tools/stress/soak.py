"""Send commands over a line that fails, and compare what was applied with what the callers were told.

    python tools/stress/soak.py                    # a million commands
    python tools/stress/soak.py --commands 10000   # fewer

The firmware's end of the link runs here, without control and plant; the line between it and the SDK's link loses 10 %,
doubles 5 % and damages 1 % of all frames, reorders 2 % and resets the device now and then after it has applied
a command and before the answer is read. Each SHOW has a shape of its own, so the journal, which a tap on the
firmware's `show` keeps, says how often and in what order each was applied. Time is virtual.
"""

import argparse
import asyncio
import contextlib
import random
import sys
import time
from array import array
from collections import Counter
from dataclasses import dataclass, field

from bubble_firmware import boards
from bubble_firmware.app import App
from bubble_firmware.hal.base import Hal
from bubbleskin.errors import BubbleskinError, DeviceRefused, DeviceRestarted, LinkError, Overtaken
from bubbleskin.link.link import Link
from bubbleskin.link.transport import Transport
from bubbleskin.sim.impairment import Impairment, LossyTransport

IMPAIRMENT = Impairment(
    drop=0.10, duplicate=0.05, flip=0.005, truncate=0.005, reorder=0.02, split=0.02, stall=0.0005, reset=0.01
)
WORKERS = 12
BASE = 9000
"""SHOW's first two heights are the command's number to this base."""

APPLIED, REFUSED, OVERTAKEN, RESTARTED, UNKNOWN, NOT_SENT = range(6)
OUTCOMES = ("answered", "refused", "overtaken", "restarted, not applied", "outcome unknown", "not sent")


class Device(Hal, Transport):
    """The firmware on a board at rest, and a `Transport` to it. Each boot has a journal."""

    name = "soak"
    blocks = False

    def __init__(self) -> None:
        super().__init__(boards.load("wristband7"))
        self.journals: list[array] = []
        self._ticks = 0
        self._tick_s = self.board.TICK_US * 1e-6
        self.boot_id = 0
        self.reset()

    def reset(self) -> None:
        """Start the firmware anew; what is under way is lost."""
        self.to_device = b""
        self.from_device = bytearray()
        self.boot_id = self.boot_id * 1103515245 + 12345 & 0x3FFFFFFF
        self.app = App(self.board, self)
        self.journals.append(array("i"))
        self._tap(self.journals[-1])

    def _tap(self, journal: array) -> None:
        show = self.app.commands.show

        def tapped(values: array, first: int, over_ms: int) -> None:
            journal.append(values[first] * BASE + values[first + 1])
            show(values, first, over_ms)

        self.app.commands.show = tapped  # type: ignore[method-assign]

    # The transport.

    def read(self, timeout: float) -> bytes:
        until = self.now() + timeout
        while not self.from_device and self.now() < until:
            self.app.server.poll()  # of the tick, this is all that the link is about
            self.app.clock.ticks += 1
            self._ticks += 1
        data = bytes(self.from_device)
        self.from_device.clear()
        return data

    def write(self, data: bytes) -> None:
        self.to_device += data

    def now(self) -> float:
        return self._ticks * self._tick_s

    def close(self) -> None:
        pass

    # The hardware: the link's bytes.

    def receive(self, buffer: bytearray) -> int:
        data, self.to_device = self.to_device[:256], self.to_device[256:]
        buffer[: len(data)] = data
        return len(data)

    def send(self, frame: bytearray, length: int) -> bool:
        if len(self.from_device) + length > 1024:
            return False
        self.from_device += frame[:length]
        return True


@dataclass
class Result:
    """What a soak has found. `problems` is empty where every command was applied as its caller was told."""

    told: bytearray
    journals: list[array]
    virtual: float
    impairments: dict[str, int]
    problems: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        times = Counter[int]()
        for boot, journal in enumerate(self.journals):
            times.update(journal)
            if len(set(journal)) != len(journal):
                self.problems.append(f"boot {boot} has applied a command twice")
            if list(journal) != sorted(journal):
                self.problems.append(f"boot {boot} has applied commands out of order")
        for number, outcome in enumerate(self.told):
            allowed = {APPLIED: (1,), UNKNOWN: (0, 1)}.get(outcome, (0,))
            if times[number] not in allowed:
                self.problems.append(f"{number} was told {OUTCOMES[outcome]} and was applied {times[number]} times")
        if set(times) - set(range(len(self.told))):
            self.problems.append("something was applied that nobody asked for")


def soak(commands: int, seed: int = 0, impairment: Impairment = IMPAIRMENT) -> Result:
    """Send so many commands; see the module."""
    device = Device()
    line = LossyTransport(device, impairment, seed=seed, reset=device.reset)
    chance = random.Random(seed)
    told = bytearray(commands)
    numbers = iter(range(commands))

    async def work(link: Link) -> None:
        for number in numbers:
            told[number] = await show(link, number)

    async def show(link: Link, number: int) -> int:
        heights = [(number // BASE,), (number % BASE,), *[(6000,)] * 5]
        try:
            await link.call("SHOW", (0,), heights)
        except Overtaken:
            return OVERTAKEN
        except DeviceRefused:
            return REFUSED
        except LinkError as error:
            if error.outcome_unknown:
                return UNKNOWN
            return RESTARTED if isinstance(error, DeviceRestarted) else NOT_SENT
        return APPLIED

    async def alarm(link: Link) -> None:
        while True:
            until = device.now() + chance.expovariate(0.2)
            await link.wait(until)
            with contextlib.suppress(BubbleskinError):
                await link.call(chance.choice(["STOP", "VENT"]))

    async def run() -> None:
        link = Link(line, 2.0, event_loop=True)
        alarms = asyncio.create_task(alarm(link))
        await asyncio.gather(*(work(link) for _ in range(WORKERS)))
        alarms.cancel()
        await asyncio.gather(alarms, return_exceptions=True)
        line.on = False
        await link.call("STATE")  # it still answers

    asyncio.run(run())
    return Result(told, device.journals, device.now(), line.counts)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--commands", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    begin = time.monotonic()
    result = soak(options.commands, options.seed)
    print(f"{options.commands} commands in {time.monotonic() - begin:.0f} s, {result.virtual:.0f} s of virtual time")
    for outcome, name in enumerate(OUTCOMES):
        print(f"  {result.told.count(outcome):8} {name}")
    print(f"  {sum(map(len, result.journals)):8} applied, in {len(result.journals)} boots")
    print("impairments of the line: " + ", ".join(f"{count} × {name}" for name, count in result.impairments.items()))
    print(*result.problems[:20] or ["every command was applied as its caller was told"], sep="\n")
    sys.exit(bool(result.problems))


if __name__ == "__main__":
    main()
