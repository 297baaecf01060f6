"""What a script holds: one wristband, real or simulated. `AsyncSkin` does the work; this runs it without an event loop."""

import os
from collections.abc import AsyncGenerator, Generator, Iterable, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Literal, NoReturn, Self, overload

from bubbleskin.async_skin import AsyncSkin, describe
from bubbleskin.device.faults import Fault
from bubbleskin.device.health import Health, TickHistogram
from bubbleskin.device.info import Info
from bubbleskin.device.settings import Setting
from bubbleskin.device.state import State
from bubbleskin.device.store import StoreInfo
from bubbleskin.device.trim import Trim
from bubbleskin.errors import InvalidInput
from bubbleskin.layout import Layout
from bubbleskin.link.clock import PINGS, Clock
from bubbleskin.link.link import Link, run_sync
from bubbleskin.pictured import Pictured
from bubbleskin.sequence.model import Playable
from bubbleskin.sequence.playback import At, PlaybackReport, PlaybackStatus, Told
from bubbleskin.shape.heightfield import Heights
from bubbleskin.telemetry.recording import Recording

if TYPE_CHECKING:
    from bubbleskin.calibrate.measure import Progress as CalibrateProgress
    from bubbleskin.calibrate.result import SelfCalibration
    from bubbleskin.membrane.calibration import Calibration
    from bubbleskin.membrane.table import Table
    from bubbleskin.sim.board import Simulated

_CLOCK_AGE = 1.0
"""Seconds after which the clock wants new pings."""


