"""Heights in, shapes out: the SDK of the bubbleskin wristbands."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from bubbleskin.connect import aconnect, connect
from bubbleskin.errors import (
    BubbleskinError,
    DeviceFault,
    DeviceRefused,
    DeviceRestarted,
    DeviceSilent,
    InvalidInput,
    LinkError,
    NoEquilibrium,
    Overtaken,
    WrongDevice,
)
from bubbleskin.layout import Layout
from bubbleskin.playing import Played, Playing
from bubbleskin.records import Health, Info, State
from bubbleskin.shape import sequences
from bubbleskin.shape.sequence import After, Repeat, Sequence, Settled, Step
from bubbleskin.skin import AsyncSkin, Skin
from bubbleskin.stored import Figures, StoreInfo

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
    from bubbleskin.shape.contact import CompliantContact, Shape
    from bubbleskin.shape.fit import ContactFit, Measured, fit_contact
    from bubbleskin.shape.plan import Plan, plan
    from bubbleskin.shape.rigid import RigidContact

# The physics takes scipy, which takes a second to import, and contact takes numba; a script that only shows heights
# need not wait for them.
_LATER = {
    "Calibration": "physics",
    "CompliantContact": "shape.contact",
    "ContactFit": "shape.fit",
    "Measured": "shape.fit",
    "Plan": "shape.plan",
    "RigidContact": "shape.rigid",
    "Shape": "shape.contact",
    "Table": "physics",
    "YeohBalloon": "physics",
    "YeohFit": "physics",
    "build_table": "physics",
    "fit_contact": "shape.fit",
    "fit_sheet": "physics",
    "fit_yeoh": "physics",
    "plan": "shape.plan",
    "preset": "physics",
    "read_csv": "physics",
}

__all__ = [
    "After",
    "AsyncSkin",
    "BubbleskinError",
    "Calibration",
    "CompliantContact",
    "ContactFit",
    "DeviceFault",
    "DeviceRefused",
    "DeviceRestarted",
    "DeviceSilent",
    "Figures",
    "Health",
    "Info",
    "InvalidInput",
    "Layout",
    "LinkError",
    "Measured",
    "NoEquilibrium",
    "Overtaken",
    "Plan",
    "Played",
    "Playing",
    "Repeat",
    "RigidContact",
    "Sequence",
    "Settled",
    "Shape",
    "Skin",
    "State",
    "Step",
    "StoreInfo",
    "Table",
    "WrongDevice",
    "YeohBalloon",
    "YeohFit",
    "aconnect",
    "build_table",
    "connect",
    "fit_contact",
    "fit_sheet",
    "fit_yeoh",
    "plan",
    "preset",
    "read_csv",
    "sequences",
]


def __getattr__(name: str) -> Any:
    if name not in _LATER:
        raise AttributeError(f"module 'bubbleskin' has no attribute {name!r}")
    return getattr(import_module(f"bubbleskin.{_LATER[name]}"), name)
