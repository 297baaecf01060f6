"""One wristband, real or simulated, for asyncio. It does the work; `Skin` runs it without an event loop."""

import asyncio
import contextlib
import os
from collections.abc import AsyncGenerator, Iterable, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Literal, NoReturn, Self, overload

from bubble_protocol.schema import injection, sequences, system
from bubbleskin import checks
from bubbleskin.device import tables as device_tables
from bubbleskin.device import trim as device_trim
from bubbleskin.device.faults import Fault, acknowledged, read_log
from bubbleskin.device.health import Health, TickHistogram
from bubbleskin.device.info import Info
from bubbleskin.device.layout import find_layout
from bubbleskin.device.settings import Setting, changes, settings_of
from bubbleskin.device.state import State
from bubbleskin.device.store import StoreInfo
from bubbleskin.device.trim import Trim
from bubbleskin.errors import InvalidInput, LinkError
from bubbleskin.layout import Layout
from bubbleskin.link.clock import PINGS, Clock
from bubbleskin.link.link import Link
from bubbleskin.link.message import Message
from bubbleskin.link.transport import Transport
from bubbleskin.sequence.model import Playable, refuse_chance
from bubbleskin.sequence.playback import At, PlaybackReport, PlaybackStatus, Told
from bubbleskin.sequence.player import Player
from bubbleskin.shape.heightfield import Heights, sample
from bubbleskin.surface.shows import Shows
from bubbleskin.telemetry.recording import Recording
from bubbleskin.telemetry.stream import Telemetry

if TYPE_CHECKING:
    from bubbleskin.calibrate.measure import Progress as CalibrateProgress
    from bubbleskin.calibrate.result import SelfCalibration
    from bubbleskin.membrane.calibration import Calibration
    from bubbleskin.membrane.table import Table
    from bubbleskin.sim.board import Simulated

OVER_MAX = 60.0
"""Seconds that a change of shape may take at most."""

PINGS_MAX = 10_000
"""PINGs that one call of `synchronise` sends at most: a minute of them."""


