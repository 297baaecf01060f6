"""How well the line to a wristband works: round trips, frames that were damaged, telemetry that did not come."""

from contextlib import closing
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bubbleskin import checks

if TYPE_CHECKING:
    from bubbleskin.link.message import Message
    from bubbleskin.skin import Skin

RATE_HZ = 50.0
"""Of the telemetry that is asked for meanwhile, at most."""
_PING_EVERY_S = 0.1
SLOW_S = 0.05
"""A round trip above this is felt: 30 shapes a second have 33 ms each."""
LONGEST_S = 3600.0


@dataclass(frozen=True)
class LineCheck:
    """What was seen on a line in `seconds` of device time."""

    seconds: float
    round_trips: int
    """How many PINGs were answered."""
    median_s: float
    """Of the round trips."""
    slowest_s: float
    """Of ninety-nine in a hundred."""
    states: int
    """Telemetry that has come."""
    lost: int
    """Telemetry that was due and has not come."""
    damaged: int
    """Frames that the wristband got and could not read."""
    clock_uncertainty_s: float

    @property
    def advice(self) -> str:
        """What to do; empty where nothing is wrong."""
        if self.damaged or self.lost > self.states // 100:
            return "Try another cable or port, and none through a hub; keep it away from the pump's wires."
        if self.slowest_s > SLOW_S:
            return "Something on the way waits: a hub, a virtual machine, or a computer that is busy."
        return ""


def check_line(skin: "Skin", seconds: float) -> LineCheck:
    """Ask a wristband for telemetry and PINGs for so long, up to an hour; nothing moves."""
    seconds = checks.number("seconds", seconds, 0.5, LONGEST_S, "s")
    trips: list[float] = []
    usual = skin.link.on_ping

    def note(sent: float, reply: "Message", received: float) -> None:
        trips.append(received - sent)
        if usual:
            usual(sent, reply, received)

    before = skin.health()
    states = lost = 0
    skin.link.on_ping = note
    try:
        pinged = before.time
        with closing(skin.telemetry(min(RATE_HZ, 1 / skin.info.tick))) as telemetry:
            for state in telemetry:
                states, lost = states + 1, state.lost
                if state.time - pinged >= _PING_EVERY_S:
                    pinged = state.time
                    skin.synchronise(1)
                if state.time - before.time >= seconds:
                    break
    finally:
        skin.link.on_ping = usual
    after = skin.health()
    return LineCheck(
        seconds=after.time - before.time,
        round_trips=len(trips),
        median_s=float(np.median(trips)),
        slowest_s=float(np.percentile(trips, 99)),
        states=states,
        lost=lost,
        damaged=after.frames_bad - before.frames_bad,
        clock_uncertainty_s=skin.synchronise(1).uncertainty,
    )
