"""A sweep as a picture: each figure of its task, wristband by wristband, by what varies."""

from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bubbleskin.errors import InvalidInput
from bubbleskin.sweeps.rows import figures, varied

_SPREAD = 0.28
"""Share of a group's room over which its points lie beside each other."""


def draw(rows: list[dict[str, Any]], name: str) -> Figure:
    """A panel for each figure: a dot for each wristband, a bar at the median of all with the same varied options."""
    columns = figures(rows)
    if not columns:
        raise InvalidInput(f"The sweep {name} has no figures to draw: its task failed on every wristband.")
    groups: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        groups.setdefault(", ".join(f"{key}={row[key]}" for key in varied(rows)) or "all", []).append(row)
    picture = Figure(figsize=(max(5.0, 1.6 * len(groups) + 2), 2.4 * len(columns)), layout="constrained")
    FigureCanvasAgg(picture)
    random = np.random.default_rng(0)
    for axes, column in zip(picture.subplots(len(columns), 1, squeeze=False)[:, 0], columns, strict=True):
        for place, group in enumerate(groups.values()):
            values = np.array([row[column] for row in group if isinstance(row.get(column), float)])
            if values.size:
                beside = place + random.uniform(-_SPREAD, _SPREAD, values.size)
                axes.plot(beside, values, ".", color="#0a6f75", alpha=0.5)
                axes.hlines(np.median(values), place - 0.4, place + 0.4, color="black")
        axes.set(xticks=range(len(groups)), xticklabels=[], ylabel=column, xlim=(-0.6, len(groups) - 0.4))
        axes.grid(axis="y", alpha=0.3)
    axes.set_xticklabels(
        list(groups), rotation=20 if len(groups) > 3 else 0, ha="right" if len(groups) > 3 else "center"
    )
    picture.suptitle(f"{name}: a dot is a wristband, a bar the median", fontsize=11)
    return picture
