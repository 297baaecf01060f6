"""The array live in a notebook: asked of the wristband by a thread, as the kernel is busy with cells."""

import importlib.util
import threading
import time
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

from bubbleskin import checks
from bubbleskin.browser.messages import message
from bubbleskin.errors import BubbleskinError
from bubbleskin.skin import Skin

if TYPE_CHECKING:
    from bubbleskin.browser.widget import LiveArray

RATE_MOST_HZ = 30.0
_shown: "WeakKeyDictionary[Skin, LiveArray]" = WeakKeyDictionary()


def live(skin: Skin, rate_hz: float = 10.0) -> "LiveArray":
    """A widget that shows the array of `skin` as it is, in Jupyter and whatever else shows anywidgets; the last line of a cell.

    It asks for the state `rate_hz` times a second, at most 30, in a thread of its own, until `close()` of the widget or of the
    skin. The widget of a skin that is shown already is the same one. A simulated wristband that does not keep the wall
    clock's pace is asked only where its time has gone on: looking at it changes nothing. Needs `bubbleskin[notebook]`.
    """
    checks.instance("skin", skin, Skin, "what `bubbleskin.connect` returns")
    rate_hz = checks.number("rate_hz", rate_hz, 0.1, RATE_MOST_HZ, "a second")
    if importlib.util.find_spec("anywidget") is None:
        raise BubbleskinError("The live widget needs anywidget. Install it with `pip install 'bubbleskin[notebook]'`.")
    from bubbleskin.browser.widget import LiveArray

    shown = _shown.get(skin)
    if shown is None or shown.comm is None:
        shown = _shown[skin] = LiveArray(skin)
        threading.Thread(target=_follow, args=(shown, skin), name="bubbleskin live", daemon=True).start()
    shown.rate_hz = rate_hz
    return shown


def _follow(shown: "LiveArray", skin: Skin) -> None:
    """Ask, and show, until either is closed."""
    asked_at = skin.simulated.time if skin.simulated else None  # the widget was made with that
    while shown.comm is not None and not skin.link.closed:
        board = skin.simulated
        if board is None or board.time != asked_at:
            try:
                shown.state = message(skin.state())
                shown.said = ""
            except BubbleskinError as error:
                shown.said = str(error)
            asked_at = board.time if board else None
        time.sleep(1.0 / shown.rate_hz)
    shown.said = "The wristband is closed: this is what it was last."
