"""What `AsyncSkin` asks of shapes: tops in, SHOWs out; states in, tops out; and waiting until a shape stands."""

import asyncio
import logging
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from bubbleskin.device.health import Health
from bubbleskin.device.info import Info
from bubbleskin.device.state import State
from bubbleskin.errors import DeviceFault, DeviceRestarted
from bubbleskin.fault_guide import remedies
from bubbleskin.layout import Layout
from bubbleskin.link.link import Link
from bubbleskin.sequence.model import Sequence
from bubbleskin.sequence.player import Player
from bubbleskin.sequence.steps import Settled, Step
from bubbleskin.surface.compensate import SHORT_MM, Answer, Compensation
from bubbleskin.surface.gaps import Gaps
from bubbleskin.surface.kept import KeptShape
from bubbleskin.surface.limits import Limits
from bubbleskin.surface.played import cut, highest_cut, steps_of
from bubbleskin.surface.pressed import Flags, Pressed
from bubbleskin.surface.told import told

if TYPE_CHECKING:
    from bubbleskin.contact.held import HeldShape

Array = NDArray[np.float64]
_T = TypeVar("_T")
_log = logging.getLogger(__name__)

SETTLE = 3.0
"""Seconds beyond `over` after which `show` gives up waiting; the valves need about half of one."""

UNASKED_END = "it was stopped or vented, or its host was silent for too long; see `fault_log()`."
"""Why a wristband without a fault does no longer what it was asked to."""

STREAM_S = 0.25
"""A show that does not wait, and takes no longer than that, is one of a stream: one step, from the shape before."""
RAMP_S = 0.4
"""Bubbles that touch take so long at least, so that they stay on their way together: it decides where they end."""
_SLIDE_S = 0.15
"""Bubbles that push each other slide on for so long once their air is there."""
_STEP = Settled(tolerance_mm=0.2, timeout_s=3.0)
_SAME_MM = 5e-4
"""Heights are sent in whole µm."""
_NEAR_MM = 0.3
"""A way is gone where all heights alone rest so near its end."""
_AHEAD = 64
"""Of a sequence so many steps are looked at for the one that is played."""
_AT_REST = ("resting", "settled", "unsure", "missed")
_POLL = 0.02
"""Seconds between two looks at whether a shape has settled."""
_QUIET = 1.0
"""Seconds between two sentences of a stream about what cannot be had."""


class _Leg(NamedTuple):
    """The way that was sent last: heights alone from and to, where it leads, when it was sent (host's time), its seconds."""

    begin: Array
    end: Array
    members: "list[HeldShape]"
    sent: float
    over: float
    straight: bool
    """Whether it is one step."""

    def alone_at(self, time: float) -> Array:
        """Heights alone at `time`, of a straight one."""
        share = min((time - self.sent) / self.over, 1.0) if self.over else 1.0
        return self.begin + share * (self.end - self.begin)


