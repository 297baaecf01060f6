"""Heights in, shapes out: the SDK of the bubbleskin wristbands."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from bubbleskin.connect import aconnect, connect
from bubbleskin.device.records import Health, Info, State
from bubbleskin.device.stored import StoreInfo, Trim
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
from bubbleskin.sequence import library as sequences
from bubbleskin.sequence.model import After, Repeat, Sequence, Settled, Step
from bubbleskin.sequence.player import Played, Playing
from bubbleskin.skin import AsyncSkin, Skin

if TYPE_CHECKING:
    from bubbleskin.contact.fit import ContactFit, Measured, fit_contact
    from bubbleskin.contact.model import CompliantContact, Shape
    from bubbleskin.contact.rigid import RigidContact
    from bubbleskin.membrane import (
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
    from bubbleskin.planner.plan import Plan
    from bubbleskin.planner.search import plan

# The physics takes scipy, which takes a second to import, and contact takes numba; a script that only shows heights
# need not wait for them.
_LATER = {
    "Calibration": "membrane",
    "CompliantContact": "contact.model",
    "ContactFit": "contact.fit",
    "Measured": "contact.fit",
    "Plan": "planner.plan",
    "RigidContact": "contact.rigid",
    "Shape": "contact.model",
    "Table": "membrane",
    "YeohBalloon": "membrane",
    "YeohFit": "membrane",
    "build_table": "membrane",
    "fit_contact": "contact.fit",
    "fit_sheet": "membrane",
    "fit_yeoh": "membrane",
    "plan": "planner.search",
    "preset": "membrane",
    "read_csv": "membrane",
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
    "Trim",
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