class Skin(Pictured):
    """A wristband, real or simulated; made by `bubbleskin.connect`.

    Every method raises `LinkError` when the device cannot be reached (`DeviceSilent` when it does not answer
    in time), `DeviceRefused` when it refuses, and `InvalidInput` before a byte is sent when what is asked
    cannot be meant. Use it in a `with` block to let go of the device at the end.
    """

    def __init__(self, skin: AsyncSkin):
        self._skin = skin

    @property
    def link(self) -> Link:
        """Requests and replies, for those who measure or test them; a script has no need of it."""
        return self._skin.link

    @property
    def info(self) -> Info:
        """Who the device is: board, firmware, limits."""
        return self._skin.info

    @property
    def layout(self) -> Layout:
        """Where its bubbles are."""
        return self._skin.layout

    @property
    def simulated(self) -> "Simulated | None":
        """The simulated board behind this skin, with its true heights and its faults; None for a real one."""
        return self._skin.simulated

    @overload
    def show(
        self,
        heights_mm: Heights,
        over: float = 0.0,
        wait: Literal[True] = True,
        plan: bool = True,
        *,
        fill: str | None = None,
    ) -> State: ...
    @overload
    def show(
        self,
        heights_mm: Heights,
        over: float = 0.0,
        *,
        wait: Literal[False],
        plan: bool = True,
        fill: str | None = None,
    ) -> None: ...
    @overload
    def show(
        self, heights_mm: Heights, over: float, wait: Literal[False], plan: bool = True, *, fill: str | None = None
    ) -> None: ...
    @overload
    def show(
        self, heights_mm: Heights, over: float = 0.0, wait: bool = True, plan: bool = True, *, fill: str | None = None
    ) -> State | None: ...
    def show(
        self, heights_mm: Heights, over: float = 0.0, wait: bool = True, plan: bool = True, *, fill: str | None = None
    ) -> State | None:
        """Take a shape: heights are the tops of the bubbles, neighbours included.

        `heights_mm`: one height per bubble (n,), a 2-D heightfield stretched over the layout, or f(x_mm, y_mm).
        Heights from 0 to `info.height_max_mm`; up to `info.height_rest_mm` means no pressure. `over`: seconds
        the change should take, 0 as fast as the valves can. With `wait`, returns the state once every bubble
        has settled and raises `DeviceFault` if one does not; otherwise returns None at once. `fill`: 'nearest' gives
        entries of a heightfield that are masked or nan the number of the nearest one; without it they are refused.

        Where neighbours would touch, what is sent makes up for what they do, in several steps where order counts, over 0.4 s
        at least; a shape that cannot be had, or would pass the limit, becomes the nearest that was found, and that is
        logged. Bubbles that may have touched others for 5 s or more go flat first, as only then they are known again.
        A show that does not wait and takes 0.25 s or less is one of a stream: one step, from the shape before.
        `plan=False` sends the heights as they are, each for a bubble by itself: neighbours may then lift one above the limit.
        """
        return run_sync(self._skin.show(heights_mm, over, wait, plan, fill=fill))

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

    def telemetry(self, rate_hz: float = 20, fields: Iterable[str] | None = None) -> Generator[State, None, None]:
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

    @overload
    def play(
        self, sequence: Playable, at: At = None, wait: Literal[True] = True, progress: Told = None, anyway: bool = False
    ) -> PlaybackReport: ...
    @overload
    def play(
        self, sequence: Playable, at: At = None, *, wait: Literal[False], progress: Told = None, anyway: bool = False
    ) -> None: ...
    @overload
    def play(
        self, sequence: Playable, at: At, wait: Literal[False], progress: Told = None, anyway: bool = False
    ) -> None: ...
    @overload
    def play(
        self, sequence: Playable, at: At = None, wait: bool = True, progress: Told = None, anyway: bool = False
    ) -> PlaybackReport | None: ...
    def play(
        self, sequence: Playable, at: At = None, wait: bool = True, progress: Told = None, anyway: bool = False
    ) -> PlaybackReport | None:
        """Play a sequence by the device's own clock; it takes over from whatever the bubbles did before.

        `sequence`: a `Sequence`, something that has one (a `Plan`), the path of a .json or .csv file, or a name of the library
        such as 'pulse'. It is checked
        against this device before a byte is sent, and again there. `at`: device time in s, as of `state().time`, at
        which to begin; None is now, and a time that has passed is refused. With `wait`, follows it to its end, tells
        `progress` of every step, and returns when each began; raises `DeviceFault` where it does not come to its end:
        stopped, vented, a timeout after which it was not to go on. Without, returns None once it has been started.
        A plan that is not sure (`Plan.sure`) is refused unless `anyway`.
        """
        return run_sync(self._skin.play(sequence, at, wait, progress, anyway))

    def playing(self) -> PlaybackStatus:
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
        *,
        full: bool = False,
    ) -> Recording:
        """Record telemetry to a .csv or .parquet file: for `seconds`, or while a `with` block runs.

        What comes while the script shows, waits or asks goes to the file; a script that does none of these reads
        nothing. `pandas.read_csv(path, comment="#")` and `pandas.read_parquet(path)` read it: a row per state, a column
        per bubble and quantity. A program that is killed leaves all rows so far, in Parquet's case in
        `NAME.partial.csv`. Parquet needs the extra `bubbleskin[parquet]`.

        With `full` a simulated board's file, in .jsonl, has every tick: all that has reached the firmware since power
        came, and all that it decided. `bubbleskin.replay` runs a firmware through it. A real board is refused.
        """
        return run_sync(self._skin.record(path, rate_hz, seconds, fields, full=full))

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
        """Acknowledge all faults, the board's too: they are forgotten; what still is wrong faults again.

        A fault isolates for a second at least: this waits until that is over.
        """
        run_sync(self._skin.clear_faults())

    def fault_log(self) -> list[Fault]:
        """What has gone wrong since the wristband's start, oldest first: the last 16 entries, with ids and times.

        It also has what is no fault of `faults()`: `host_silent`, when a deadman's stage was reached.
        """
        return run_sync(self._skin.fault_log())

    def acknowledge(self, fault: Fault | int) -> None:
        """Acknowledge faults up to this entry of `fault_log`, or its id; what has come since stays. Waits as `clear_faults`."""
        run_sync(self._skin.acknowledge(fault))

    def inject(self, part: str, number: int, how: str) -> None:
        """Make a part of the board fail: `inject("sensor", 3, "stuck")`; "healthy" mends it.

        Parts: sensor, fill valve, vent valve, tube, bubble, by the bubble's `number`; supply, pump, link, clock, which have none
        (0). Hows: off, stuck, wrong, noisy, slow, delayed, intermittent, missing; docs/simulator.md says which part can be what.
        Raises `InvalidInput` for others. A real board does to itself what harms nobody, once that is permitted: see
        `permit_injection`.
        """
        run_sync(self._skin.inject(part, number, how))

    def permit_injection(self, on: bool = True) -> None:
        """Let `inject` make parts of a real board fail, until its next start; `False`: mend them, and forbid it again.

        While all is vented only. Sensors, valves, pump and supply fail there in ways that let no air in and keep none.
        """
        run_sync(self._skin.permit_injection(on))

    def settings(self) -> dict[str, Setting]:
        """What can be set: deadman_hold, deadman_vent (s), budget_kpa_s, atmosphere_kpa, rezero_mm; values in use and limits."""
        return run_sync(self._skin.settings())

    def configure(self, **wanted: float) -> None:
        """Change settings, all or none: `configure(deadman_vent=5.0)`. `InvalidInput` beyond the wristband's limits."""
        run_sync(self._skin.configure(**wanted))

    def upload_tables(
        self, tables: "Sequence[Table] | Table | Calibration", save: bool = False, *, anyway: bool = False
    ) -> None:
        """Use other height to pressure tables, until the device restarts; all or none are taken.

        `tables`: one per bubble in layout order, one for all, or a calibration of this kind of board. With `save` they are
        kept for good, see there. Tables that are none of rubber, or contradict each other, are `InvalidInput`; with `anyway`
        only the device's limits of pressure and air hold.
        """
        run_sync(self._skin.upload_tables(tables, save, anyway=anyway))

    def trim(self) -> Trim:
        """What sets each bubble apart besides its table: sensor zero, dead times, flow."""
        return run_sync(self._skin.trim())

    def upload_trim(self, trim: Trim, save: bool = False, *, anyway: bool = False) -> None:
        """Use another trim, until the device restarts; only while it is vented. With `save` it is kept for good.

        Flows of one board's restrictors that contradict each other are `InvalidInput`, but with `anyway`.
        """
        run_sync(self._skin.upload_trim(trim, save, anyway=anyway))

    def calibrate(
        self,
        bubbles: Iterable[int] | int | None = None,
        *,
        save: bool = True,
        board: str | os.PathLike[str] | None = None,
        progress: "CalibrateProgress | None" = None,
        upload: bool = True,
    ) -> "SelfCalibration":
        """Let the wristband measure itself with its own sensors, and use what is found.

        `bubbles`: one, some, or None for all. They rise to 13 mm in groups that do not touch, which takes 20 s for 7 and 40 s
        for 19; nobody may hold or press them. Bubbles that are accepted get a table and a trim of their own; all others keep
        what they have, and the result says why. With `save` it is kept for good; what is saved stays until all of the new is
        there. Without `upload` nothing of the wristband is changed: `upload_calibration` uses the result, or a part of it, later.
        `board`: the file of a board of your own. `progress` is called with a `CalibrationProgress` now and then.
        Raises `LinkError` where the wristband is lost: it then vents, and has what it had.
        """
        return run_sync(self._skin.calibrate(bubbles, save=save, board=board, progress=progress, upload=upload))

    def upload_calibration(self, calibration: "SelfCalibration", save: bool = False) -> None:
        """Use a calibration of this wristband, such as one from a file; only while it is vented. `save` as in `calibrate`."""
        run_sync(self._skin.upload_calibration(calibration, save))

    def save(self) -> StoreInfo:
        """Keep the tables, trim and settings in use without power, for every start from now on; returns the store's state.

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

    def __reduce__(self) -> NoReturn:
        raise InvalidInput("A skin cannot be sent to another process or copied; connect in that process.")

    def __repr__(self) -> str:
        return describe("Skin", self.link, self.info)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


async def _next(states: AsyncGenerator[State]) -> State:
    return await anext(states)