class Shows:
    """The shape of the device at the other end of `link`. `touch`: whether neighbours push each other, as real ones do."""

    def __init__(self, link: Link, info: Info, layout: Layout, player: Player, *, touch: bool):
        self._link, self._info, self._layout, self._player = link, info, layout, player
        gaps = Gaps(layout, info.height_max_mm if touch else 0.0)
        self._limits = Limits(gaps, info.height_rest_mm, info.height_max_mm)
        self._kept = KeptShape(layout, gaps, info.height_rest_mm)
        self._pressed = Pressed(gaps, len(layout))
        self._steps: list[Array] = []  # heights alone that were sent and are not passed, the last included
        self._asked: Array | None = None  # the tops that they are to give; None: nobody asked for tops
        self._leg: _Leg | None = None  # of the last show, and whether its end has been seen
        self._seen = False
        self._looked: Array | None = None  # heights alone that were told on its way
        self._taken_at = -np.inf  # device's time at which it took the heights of the last show, s
        self._said = -np.inf  # when a stream was last said to be short

    def opened(self, info: Info) -> None:
        """A session has been opened: with another boot, what was kept is of the past."""
        if info.boot_id != self._info.boot_id:
            self._kept.forget()
            self._pressed.forget()
            self.unasked()
        self._info = info

    def unasked(self) -> None:
        """The bubbles will go where no show has asked them to."""
        self._steps, self._asked, self._leg = [], None, None

    async def show(self, heights_mm: Array, over: float, wait: bool, plan: bool) -> State | None:
        """See `Skin.show`; `heights_mm` is (n,), checked."""
        gaps = self._limits.gaps
        alone = np.rint(heights_mm * 1000) / 1000
        if not plan or gaps.apart(np.maximum(alone, self._limits.rest_mm)):
            self._note([alone], None)
            await self._send(alone, over)
            return await self.settle(over + SETTLE) if wait else None
        leg = self._leg
        streams = not wait and 0 < over <= STREAM_S and self._kept.known and leg is not None and leg.straight
        if not streams:
            await self.look()
        self._catch_up()
        begin, steps = self._kept.begun(), list[Array]()
        lost = self._pressed.lost(self._link.transport.now()) & (not streams)
        if lost.any() or not self._kept.known:
            begin, steps = self._begin_afresh(lost)
        question = Compensation(begin, alone, self._limits)
        answer = await self._thought(lambda: question.answer(orders=not streams))
        if self._kept.alone_mm is None:
            raise DeviceRestarted(
                f"The wristband at {self._link.transport.name} has restarted while its shape was reckoned, and vents. "
                "Nothing was sent; send what you still want."
            )
        self._say_short(alone, answer, streams)
        steps += [np.rint(step * 1000) / 1000 for step in answer.steps]
        return await self._go(alone, steps, answer, over if streams else max(over, RAMP_S), wait)

    async def bounded(self, sequence: Sequence) -> Sequence:
        """The sequence, cut where neighbours would lift a bubble past the limit, from the shape of this moment."""
        self.unasked()
        gaps = self._limits.gaps
        if not gaps or sequence.bubbles != len(self._layout):
            return sequence
        steps = steps_of(sequence)
        if np.max(steps) > self._info.height_max_mm:  # which is refused, and not cut
            return sequence
        if not gaps.apart(np.maximum(np.max(steps, axis=0), self._limits.rest_mm)):
            await self.look()
            height_mm = await self._thought(lambda: highest_cut(sequence, self._kept, self._limits))
            if height_mm is not None:
                _log.warning(
                    "The sequence%s would let neighbours lift a bubble past the limit of %g mm: its targets are cut at %g mm.",
                    f" {sequence.name}" if sequence.name else "",
                    self._info.height_max_mm,
                    height_mm,
                )
                sequence = cut(sequence, height_mm)
                steps = steps_of(sequence)
        self._steps = steps
        self._pressed.reach(np.max(steps, axis=0), self._link.transport.now())
        return sequence

    async def _go(self, asked: Array, steps: list[Array], answer: Answer, over: float, wait: bool) -> State | None:
        """Send these steps, `over` s for all of them."""
        now, begin = self._link.transport.now(), self._kept.alone_mm
        self._note(steps, asked)
        assert begin is not None
        self._leg = _Leg(begin, steps[-1], answer.members, now, over, len(steps) == 1)
        if len(steps) == 1:
            await self._send(steps[0], over)
        else:
            ramp = max(over / len(steps), RAMP_S)
            sequence = Sequence([Step(step.tolist(), ramp, until=_STEP) for step in steps], name="show")
            started = await self._player.start(sequence, None, follow=wait)
            if wait:
                await self._player.follow(started, None)
        if not wait:
            return None
        await self.settle(over + SETTLE)
        await self._link.wait(self._link.transport.now() + _SLIDE_S)
        return await self.settle(SETTLE)

    async def _send(self, alone: Array, over: float) -> None:
        micrometres = np.rint(alone * 1000).astype(int).tolist()
        reply = await self._link.call("SHOW", (round(over * 1000),), [(height,) for height in micrometres])
        self._taken_at = reply["ticks"] * self._info.tick

    def _note(self, steps: list[Array], asked: Array | None) -> None:
        self._steps, self._asked, self._leg, self._seen = list(steps), asked, None, False
        self._looked, self._taken_at = None, -np.inf
        self._pressed.reach(np.max(steps, axis=0), self._link.transport.now())

    def _catch_up(self) -> None:
        """Take the way that was sent last for gone, as far as it has been seen or its time has passed."""
        leg, now = self._leg, self._link.transport.now()
        if leg is None or self._seen:
            return
        if self._looked is not None:
            self._kept.go(self._looked)
        elif now >= leg.sent + leg.over:
            self._kept.take(leg.members)
        else:
            self._kept.go(leg.alone_at(now))

    def _begin_afresh(self, lost: Flags) -> "tuple[list[HeldShape], list[Array]]":
        """Nobody knows on which way the bubbles came, or how large some have become: they go apart first, the `lost` flat."""
        where = self._kept.alone_mm
        assert where is not None
        if lost.any():
            names = self._layout.names(np.flatnonzero(lost).tolist())
            _log.info("Neighbours have pressed %s for long: flat first, to be measured anew.", names)
        if not self._kept.known:
            _log.warning(
                "Bubbles that may touch stood there before this program came, and nobody knows who lifts whom: "
                "they go apart first."
            )
        apart = np.where(lost, self._limits.rest_mm, self._limits.gaps.separated(where))
        self._pressed.flat(lost)
        fresh = KeptShape(self._layout, self._limits.gaps, self._limits.rest_mm)
        fresh.go(apart)
        step = np.rint(apart * 1000) / 1000
        return fresh.begun(), [step] * (2 if lost.any() else 1)  # twice: it is flat for a while, to be measured

    async def _thought(self, think: Callable[[], _T]) -> _T:
        """What `think` comes to; an event loop goes on meanwhile."""
        return await asyncio.to_thread(think) if self._link.event_loop else think()

    def _say_short(self, asked: Array, answer: Answer, streams: bool) -> None:
        off = answer.predicted_mm - np.maximum(asked, self._limits.rest_mm)
        short = np.flatnonzero(np.abs(off) > SHORT_MM)
        now = self._link.transport.now()
        if not len(short) or (streams and now < self._said + _QUIET):
            return
        self._said = now
        most = int(np.abs(off).argmax())
        one = len(short) == 1
        _log.warning(
            "%s cannot have the height%s asked: %s",
            self._layout.names(short.tolist()).capitalize(),
            "" if one else "s",
            f"neighbours would lift {'it' if one else 'them'}, push {'it' if one else 'them'} aside or past the limit of "
            f"{self._info.height_max_mm:g} mm. The nearest found is shown, bubble {most} "
            f"{answer.predicted_mm[most]:.2f} instead of {asked[most]:.2f} mm high.",
        )

    def tell(self, state: State) -> State:
        """The state of tops, of what a device believes of each bubble by itself."""
        if state.time == self._taken_at:  # no tick has seen what was asked: the rest is that of before
            state = replace(state, status=tuple("moving" if status in _AT_REST else status for status in state.status))
        if not self._limits.gaps or np.isnan(state.alone_mm).any():
            return state
        now = self._link.transport.now()
        self._pressed.flat(np.array([status == "resting" for status in state.status]))
        self._pressed.reach(state.alone_mm, now)
        ours = self._pass_steps(state.target_mm)
        kept = self._follow(state.alone_mm, ours, moves="moving" in state.status)
        asked = self._asked if ours and self._asked is not None else None
        if asked is None and not kept.members:
            return state
        on_the_way = asked is not None and len(self._steps) > 1
        return told(state, kept, state.target_mm if asked is None else asked, on_the_way=on_the_way)

    def _follow(self, alone_mm: Array, ours: bool, moves: bool) -> KeptShape:
        """The shape with these heights alone. On the way of a show they are told less well than they were sent: what was foreseen
        is kept, once they rest near its end."""
        leg = self._leg
        if leg is None or self._seen or not ours:
            self._kept.go(alone_mm)
            return self._kept
        near = np.abs(alone_mm - np.maximum(leg.end, self._limits.rest_mm)).max() < _NEAR_MM
        if len(self._steps) == 1 and near and not moves:
            self._seen = True
            self._kept.take(leg.members)
            self._kept.go(alone_mm)
            return self._kept
        self._looked = alone_mm
        on_its_way = self._kept.copy()
        if len(self._steps) == 1 and near:
            on_its_way.take(leg.members)
        else:
            on_its_way.go(alone_mm)
        return on_its_way

    def _pass_steps(self, target_mm: Array) -> bool:
        """Follow the steps before the one whose target this is; False where it is none of them."""
        for number, step in enumerate(self._steps[:_AHEAD]):
            if np.abs(step - target_mm).max() < _SAME_MM:
                for passed in self._steps[:number]:
                    self._kept.go(passed)
                self._steps = self._steps[number:]
                return True
        return False

    async def look(self) -> State:
        """See `Skin.state`."""
        request = "ESTIMATE" if self._info.tells_sd else "STATE"
        return self.tell(State.of(await self._link.call(request), self._info.tick))

    async def settle(self, patience: float) -> State:
        """The state in which every bubble has settled; `DeviceFault` if that does not come within `patience` seconds."""
        link = self._link
        deadline = link.transport.now() + patience
        while True:
            state = await self.look()
            await self._check(state)
            if state.arrived:
                return state
            if link.transport.now() >= deadline:
                raise self._unsettled(state, patience)
            await link.wait(link.transport.now() + _POLL)

    async def _check(self, state: State) -> None:
        """`DeviceFault` where a bubble has a fault, or the board no longer controls heights."""
        ill = {bubble: found for bubble, found in enumerate(state.faults) if found}
        if ill:
            what = "; ".join(f"bubble {bubble}: {', '.join(found)}" for bubble, found in ill.items())
            advice = remedies(name for found in ill.values() for name in found)
            raise DeviceFault(f"The wristband reports faults ({what}). {advice} Then `clear_faults()`.")
        if state.mode != "active":
            board = Health.of(await self._link.call("INFO"), self._info.tick).board_faults
            why = f"faults of the board: {', '.join(board)}. {remedies(board)}" if board else UNASKED_END
            raise DeviceFault(f"The wristband is {state.mode} in the middle of a show: {why}")

    def _unsettled(self, state: State, patience: float) -> DeviceFault:
        late = state.unsettled
        where = ", ".join(f"{state.height_mm[b]:.2f} instead of {state.target_mm[b]:.2f} mm" for b in late)
        return DeviceFault(
            f"{self._layout.names(late).capitalize()} did not settle within {patience:g} s: at {where}. "
            "Check the supply pressure in `health()`, leaks and kinked tubes."
        )
