"""What a script holds: one wristband, real or simulated. `AsyncSkin` does the work, `Skin` runs it without an event loop."""

import asyncio
import contextlib
from collections.abc import AsyncGenerator, Iterator, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Self

import numpy as np

from bubble_protocol import messages
from bubbleskin import safety
from bubbleskin.errors import DeviceFault, DeviceRefused, InvalidInput, LinkError
from bubbleskin.layout import Layout
from bubbleskin.link.session import Link, drive
from bubbleskin.link.transport import Transport
from bubbleskin.link.wire import crc32
from bubbleskin.records import Health, Info, State, TickHistogram
from bubbleskin.shape.heightfield import Heights, sample

if TYPE_CHECKING:
    from bubbleskin.physics.calibration import Calibration
    from bubbleskin.physics.table import Table
    from bubbleskin.sim.board import SimulatedBoard

SETTLE = 3.0
"""Seconds beyond `over` after which `show` gives up waiting; the valves need about half of one."""

_POLL = 0.02
_KNOTS_PER_MESSAGE = 48
OVER_MAX = 60.0


class AsyncSkin:
    """A wristband, for asyncio; made by `bubbleskin.aconnect`. Methods and attributes as of `Skin`."""

    def __init__(self, link: Link, info: Info, layout: Layout, simulated: "SimulatedBoard | None" = None):
        self._link = link
        self.info = info
        self.layout = layout
        self.simulated = simulated
        self._telemetry = 0  # number of the newest telemetry iterator

    @classmethod
    async def open(
        cls,
        transport: Transport,
        timeout: float,
        *,
        event_loop: bool = False,
        simulated: "SimulatedBoard | None" = None,
    ) -> Self:
        """Greet the device at the other end of `transport`."""
        link = Link(transport, timeout, event_loop=event_loop)
        try:
            info = Info.of(await link.hello())
            return cls(link, info, Layout.of_board(info.board, info.bubbles), simulated)
        except BaseException:
            await link.close()
            raise

    async def show(self, heights_mm: Heights, over: float = 0.0, wait: bool = True) -> State | None:
        """See `Skin.show`."""
        heights = sample(heights_mm, self.layout, self.info.height_max_mm)
        if not 0.0 <= over <= OVER_MAX:
            raise InvalidInput(f"over is {over} s; a change may take 0 to {OVER_MAX:g} s.")
        micrometres = np.rint(heights * 1000).astype(int).tolist()
        await self._link.call("SHOW", (round(over * 1000),), [(height,) for height in micrometres])
        if not wait:
            return None
        return await self._settle(over + SETTLE)

    async def _settle(self, patience: float) -> State:
        deadline = self._link.transport.now() + patience
        while True:
            state = await self.state()
            ill = [bubble for bubble, faults in enumerate(state.faults) if faults]
            if ill:
                what = "; ".join(f"bubble {bubble}: {', '.join(state.faults[bubble])}" for bubble in ill)
                raise DeviceFault(f"The wristband reports faults ({what}). Mend the cause, then `clear_faults()`.")
            if state.mode != "active":
                faults = ", ".join((await self.health()).board_faults)
                why = f"faults of the board: {faults}." if faults else "it was stopped or vented."
                raise DeviceFault(f"The wristband is {state.mode} in the middle of a show: {why}")
            if state.settled:
                return state
            if self._link.transport.now() >= deadline:
                late = state.unsettled
                where = ", ".join(f"{state.height_mm[b]:.2f} instead of {state.target_mm[b]:.2f} mm" for b in late)
                raise DeviceFault(
                    f"{self.layout.names(late).capitalize()} did not settle within {patience:g} s: at {where}. "
                    "Check the supply pressure in `health()`, leaks and kinked tubes."
                )
            await self.sleep(_POLL)

    async def state(self) -> State:
        """See `Skin.state`."""
        return State.of(await self._link.call("STATE"), self.info.tick)

    async def health(self) -> Health:
        """See `Skin.health`."""
        return Health.of(await self._link.call("INFO"), self.info.tick)

    async def tick_histogram(self) -> TickHistogram:
        """See `Skin.tick_histogram`."""
        return TickHistogram.of(await self._link.call("TICKS"))

    async def restart(self, into: str = "firmware") -> None:
        """See `Skin.restart`."""
        numbers = {name: number for number, name, _ in messages.RESTARTS}
        if into not in numbers:
            raise InvalidInput(f"A wristband cannot restart into {into!r}; choose one of {', '.join(numbers)}.")
        await self._link.call("RESTART", (numbers[into],))

    async def telemetry(self, rate_hz: float = 20) -> AsyncGenerator[State]:
        """See `Skin.telemetry`."""
        highest = 1 / self.info.tick
        if not 0 < rate_hz <= highest:
            raise InvalidInput(
                f"rate_hz is {rate_hz}; telemetry comes more than 0 and up to {highest:g} times a second."
            )
        period = max(1, round(highest / rate_hz))
        link = self._link
        self._telemetry = mine = self._telemetry + 1
        link.telemetry.clear()
        patience = period * self.info.tick + link.timeout
        try:
            await link.call("SUBSCRIBE", (period,))
            while True:
                await link.wait(
                    link.transport.now() + patience, lambda: bool(link.telemetry) or mine != self._telemetry
                )
                if mine != self._telemetry:
                    return
                if link.telemetry:
                    yield State.of(link.telemetry.popleft(), self.info.tick)
                else:
                    await link.call("SUBSCRIBE", (period,))  # forgotten there, or nobody is there: then this says so
        except (GeneratorExit, asyncio.CancelledError):
            if mine == self._telemetry:
                with contextlib.suppress(LinkError):
                    await link.call("SUBSCRIBE", (0,))
            raise

    async def stop(self) -> None:
        """See `Skin.stop`."""
        await self._link.call("STOP")

    async def vent(self) -> None:
        """See `Skin.vent`."""
        await self._link.call("VENT")

    async def faults(self) -> dict[int, tuple[str, ...]]:
        """See `Skin.faults`."""
        state = await self.state()
        return {bubble: faults for bubble, faults in enumerate(state.faults) if faults}

    async def clear_faults(self) -> None:
        """See `Skin.clear_faults`."""
        await self._link.call("CLEAR")

    async def fault_log(self) -> list[safety.Fault]:
        """See `Skin.fault_log`."""
        found: list[safety.Fault] = []
        while True:
            reply = await self._link.call("FAULTS_READ", (found[-1].id if found else 0,))
            more = safety.entries(reply, self.info.tick)
            found += more
            if not more or found[-1].id == reply["newest"]:
                return found

    async def acknowledge(self, fault: "safety.Fault | int") -> None:
        """See `Skin.acknowledge`."""
        await self._link.call("FAULTS_ACK", (fault.id if isinstance(fault, safety.Fault) else fault,))

    async def settings(self) -> dict[str, safety.Setting]:
        """See `Skin.settings`."""
        return safety.settings(await self._link.call("SETTING_READ"))

    async def configure(self, **wanted: float) -> None:
        """See `Skin.configure`."""
        rows = safety.changes(wanted, await self.settings())
        if rows:
            await self._link.call("SETTING_WRITE", (), rows)

    async def upload_tables(self, tables: "Sequence[Table] | Table | Calibration") -> None:
        """See `Skin.upload_tables`."""
        from bubbleskin.physics.calibration import Calibration

        n = self.info.bubbles
        if isinstance(tables, Calibration):
            if tables.board != self.info.board:
                raise InvalidInput(f"The calibration is of a {tables.board}; this is a {self.info.board}.")
            tables = tables.tables
        each = list(tables) if isinstance(tables, Sequence) else [tables] * n
        if len(each) != n:
            raise InvalidInput(f"{len(each)} tables for {n} bubbles: give one per bubble, or one for all.")
        data = [table.to_bytes() for table in each]
        for bubble, table in enumerate(data):
            knots = np.frombuffer(table, "<u2").reshape(-1, 2).tolist()
            for first in range(0, len(knots), _KNOTS_PER_MESSAGE):
                part = knots[first : first + _KNOTS_PER_MESSAGE]
                await self._link.call("TABLE_WRITE", (bubble, first, len(knots)), part)
        crc = crc32(b"".join(data))
        reply = await self._link.call("TABLE_COMMIT", (crc,))
        if reply["tables_crc"] != crc:
            raise DeviceRefused("The wristband uses other tables than were sent. Upload them again.")

    async def read_tables(self) -> "list[Table]":
        """See `Skin.read_tables`."""
        from bubbleskin.physics.table import Table

        tables = []
        for bubble in range(self.info.bubbles):
            knots: list[list[int]] = []
            total = 1
            while len(knots) < total:
                part = await self._link.call("TABLE_READ", (bubble, len(knots)))
                total = part["total"]
                knots += np.column_stack([part.columns["knot_um"], part.columns["knot_pa"]]).tolist()
            tables.append(Table(*np.array(knots).T))
        return tables

    async def sleep(self, seconds: float) -> None:
        """See `Skin.sleep`."""
        await self._link.wait(self._link.transport.now() + seconds)

    async def aclose(self) -> None:
        """Let go of the device. Without a host it holds what moves after 250 ms and vents after 1 s, see `settings`."""
        await self._link.close()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.aclose()


