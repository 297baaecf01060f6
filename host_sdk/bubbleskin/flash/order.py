"""What `flash` is asked for, and what it has done."""

from dataclasses import dataclass
from pathlib import Path

from bubbleskin.device.info import Info


@dataclass(frozen=True)
class Order:
    """What is asked for; None and False leave it to what is found."""

    board: str | None = None
    device: str | None = None
    drive: Path | None = None
    uf2: Path | None = None
    mpy: bool = False
    previous: bool = False


@dataclass(frozen=True)
class Outcome:
    """What has been done: `how` is "uf2" or "mpy", `info` the new firmware's answer to HELLO."""

    how: str
    info: Info
    old: str | None
    """The version that was there before, where it said one."""
