"""What a script holds: one wristband, real or simulated. `AsyncSkin` does the work, `Skin` runs it without an event loop."""

import os
from collections.abc import AsyncGenerator, Iterable, Iterator, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Self

import numpy as np

from bubble_protocol.schema import sequences, system
from bubbleskin.device import safety
from bubbleskin.device.layout import find_layout
from bubbleskin.device.records import Health, Info, State, TickHistogram
from bubbleskin.device.stored import StoreInfo, Trim
from bubbleskin.errors import DeviceFault, DeviceRefused, InvalidInput
from bubbleskin.layout import Layout
from bubbleskin.link.clock import Clock
from bubbleskin.link.link import Link, run_sync
from bubbleskin.link.message import Message, crc32
from bubbleskin.link.synchronise import PINGS, ping
from bubbleskin.link.transport import Transport
from bubbleskin.sequence.model import Playable
from bubbleskin.sequence.player import Played, Player, Playing, Progress
from bubbleskin.shape.heightfield import Heights, sample
from bubbleskin.telemetry.recording import Recording
from bubbleskin.telemetry.stream import Telemetry

if TYPE_CHECKING:
    from bubbleskin.membrane.calibration import Calibration
    from bubbleskin.membrane.table import Table
    from bubbleskin.sim.board import SimulatedBoard

SETTLE = 3.0
"""Seconds beyond `over` after which `show` gives up waiting; the valves need about half of one."""

UNASKED_END = "it was stopped or vented, or its host was silent for too long; see `fault_log()`."
"""Why a wristband without a fault does no longer what it was asked to."""

_POLL = 0.02
_CLOCK_AGE = 1.0
"""Seconds after which the clock wants new pings."""
_KNOTS_PER_MESSAGE = 48
_TOGETHER = 8
OVER_MAX = 60.0