class Skin:
    """A wristband, real or simulated; made by `bubbleskin.connect`.

    Every method raises `LinkError` when the device cannot be reached (`DeviceSilent` when it does not answer
    in time), `DeviceRefused` when it refuses, and `InvalidInput` before a byte is sent when what is asked
    cannot be meant. Use it in a `with` block to let go of the device at the end.
    """

    def __init__(self, skin: AsyncSkin):
        self._skin = skin

    @property
    def info(self) -> Info:
        """Who the device is: board, firmware, limits."""
        return self._skin.info

    @property
    def layout(self) -> Layout:
        """Where its bubbles are."""
        return self._skin.layout

    @property
    def simulated(self) -> "SimulatedBoard | None":
        """The simulated board behind this skin, with its true heights and its faults; None for a real one."""
        return self._skin.simulated

    def show(self, heights_mm: Heights, over: float = 0.0, wait: bool = True) -> State | None:
        """Take a shape.

        `heights_mm`: one height per bubble (n,), a 2-D heightfield stretched over the layout, or f(x_mm, y_mm).
        Heights from 0 to `info.height_max_mm`; up to `info.height_rest_mm` means no pressure. `over`: seconds
        the change should take, 0 as fast as the valves can. With `wait`, returns the state once every bubble
        has settled and raises `DeviceFault` if one does not; otherwise returns None at once.
        """
        return drive(self._skin.show(heights_mm, over, wait))

    def state(self) -> State:
        """Heights, pressures, targets and status of all bubbles, now."""
        return drive(self._skin.state())

    def health(self) -> Health:
        """Counters since boot, free heap, supply pressure, faults of the board, outcome of the self-test."""
        return drive(self._skin.health())

    def tick_histogram(self) -> TickHistogram:
        """How long the device's ticks took and how late they began, since boot."""
        return drive(self._skin.tick_histogram())

    def restart(self, into: str = "firmware") -> None:
        """Vent and start again, into the `firmware`, the `boot_loader` or MicroPython's `prompt`; then connect anew."""
        drive(self._skin.restart(into))

    def telemetry(self, rate_hz: float = 20) -> Iterator[State]:
        """States as the device sends them, without end; close the iterator or leave the loop to end it.

        There is one telemetry at a time: a new one ends the one before it.
        """
        states = self._skin.telemetry(rate_hz)
        try:
            while True:
                yield drive(_next(states))
        except StopAsyncIteration:
            pass
        finally:
            drive(states.aclose())

    def stop(self) -> None:
        """Close all valves and keep the air, until the next `show`."""
        drive(self._skin.stop())

    def vent(self) -> None:
        """Open all vent valves, until the next `show`."""
        drive(self._skin.vent())

    def faults(self) -> dict[int, tuple[str, ...]]:
        """The faults of every bubble that has some."""
        return drive(self._skin.faults())

    def clear_faults(self) -> None:
        """Acknowledge all faults, the board's too: they are forgotten; what still is wrong faults again."""
        drive(self._skin.clear_faults())

    def fault_log(self) -> list[safety.Fault]:
        """What has gone wrong since the wristband's start, oldest first: the last 16 entries, with ids and times.

        It also has what is no fault of `faults()`: `host_silent`, when a deadman's stage was reached.
        """
        return drive(self._skin.fault_log())

    def acknowledge(self, fault: safety.Fault | int) -> None:
        """Acknowledge faults up to this entry of `fault_log`, or its id; what has come since stays."""
        drive(self._skin.acknowledge(fault))

    def settings(self) -> dict[str, safety.Setting]:
        """What can be set: deadman_hold, deadman_vent (s), budget_kpa_s; values in use and this wristband's limits."""
        return drive(self._skin.settings())

    def configure(self, **wanted: float) -> None:
        """Change settings, all or none: `configure(deadman_vent=5.0)`. `InvalidInput` beyond the wristband's limits."""
        drive(self._skin.configure(**wanted))

    def upload_tables(self, tables: "Sequence[Table] | Table | Calibration") -> None:
        """Use other height to pressure tables, until the device restarts; all or none are taken.

        `tables`: one per bubble in layout order, one for all, or a calibration of this kind of board.
        """
        drive(self._skin.upload_tables(tables))

    def read_tables(self) -> "list[Table]":
        """The tables in use, one per bubble."""
        return drive(self._skin.read_tables())

    def sleep(self, seconds: float) -> None:
        """Wait on the device's clock: virtual time on a simulated board, real time on a real one."""
        drive(self._skin.sleep(seconds))

    def close(self) -> None:
        """Let go of the device. Without a host it holds what moves after 250 ms and vents after 1 s, see `settings`."""
        drive(self._skin.aclose())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


async def _next(states: AsyncGenerator[State]) -> State:
    return await anext(states)
