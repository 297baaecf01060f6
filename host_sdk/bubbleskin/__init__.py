"""Heights in, shapes out: the SDK of the bubbleskin wristbands."""

TYPE_CHECKING = False  # as of `typing`, which is not waited for
if TYPE_CHECKING:
    from bubbleskin import patterns as patterns
    from bubbleskin.async_skin import AsyncSkin
    from bubbleskin.bringup.findings import Finding
    from bubbleskin.bringup.questions import Question
    from bubbleskin.bringup.report import BringUp
    from bubbleskin.bringup.session import bring_up
    from bubbleskin.browser.live import live
    from bubbleskin.calibrate.measure import CalibrationProgress
    from bubbleskin.calibrate.result import BubbleCalibration, SelfCalibration
    from bubbleskin.connecting import aconnect, connect
    from bubbleskin.contact.fit import ContactFit, fit_contact
    from bubbleskin.contact.measured import Measured
    from bubbleskin.contact.model import CompliantContact
    from bubbleskin.contact.rigid import RigidContact
    from bubbleskin.contact.shape import Shape
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
    from bubbleskin.replays.run import Replayed, replay
    from bubbleskin.sequence import library as sequences
    from bubbleskin.sequence.model import Sequence
    from bubbleskin.sequence.playback import PlaybackReport, PlaybackStatus
    from bubbleskin.sequence.steps import After, Repeat, Settled, Step
    from bubbleskin.shape import shapes
    from bubbleskin.skin import Skin
    from bubbleskin.sweeps.run import sweep
    from bubbleskin.telemetry.recording import Recording

# Each name is imported when it is asked for: a script that only shows heights does not wait for scipy and numba, and the
# command for nothing before it knows what Ctrl-C means. A type checker finds them above.
_ROOMS = {
    "After": "sequence.steps",
    "AsyncSkin": "async_skin",
    "BringUp": "bringup.report",
    "BubbleCalibration": "calibrate.result",
    "BubbleskinError": "errors",
    "Calibration": "membrane",
    "CalibrationProgress": "calibrate.measure",
    "CompliantContact": "contact.model",
    "ContactFit": "contact.fit",
    "DeviceFault": "errors",
    "DeviceRefused": "errors",
    "DeviceRestarted": "errors",
    "DeviceSilent": "errors",
    "Fault": "device.faults",
    "Finding": "bringup.findings",
    "Health": "device.health",
    "Info": "device.info",
    "InvalidInput": "errors",
    "Layout": "layout",
    "LinkError": "errors",
    "Measured": "contact.measured",
    "NoEquilibrium": "errors",
    "Overtaken": "errors",
    "Plan": "planner.plan",
    "PlaybackReport": "sequence.playback",
    "PlaybackStatus": "sequence.playback",
    "Recording": "telemetry.recording",
    "Replayed": "replays.run",
    "Repeat": "sequence.steps",
    "Question": "bringup.questions",
    "RigidContact": "contact.rigid",
    "SelfCalibration": "calibrate.result",
    "Sequence": "sequence.model",
    "Setting": "device.settings",
    "Settled": "sequence.steps",
    "Shape": "contact.shape",
    "Skin": "skin",
    "State": "device.state",
    "Step": "sequence.steps",
    "StoreInfo": "device.store",
    "Table": "membrane",
    "TickHistogram": "device.health",
    "Trim": "device.trim",
    "WrongDevice": "errors",
    "YeohBalloon": "membrane",
    "YeohFit": "membrane",
    "aconnect": "connecting",
    "bring_up": "bringup.session",
    "build_table": "membrane",
    "connect": "connecting",
    "fit_contact": "contact.fit",
    "fit_sheet": "membrane",
    "fit_yeoh": "membrane",
    "live": "browser.live",
    "plan": "planner.search",
    "preset": "membrane",
    "read_csv": "membrane",
    "replay": "replays.run",
    "sweep": "sweeps.run",
}
_MODULES = {"patterns": "patterns", "sequences": "sequence.library", "shapes": "shape.shapes"}

__all__ = [
    "After",
    "AsyncSkin",
    "BringUp",
    "BubbleCalibration",
    "BubbleskinError",
    "Calibration",
    "CalibrationProgress",
    "CompliantContact",
    "ContactFit",
    "DeviceFault",
    "DeviceRefused",
    "DeviceRestarted",
    "DeviceSilent",
    "Fault",
    "Finding",
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
    "Question",
    "Recording",
    "Repeat",
    "Replayed",
    "RigidContact",
    "SelfCalibration",
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
    "bring_up",
    "build_table",
    "connect",
    "fit_contact",
    "fit_sheet",
    "fit_yeoh",
    "live",
    "patterns",
    "plan",
    "preset",
    "read_csv",
    "replay",
    "sequences",
    "shapes",
    "sweep",
]

if not TYPE_CHECKING:  # where a checker saw this, it would take every misspelt name for something that is found here

    def __getattr__(name):
        """A public name, or a room of the SDK, as if it had been imported before."""
        from importlib import import_module
        from importlib.util import find_spec

        if name in _ROOMS:
            found = getattr(import_module(f"bubbleskin.{_ROOMS[name]}"), name)
        elif name in _MODULES:
            found = import_module(f"bubbleskin.{_MODULES[name]}")
        elif not name.startswith("_") and find_spec(f"bubbleskin.{name}"):
            found = import_module(f"bubbleskin.{name}")
        else:
            raise AttributeError(f"module 'bubbleskin' has no attribute {name!r}")
        globals()[name] = found
        return found


def __dir__() -> list[str]:
    """The public names, and not the modules that happen to have been imported."""
    return __all__
