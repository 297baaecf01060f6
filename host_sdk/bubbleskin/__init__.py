"""Heights in, shapes out: the SDK of the bubbleskin wristbands."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from bubbleskin.connect import aconnect, connect
from bubbleskin.errors import (
    BubbleskinError,
    DeviceFault,
    DeviceRefused,
    DeviceSilent,
    InvalidInput,
    LinkError,
    WrongDevice,
)
from bubbleskin.layout import Layout
from bubbleskin.playing import Played, Playing
from bubbleskin.records import Health, Info, State
from bubbleskin.shape import sequences
from bubbleskin.shape.sequence import After, Repeat, Sequence, Settled, Step
from bubbleskin.skin import AsyncSkin, Skin

if TYPE_CHECKING:
    from bubbleskin.physics import (
        Calibration,
        Table,
        YeohBalloon,
        YeohFit,
        build_table,
        fit_sheet,
        fit_yeoh,
        preset,
        read_csv,
    )

# The physics takes scipy, which takes a second to import; a script that only shows heights need not wait for it.
_PHYSICS = (
    "Calibration",
    "Table",
    "YeohBalloon",
    "YeohFit",
    "build_table",
    "fit_sheet",
    "fit_yeoh",
    "preset",
    "read_csv",
)

__all__ = [
    "After",
    "AsyncSkin",
    "BubbleskinError",
    "Calibration",
    "DeviceFault",
    "DeviceRefused",
    "DeviceSilent",
    "Health",
    "Info",
    "InvalidInput",
    "Layout",
    "LinkError",
    "Played",
    "Playing",
    "Repeat",
    "Sequence",
    "Settled",
    "Skin",
    "State",
    "Step",
    "Table",
    "WrongDevice",
    "YeohBalloon",
    "YeohFit",
    "aconnect",
    "build_table",
    "connect",
    "fit_sheet",
    "fit_yeoh",
    "preset",
    "read_csv",
    "sequences",
]


def __getattr__(name: str) -> Any:
    if name not in _PHYSICS:
        raise AttributeError(f"module 'bubbleskin' has no attribute {name!r}")
    return getattr(import_module("bubbleskin.physics"), name)
