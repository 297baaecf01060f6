"""The demonstrations in a terminal: a terrain with the wristband on it, and buttons."""

import numpy as np
from rich.columns import Columns
from rich.console import Group, RenderableType
from rich.text import Text

from bubbleskin.demonstrations.buttons import Buttons
from bubbleskin.demonstrations.pointer import Moment
from bubbleskin.demonstrations.terrain import Patch, Terrain
from bubbleskin.plot.terminal import from_above, shade

_COLUMNS = 44
"""Of a map in the terminal; half a character is as high as a whole one is wide."""
_UPPER_HALF = "▀"


def draw_terrain(terrain: Terrain, moment: Moment, patch: Patch) -> RenderableType:
    """The map with the bubbles at one moment, the heights that they are asked, and in words what can be felt there."""
    beside = from_above(terrain.layout, moment.heights_mm, (terrain.low_mm, terrain.high_mm))
    place = f"{terrain.name} at ({moment.x_mm:.0f}, {moment.y_mm:.0f}) mm"
    return Group(Columns([_map(terrain, moment), beside], padding=(0, 3)), Text(f"{place}: {patch}"))


def _map(terrain: Terrain, moment: Moment) -> Text:
    colours = _colours(terrain)
    size = np.array(terrain.size_mm)
    share = (terrain.layout.positions_mm + np.array([moment.x_mm, moment.y_mm])) / size
    columns = np.rint(share[:, 0] * (_COLUMNS - 1)).astype(int)
    rows = np.rint((1 - share[:, 1]) * (len(colours) - 1)).astype(int) // 2
    bubbles = set(zip(rows.tolist(), columns.tolist(), strict=True))
    text = Text()
    for row in range(len(colours) // 2):
        for column in range(_COLUMNS):
            upper, lower = colours[2 * row][column], colours[2 * row + 1][column]
            if (row, column) in bubbles:
                text.append("●", style=f"bold white on {lower}")
            else:
                text.append(_UPPER_HALF, style=f"{upper} on {lower}")
        text.append("\n")
    return text


def _colours(terrain: Terrain) -> list[list[str]]:
    """Of each half of a character, rows from the top."""
    relief = terrain.relief_mm
    wide, deep = terrain.size_mm
    rows = max(2, round(_COLUMNS * deep / wide / 2) * 2)
    down = np.linspace(relief.shape[0] - 1, 0, rows).round().astype(int)
    across = np.linspace(0, relief.shape[1] - 1, _COLUMNS).round().astype(int)
    limits = terrain.low_mm, terrain.high_mm
    return [[shade(height, limits) for height in row] for row in relief[np.ix_(down, across)]]


def draw_buttons(buttons: Buttons, said: str) -> RenderableType:
    """The bubbles from above, the one under the pointer underlined, and a line beneath."""
    limits = buttons.rest_mm, buttons.raised_mm
    return Group(from_above(buttons.layout, buttons.heights_mm, limits, marked=buttons.hovered), Text(said))
