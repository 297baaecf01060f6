"""Pings for a clock, a handful at once."""

from bubbleskin.link.clock import Clock
from bubbleskin.link.link import Link

PINGS = 20
_PAUSE = 1.3e-3  # seconds, and up to seven times that: not in step with the device's ticks


async def ping(link: Link, clock: Clock, pings: int = PINGS) -> None:
    """Send so many pings one after another; the clock hears of each."""
    for number in range(pings):
        sent = link.transport.now()
        reply = await link.call("PING", (number,))
        if link.on_ping != clock.hear:  # else it has heard already
            clock.hear(sent, reply, link.transport.now())
        await link.wait(link.transport.now() + _PAUSE * (1 + number % 7))