class AsyncSkin:
    """A wristband, for asyncio; made by `bubbleskin.aconnect`. Methods and attributes as of `Skin`."""

    def __init__(self, link: Link, info: Info, layout: Layout, simulated: "SimulatedBoard | None" = None):
        self._link = link
        self.info = info
        self.layout = layout
        self.simulated = simulated
        link.on_open = self._opened
        self._player = Player(link, info, layout)
        self._telemetry = Telemetry(link, info)
        self.clock = Clock(info.tick, link.transport.now)
        """The device's time, from the pings so far; `synchronise` sends some."""
        link.on_ping = self.clock.hear

    @classmethod
    async def open(
        cls,
        transport: Transport,
        timeout: float,
        *,
        event_loop: bool = False,
        simulated: "SimulatedBoard | None" = None,
        layout: Layout | None = None,
    ) -> Self:
        """Greet the device at the other end of `transport`; `layout`: instead of the one that it tells."""
        link = Link(transport, timeout, event_loop=event_loop)
        try:
            hello = await link.hello()
            return cls(link, Info.of(hello), await find_layout(link, hello, layout), simulated)
        except BaseException:
            await link.close()
            raise

    def _opened(self, reply: Message) -> None:
        """A new session: the device may have restarted, with other tables or firmware."""
        self.info = Info.of(reply)
        self._telemetry.opened()

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
                why = f"faults of the board: {faults}." if faults else UNASKED_END
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
        numbers = {name: number for number, name, _ in system.RESTARTS}
        if into not in numbers:
            raise InvalidInput(f"A wristband cannot restart into {into!r}; choose one of {', '.join(numbers)}.")
        await self._link.call("RESTART", (numbers[into],))
        self._link.restart_asked = True
        self._link.open = False  # the next call opens a session with the new boot

    def telemetry(self, rate_hz: float = 20, fields: Iterable[str] | None = None) -> AsyncGenerator[State]:
        """See `Skin.telemetry`."""
        return self._telemetry.states(rate_hz, fields)

    async def record(
        self,
        path: str | os.PathLike[str],
        rate_hz: float = 20,
        seconds: float | None = None,
        fields: Iterable[str] | None = None,
    ) -> Recording:
        """See `Skin.record`."""
        return await self._telemetry.record(path, self.layout, rate_hz, seconds, fields)

    async def synchronise(self, pings: int = PINGS) -> Clock:
        """Send pings at once, for the clock to begin with; returns it."""
        await ping(self._link, self.clock, pings)
        return self.clock

    async def play(
        self, sequence: Playable, at: float | None = None, wait: bool = True, progress: Progress = lambda playing: None
    ) -> Played | None:
        """See `Skin.play`."""
        return await self._player.play(sequence, at, wait, progress)

    async def playing(self) -> Playing:
        """See `Skin.playing`."""
        return await self._player.state()

    async def pause(self) -> None:
        """See `Skin.pause`."""
        await self._player.control(sequences.PAUSE)

    async def resume(self) -> None:
        """See `Skin.resume`."""
        await self._player.control(sequences.RESUME)

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

    async def upload_tables(self, tables: "Sequence[Table] | Table | Calibration", save: bool = False) -> None:
        """See `Skin.upload_tables`."""
        from bubbleskin.membrane.calibration import Calibration

        n = self.info.bubbles
        if isinstance(tables, Calibration):
            if tables.board != self.info.board:
                raise InvalidInput(f"The calibration is of a {tables.board}; this is a {self.info.board}.")
            tables = tables.tables
        each = list(tables) if isinstance(tables, Sequence) else [tables] * n
        if len(each) != n:
            raise InvalidInput(f"{len(each)} tables for {n} bubbles: give one per bubble, or one for all.")
        data = [table.to_bytes() for table in each]
        parts = []
        for bubble, table in enumerate(data):
            knots = np.frombuffer(table, "<u2").reshape(-1, 2).tolist()
            for first in range(0, len(knots), _KNOTS_PER_MESSAGE):
                part = knots[first : first + _KNOTS_PER_MESSAGE]
                parts.append(("TABLE_WRITE", (bubble, first, len(knots)), part))
        for first in range(0, len(parts), _TOGETHER):  # each has as long as any other call
            await self._link.calls(parts[first : first + _TOGETHER])
        crc = crc32(b"".join(data))
        reply = await self._link.call("TABLE_COMMIT", (crc,))
        if reply["tables_crc"] != crc:
            raise DeviceRefused("The wristband uses other tables than were sent. Upload them again.")
        if save:
            await self.save()

    async def figures(self) -> Trim:
        """See `Skin.figures`."""
        return Trim.of(await self._link.call("TRIM_READ"))

    async def upload_figures(self, figures: Trim, save: bool = False) -> None:
        """See `Skin.upload_figures`."""
        await self._link.call("TRIM_WRITE", (), figures.rows(self.info.bubbles))
        if save:
            await self.save()

    async def save(self) -> StoreInfo:
        """See `Skin.save`."""
        return StoreInfo.of(await self._link.call("STORE_SAVE"))

    async def stored(self) -> StoreInfo:
        """See `Skin.stored`."""
        return StoreInfo.of(await self._link.call("STORE_INFO"))

    async def factory_reset(self) -> StoreInfo:
        """See `Skin.factory_reset`."""
        return StoreInfo.of(await self._link.call("STORE_RESET"))

    async def read_tables(self) -> "list[Table]":
        """See `Skin.read_tables`."""
        from bubbleskin.membrane.table import Table

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
        try:
            await self._telemetry.aclose()
        finally:
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
        return run_sync(self._skin.show(heights_mm, over, wait))

    def state(self) -> State:
        """Heights, pressures, targets and status of all bubbles, now."""
        return run_sync(self._skin.state())

    def health(self) -> Health:
        """Counters since boot, free heap, supply pressure, faults of the board, outcome of the self-test."""
        return run_sync(self._skin.health())

    def tick_histogram(self) -> TickHistogram:
        """How long the device's ticks took and how late they began, since boot."""
        return run_sync(self._skin.tick_histogram())

    def restart(self, into: str = "firmware") -> None:
        """Vent and start again, into the `firmware`, the `boot_loader` or MicroPython's `prompt`.

        Into the firmware, the next call finds the wristband again by itself; `DeviceRestarted` is for restarts nobody asked for.
        """
        run_sync(self._skin.restart(into))

    def telemetry(self, rate_hz: float = 20, fields: Iterable[str] | None = None) -> Iterator[State]:
        """States as the device sends them, without end; close the iterator or leave the loop to end it.

        There is one telemetry at a time: a new one ends the one before it. `fields` chooses what is sent, so that more
        fits through the link: among height, pressure, target, status, faults, setpoint, fill and vent; the supply's
        pressure and the board's faults come with it. None sends what `state` has. `State.lost` counts what was due
        and has not come.
        """
        states = self._skin.telemetry(rate_hz, fields)
        try:
            while True:
                yield run_sync(_next(states))
        except StopAsyncIteration:
            pass
        finally:
            run_sync(states.aclose())

    def play(
        self, sequence: Playable, at: float | None = None, wait: bool = True, progress: Progress = lambda playing: None
    ) -> Played | None:
        """Play a sequence by the device's own clock; it takes over from whatever the bubbles did before.

        `sequence`: a `Sequence`, something that has one (a `Plan`), or the path of a .json or .csv file. It is checked
        against this device before a byte is sent, and again there. `at`: device time in s, as of `state().time`, at
        which to begin; None is now, and a time that has passed is refused. With `wait`, follows it to its end, tells
        `progress` of every step, and returns when each began; raises `DeviceFault` where it does not come to its end:
        stopped, vented, a timeout after which it was not to go on. Without, returns None once it has been started.
        """
        return run_sync(self._skin.play(sequence, at, wait, progress))

    def playing(self) -> Playing:
        """How far the sequence is that was played last, or how it ended."""
        return run_sync(self._skin.playing())

    def pause(self) -> None:
        """Let the sequence and its ramps stand still; the shape of this moment is held."""
        run_sync(self._skin.pause())

    def resume(self) -> None:
        """Go on with a sequence that was paused, from where it was."""
        run_sync(self._skin.resume())

    def record(
        self,
        path: str | os.PathLike[str],
        rate_hz: float = 20,
        seconds: float | None = None,
        fields: Iterable[str] | None = None,
    ) -> Recording:
        """Record telemetry to a .csv or .parquet file: for `seconds`, or while a `with` block runs.

        What comes while the script shows, waits or asks goes to the file; a script that does none of these reads
        nothing. `pandas.read_csv(path, comment="#")` and `pandas.read_parquet(path)` read it: a row per state, a column
        per bubble and quantity. A program that is killed leaves all rows so far, in Parquet's case in
        `NAME.partial.csv`. Parquet needs the extra `bubbleskin[parquet]`.
        """
        return run_sync(self._skin.record(path, rate_hz, seconds, fields))

    def synchronise(self, pings: int = PINGS) -> Clock:
        """Send pings at once and return the clock, which knows the better for them."""
        return run_sync(self._skin.synchronise(pings))

    @property
    def clock(self) -> Clock:
        """The device's clock: `now()`, `at(host_time)`, `offset`, `drift_ppm` and `uncertainty`; pings it if need be."""
        if self._skin.clock.age > _CLOCK_AGE:
            run_sync(self._skin.synchronise())
        return self._skin.clock

    def stop(self) -> None:
        """Close all valves and keep the air, until the next `show` or `play`; ends a sequence."""
        run_sync(self._skin.stop())

    def vent(self) -> None:
        """Open all vent valves, until the next `show`."""
        run_sync(self._skin.vent())

    def faults(self) -> dict[int, tuple[str, ...]]:
        """The faults of every bubble that has some."""
        return run_sync(self._skin.faults())

    def clear_faults(self) -> None:
        """Acknowledge all faults, the board's too: they are forgotten; what still is wrong faults again."""
        run_sync(self._skin.clear_faults())

    def fault_log(self) -> list[safety.Fault]:
        """What has gone wrong since the wristband's start, oldest first: the last 16 entries, with ids and times.

        It also has what is no fault of `faults()`: `host_silent`, when a deadman's stage was reached.
        """
        return run_sync(self._skin.fault_log())

    def acknowledge(self, fault: safety.Fault | int) -> None:
        """Acknowledge faults up to this entry of `fault_log`, or its id; what has come since stays."""
        run_sync(self._skin.acknowledge(fault))

    def settings(self) -> dict[str, safety.Setting]:
        """What can be set: deadman_hold, deadman_vent (s), budget_kpa_s; values in use and this wristband's limits."""
        return run_sync(self._skin.settings())

    def configure(self, **wanted: float) -> None:
        """Change settings, all or none: `configure(deadman_vent=5.0)`. `InvalidInput` beyond the wristband's limits."""
        run_sync(self._skin.configure(**wanted))

    def upload_tables(self, tables: "Sequence[Table] | Table | Calibration", save: bool = False) -> None:
        """Use other height to pressure tables, until the device restarts; all or none are taken.

        `tables`: one per bubble in layout order, one for all, or a calibration of this kind of board. With `save` they are
        kept for good, see there.
        """
        run_sync(self._skin.upload_tables(tables, save))

    def figures(self) -> Trim:
        """What sets each bubble apart besides its table: sensor zero, dead times, flow."""
        return run_sync(self._skin.figures())

    def upload_figures(self, figures: Trim, save: bool = False) -> None:
        """Use other figures, until the device restarts; only while it is vented. With `save` they are kept for good."""
        run_sync(self._skin.upload_figures(figures, save))

    def save(self) -> StoreInfo:
        """Keep the tables, figures and settings in use without power, for every start from now on; returns the store's state.

        Only while vented: writing flash stops the device for some 0.1 s, and it would control nothing. If power fails
        meanwhile, all is as it was before, or all is saved. What is saved already is not written again.
        """
        return run_sync(self._skin.save())

    def stored(self) -> StoreInfo:
        """The state of the store: where what is in use comes from, both slots, wear."""
        return run_sync(self._skin.stored())

    def factory_reset(self) -> StoreInfo:
        """Forget what is stored and use what the firmware was made with; only while vented."""
        return run_sync(self._skin.factory_reset())

    def read_tables(self) -> "list[Table]":
        """The tables in use, one per bubble."""
        return run_sync(self._skin.read_tables())

    def sleep(self, seconds: float) -> None:
        """Wait on the device's clock: virtual time on a simulated board, real time on a real one."""
        run_sync(self._skin.sleep(seconds))

    def close(self) -> None:
        """Let go of the device. Without a host it holds what moves after 250 ms and vents after 1 s, see `settings`."""
        run_sync(self._skin.aclose())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


async def _next(states: AsyncGenerator[State]) -> State:
    return await anext(states)
