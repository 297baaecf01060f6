"""Heights in, shapes out: the SDK of the bubbleskin wristbands."""

from importlib import import_module
from typing import TYPE_CHECKING

from bubbleskin.async_skin import AsyncSkin
from bubbleskin.connect import aconnect, connect
from bubbleskin.device.faults import Fault
from bubbleskin.device.health import Health, TickHistogram
from bubbleskin.device.info import Info
from bubbleskin.device.settings import Setting
from bubbleskin.device.state import State
from bubbleskin.device.store import StoreInfo
from bubbleskin.device.trim import Trim
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
from bubbleskin.sequence.model import Sequence
from bubbleskin.sequence.playback import PlaybackReport, PlaybackStatus
from bubbleskin.sequence.steps import After, Repeat, Settled, Step
from bubbleskin.shape import shapes
from bubbleskin.skin import Skin
from bubbleskin.telemetry.recording import Recording

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
# need not wait for them. A type checker finds them above.
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
    "Fault",
    "Health",
    "Info",
    "InvalidInput",
    "Layout",
    "LinkError",
    "Measured",
    "NoEquilibrium",
    "Overtaken",
    "Plan",
    "PlaybackReport",
    "PlaybackStatus",
    "Recording",
    "Repeat",
    "RigidContact",
    "Sequence",
    "Setting",
    "Settled",
    "Shape",
    "Skin",
    "State",
    "Step",
    "StoreInfo",
    "Table",
    "TickHistogram",
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
    "shapes",
]

if not TYPE_CHECKING:  # where a checker saw this, it would take every misspelt name for something that is found here

    def __getattr__(name):
        if name not in _LATER:
            raise AttributeError(f"module 'bubbleskin' has no attribute {name!r}")
        return getattr(import_module(f"bubbleskin.{_LATER[name]}"), name)


def __dir__() -> list[str]:
    """The public names, and not the modules that happen to have been imported."""
    return __all__
