"""The widget itself. Imported by `live`, and only where anywidget is installed."""

from typing import Any

import anywidget
import traitlets

from bubbleskin.browser.messages import WEB, geometry, message
from bubbleskin.skin import Skin

_EXPORT = "export default {"


def _module() -> str:
    """One module, which notebooks want: array.js, its component as `array`, and widget.js."""
    before, _, component = (WEB / "array.js").read_text(encoding="utf-8").partition(_EXPORT)
    return f"{before}const array = {{{component}\n{(WEB / 'widget.js').read_text(encoding='utf-8')}"


def _style() -> str:
    """Colours are the widget's own, and not those of the notebook's page."""
    palette, array, widget = (
        (WEB / f"{name}.css").read_text(encoding="utf-8") for name in ("palette", "array", "widget")
    )
    return f"{palette.replace(':root', '.bubbleskin')}{array}{widget}"


class LiveArray(anywidget.AnyWidget):
    """The array of a skin, live; made by `bubbleskin.live`."""

    _esm = _module()
    _css = _style()
    geometry = traitlets.Dict().tag(sync=True)
    """As of `bubbleskin.browser.messages.geometry`."""
    state = traitlets.Dict().tag(sync=True)
    """The state that is shown, as of `bubbleskin.browser.messages.message`."""
    said = traitlets.Unicode("").tag(sync=True)
    """Why nothing new is shown; empty where all is well."""
    rate_hz: float = 10.0

    def __init__(self, skin: Skin, **options: Any):
        super().__init__(geometry=geometry(skin.info, skin.layout), state=message(skin.state()), **options)
