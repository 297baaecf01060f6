"""The panel of the topographic mouse: a terrain that is felt where the pointer is."""

import base64
import io

import numpy as np
from nicegui import ui
from nicegui.element import Element

from bubbleskin.demonstrations.landscapes import LANDSCAPES
from bubbleskin.demonstrations.terrain import MODES, Terrain
from bubbleskin.studio.array import Array
from bubbleskin.studio.desk import Desk, Ground
from bubbleskin.studio.files import STATIC
from bubbleskin.studio.widgets import Toggle, choice, text

_PIXELS_MAX = 480
"""Along an edge of the map that is drawn: what is felt is not this, but the whole terrain."""
_WORDS = {"plain": "Elevation", "slope": "Slope", "stretched": "Elevation, contrast raised"}


class Map(Element, component=STATIC / "terrain.js"):
    """A terrain from above, with the wristband's bubbles where they are felt."""

    def __init__(self, terrain: Terrain, place: tuple[float, float]):
        super().__init__()
        layout = terrain.layout
        self.props.update(
            image=picture(terrain),
            size=list(terrain.size_mm),
            positions=layout.positions_mm.round(3).tolist(),
            radius=layout.pitch_mm / 2,
            place=list(place),
        )


class TerrainPanel:
    """Which terrain, how it is felt, the map, and what of it can be felt where the pointer is."""

    def __init__(self, desk: Desk, array: Array):
        self._desk = desk
        self._mapped: Terrain | None = None
        ground = desk.ground
        with ui.element("section").classes("card"):
            text("h2", "Topographic mouse")
            text("p", "Move over the map: the bubbles take the shape of the land under the pointer.")
            with ui.element("div").classes("pair"):
                self._which = choice("Terrain", _names(ground), ground.name, desk.choose_terrain)
                choice("Felt as", [(mode, _WORDS[mode]) for mode in MODES], ground.mode, desk.choose_mode)
            self._feel = Toggle("Feel it", self._toggle)
            self._map = ui.element("div").classes("map")
            self._said = text("p", "", "fine").props('aria-live="polite"')
        self.refresh()

    def _toggle(self) -> None:
        if self._desk.owner.activity == "terrain":
            self._desk.owner.begin("")
        else:
            self._desk.owner.begin("terrain")
            self._desk.feel(*self._desk.ground.place, 0.0)
        self.refresh()

    def refresh(self) -> None:
        """Draw the map where it is another, and say what can be felt."""
        ground = self._desk.ground
        self._feel.set(self._desk.owner.activity == "terrain")
        terrain = ground.terrain
        if terrain is None:
            self._desk.choose_terrain(ground.name)
            return
        if terrain is not self._mapped:
            self._mapped = terrain
            self._which.props.update(options=_names(ground), value=ground.name)
            self._map.clear()
            with self._map:
                drawn = Map(terrain, ground.place)
                drawn.on("point", lambda event: self._desk.feel(event.args["x"], event.args["y"], event.args["stamp"]))
                drawn.on("uploaded", lambda event: setattr(self._desk.owner, "problem", event.args["problem"]))
        self._said.text = f"Here: {terrain.look(*ground.place, ground.mode, self._desk.owner.state)}."


def _names(ground: Ground) -> list[list[str]]:
    """The terrains that there are, and what they are called."""
    names = [[name, name.capitalize()] for name in LANDSCAPES]
    if ground.uploaded:
        names.append([ground.uploaded.name, f"Yours: {ground.uploaded.name}"])
    return names


def picture(terrain: Terrain) -> str:
    """The terrain as a PNG in a data URL: cividis, with light from the upper left; row 0 of a picture is its upper edge."""
    from matplotlib import colormaps
    from matplotlib.colors import LightSource
    from PIL import Image

    relief = terrain.relief_mm
    step = -(-max(relief.shape) // _PIXELS_MAX)
    thinned = relief[::step, ::step]
    shaded = LightSource(315, 50).shade(thinned, colormaps["cividis"], blend_mode="soft", vert_exag=3.0)
    file = io.BytesIO()
    Image.fromarray((shaded[::-1, :, :3] * 255).astype(np.uint8)).save(file, "PNG")
    return f"data:image/png;base64,{base64.b64encode(file.getvalue()).decode()}"