class AsyncSkin:
    """A wristband, for asyncio; made by `bubbleskin.aconnect`. Methods and attributes as of `Skin`."""

    def __init__(self, link: Link, info: Info, layout: Layout, simulated: "Simulated | None" = None):
        self.link = link
        """Requests and replies, for those who measure or test them; a script has no need of it."""
        self.info = info
        self.layout = layout
        self.simulated = simulated
        link.on_open = self._opened
        self._player = Player(link, info, layout)
        self._shows = Shows(link, info, layout, self._player, touch=simulated is None or simulated.contact)
        self._telemetry = Telemetry(link, info, self._shows.tell)
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
        simulated: "Simulated | None" = None,
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
        self._shows.opened(self.info)
        self._telemetry.opened()

    @overload
    async def show(
        self,
        heights_mm: Heights,
        over: float = 0.0,
        wait: Literal[True] = True,
        plan: bool = True,
        *,
        fill: str | None = None,
    ) -> State: ...
    @overload
    async def show(
        self,
        heights_mm: Heights,
        over: float = 0.0,
        *,
        wait: Literal[False],
        plan: bool = True,
        fill: str | None = None,
    ) -> None: ...
    @overload
    async def show(
        self, heights_mm: Heights, over: float, wait: Literal[False], plan: bool = True, *, fill: str | None = None
    ) -> None: ...
    @overload
    async def show(
        self, heights_mm: Heights, over: float = 0.0, wait: bool = True, plan: bool = True, *, fill: str | None = None
    ) -> State | None: ...
    async def show(
        self, heights_mm: Heights, over: float = 0.0, wait: bool = True, plan: bool = True, *, fill: str | None = None
    ) -> State | None:
        """See `Skin.show`."""
        heights = sample(heights_mm, self.layout, self.info.height_max_mm, fill)
        over = checks.number("over", over, 0.0, OVER_MAX, "s")
        checks.flag("wait", wait)
        checks.flag("plan", plan)
        return await self._shows.show(heights, over, wait, plan)

    async def state(self) -> State:
        """See `Skin.state`."""
        return await self._shows.look()

    async def health(self) -> Health:
        """See `Skin.health`."""
        return Health.of(await self.link.call("INFO"), self.info.tick)

    async def tick_histogram(self) -> TickHistogram:
        """See `Skin.tick_histogram`."""
        return TickHistogram.of(await self.link.call("TICKS"))

    async def restart(self, into: str = "firmware") -> None:
        """See `Skin.restart`."""
        numbers = {name: number for number, name, _ in system.RESTARTS}
        checks.one_of("into", into, tuple(numbers))
        await self.link.call("RESTART", (numbers[into],))
        self.link.restart_asked = True
        self.link.open = False  # the next call opens a session with the new boot

    def telemetry(self, rate_hz: float = 20, fields: Iterable[str] | None = None) -> AsyncGenerator[State]:
        """See `Skin.telemetry`."""
        return self._telemetry.states(rate_hz, fields)

    async def record(
        self,
        path: str | os.PathLike[str],
        rate_hz: float = 20,
        seconds: float | None = None,
        fields: Iterable[str] | None = None,
        *,
        full: bool = False,
    ) -> Recording:
        """See `Skin.record`."""
        if checks.flag("full", full):
            if rate_hz != 20 or fields is not None:
                raise InvalidInput(
                    "A full recording holds every tick and all that is sent; leave out rate_hz and fields."
                )
            return await self._record_all(path, seconds)
        return await self._telemetry.record(path, self.layout, rate_hz, seconds, fields)

    async def _record_all(self, path: str | os.PathLike[str], seconds: float | None) -> Recording:
        if seconds is not None:
            seconds = checks.above_zero("seconds", seconds, unit="s")
        if self.simulated is None:
            raise InvalidInput(
                f"{self.link.transport.name} cannot be recorded in full: sensor counts of every tick are more than its wire "
                f"carries, and without them nothing can be replayed. Record its telemetry, rate_hz={1 / self.info.tick:g} at "
                "most, without full; or do the same on sim:// or micropython://, and record that in full."
            )
        recording = Recording(self.simulated.record(path))
        if seconds is not None:
            try:
                await self.sleep(seconds)
            finally:
                await recording.aclose()
        return recording

    async def synchronise(self, pings: int = PINGS) -> Clock:
        """Send pings at once, for the clock to begin with; returns it."""
        await self.link.send_pings(checks.whole("pings", pings, 1, PINGS_MAX))
        return self.clock

    @overload
    async def play(
        self, sequence: Playable, at: At = None, wait: Literal[True] = True, progress: Told = None, anyway: bool = False
    ) -> PlaybackReport: ...
    @overload
    async def play(
        self, sequence: Playable, at: At = None, *, wait: Literal[False], progress: Told = None, anyway: bool = False
    ) -> None: ...
    @overload
    async def play(
        self, sequence: Playable, at: At, wait: Literal[False], progress: Told = None, anyway: bool = False
    ) -> None: ...
    @overload
    async def play(
        self, sequence: Playable, at: At = None, wait: bool = True, progress: Told = None, anyway: bool = False
    ) -> PlaybackReport | None: ...
    async def play(
        self, sequence: Playable, at: At = None, wait: bool = True, progress: Told = None, anyway: bool = False
    ) -> PlaybackReport | None:
        """See `Skin.play`."""
        checks.flag("wait", wait)
        checks.flag("anyway", anyway)
        if progress is not None and not callable(progress):
            raise InvalidInput(f"progress is {checks.shown(progress)}; give a function of one PlaybackStatus, or None.")
        if not anyway:
            refuse_chance(sequence)
        meant = self._player.sequence_of(sequence)
        if not anyway:
            meant = await self._shows.bounded(meant)
        try:
            started = await self._player.start(meant, at, follow=wait)
            return await self._player.follow(started, progress) if wait else None
        except (asyncio.CancelledError, KeyboardInterrupt):  # nobody follows it any more
            with contextlib.suppress(LinkError):
                await self.stop()
            raise

    async def playing(self) -> PlaybackStatus:
        """See `Skin.playing`."""
        return await self._player.status()

    async def pause(self) -> None:
        """See `Skin.pause`."""
        await self._player.control(sequences.PAUSE)

    async def resume(self) -> None:
        """See `Skin.resume`."""
        await self._player.control(sequences.RESUME)

    async def stop(self) -> None:
        """See `Skin.stop`."""
        self._shows.unasked()
        await self.link.call("STOP")

    async def vent(self) -> None:
        """See `Skin.vent`."""
        self._shows.unasked()
        await self.link.call("VENT")

    async def faults(self) -> dict[int, tuple[str, ...]]:
        """See `Skin.faults`."""
        state = await self.state()
        return {bubble: faults for bubble, faults in enumerate(state.faults) if faults}

    async def clear_faults(self) -> None:
        """See `Skin.clear_faults`."""
        await self.sleep(await acknowledged(self.link, self.info.tick, "CLEAR"))

    async def fault_log(self) -> list[Fault]:
        """See `Skin.fault_log`."""
        return await read_log(self.link, self.info.tick)

    async def acknowledge(self, fault: Fault | int) -> None:
        """See `Skin.acknowledge`."""
        number = fault.id if isinstance(fault, Fault) else checks.whole("The id of a fault", fault, 0, 0xFFFF)
        await self.sleep(await acknowledged(self.link, self.info.tick, "FAULTS_ACK", (number,)))

    async def inject(self, part: str, number: int, how: str) -> None:
        """See `Skin.inject`."""
        if self.simulated is not None:
            self.simulated.inject(part, number, checks.text("how", how))
            return
        from bubbleskin.sim.failures import on_board

        for request in on_board(part, number, how, self.info.bubbles):
            await self.link.call("INJECT", request)

    async def permit_injection(self, on: bool = True) -> None:
        """See `Skin.permit_injection`."""
        await self.link.call("INJECT", (injection.INJECTION, 0, int(checks.flag("on", on))))

    async def settings(self) -> dict[str, Setting]:
        """See `Skin.settings`."""
        return settings_of(await self.link.call("SETTING_READ"))

    async def configure(self, **wanted: float) -> None:
        """See `Skin.configure`."""
        rows = changes(wanted, await self.settings())
        if rows:
            await self.link.call("SETTING_WRITE", (), rows)

    async def upload_tables(
        self, tables: "Sequence[Table] | Table | Calibration", save: bool = False, *, anyway: bool = False
    ) -> None:
        """See `Skin.upload_tables`."""
        checks.flag("save", save)
        checks.flag("anyway", anyway)
        each = device_tables.one_per_bubble(tables, self.info)
        if not anyway:
            device_tables.check(each, self.info)
        await device_tables.upload(self.link, each)
        if save:
            await self.save()

    async def trim(self) -> Trim:
        """See `Skin.trim`."""
        return await device_trim.read(self.link, self.info)

    async def upload_trim(self, trim: Trim, save: bool = False, *, anyway: bool = False) -> None:
        """See `Skin.upload_trim`."""
        checks.instance("trim", trim, Trim, "a Trim, such as dataclasses.replace(skin.trim(), zero=…)")
        checks.flag("save", save)
        checks.flag("anyway", anyway)
        await device_trim.write(self.link, self.info, trim, anyway)
        if save:
            await self.save()

    async def calibrate(
        self,
        bubbles: Iterable[int] | int | None = None,
        *,
        save: bool = True,
        board: str | os.PathLike[str] | None = None,
        progress: "CalibrateProgress | None" = None,
        upload: bool = True,
    ) -> "SelfCalibration":
        """See `Skin.calibrate`."""
        from bubbleskin.calibrate import session

        return await session.calibrate(self, bubbles, save, board, progress, upload)

    async def upload_calibration(self, calibration: "SelfCalibration", save: bool = False) -> None:
        """See `Skin.upload_calibration`."""
        from bubbleskin.calibrate import session

        await session.upload(self, calibration, save)

    async def save(self) -> StoreInfo:
        """See `Skin.save`."""
        return StoreInfo.of(await self.link.call("STORE_SAVE"))

    async def stored(self) -> StoreInfo:
        """See `Skin.stored`."""
        return StoreInfo.of(await self.link.call("STORE_INFO"))

    async def factory_reset(self) -> StoreInfo:
        """See `Skin.factory_reset`."""
        return StoreInfo.of(await self.link.call("STORE_RESET"))

    async def read_tables(self) -> "list[Table]":
        """See `Skin.read_tables`."""
        return await device_tables.read(self.link, self.info.bubbles)

    async def sleep(self, seconds: float) -> None:
        """See `Skin.sleep`."""
        seconds = checks.number("seconds", seconds, 0.0, unit="s")
        await self.link.wait(self.link.transport.now() + seconds)

    async def aclose(self) -> None:
        """Let go of the device. Without a host it holds what moves after 250 ms and vents after 1 s, see `settings`."""
        try:
            await self._telemetry.aclose()
        finally:
            await self.link.close()

    def __reduce__(self) -> NoReturn:
        raise InvalidInput("A skin cannot be sent to another process or copied; connect in that process.")

    def __repr__(self) -> str:
        return describe("AsyncSkin", self.link, self.info)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.aclose()


def describe(kind: str, link: Link, info: Info) -> str:
    """A skin in a line: where it is, how many bubbles it has, whether it is open."""
    board = "" if info.board in link.transport.name else f" {info.board},"
    closed = ", closed" if link.closed else ""
    return f"<{kind} {link.transport.name}:{board} {info.bubbles} bubbles{closed}>"
