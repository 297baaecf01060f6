"""Draw the pictures of docs/membrane.md, write the numbers behind them and the simulated measurements.

python tools/generate/membrane_pictures.py            # draw them, write the numbers
python tools/generate/membrane_pictures.py --check    # fail if the numbers are not those that were drawn

Pictures are not compared: fonts differ from machine to machine. The numbers are, as text: what every line
of a picture shows, to five digits.
"""

from functools import cache
from pathlib import Path

import generated
import numpy as np
from matplotlib.figure import Figure

import bubbleskin as bs
from bubbleskin.membrane import Measurements
from bubbleskin.membrane.data import to_csv
from bubbleskin.plot import membrane

PICTURES = Path("docs/pictures")
DATA = Path("docs/data")
MISREAD = "μ read as C1: 79.24 kPa"
POINTS_SHOWN = 40  # of a longer line, evenly taken


@cache
def figures() -> dict[str, Figure]:
    balloons = {
        "the paper's fit, μ = 39.62 kPa": bs.YeohBalloon(),
        "μ = 60 kPa": bs.YeohBalloon(mu=60e3),
        MISREAD: bs.YeohBalloon(mu=79.24e3),
    }
    return {
        "membrane_curve": membrane.plot_curve(balloons),
        "membrane_figure4": membrane.figure_4()[0],
        "membrane_figure6": membrane.figure_6()[0],
        "membrane_table": membrane.plot_table(bs.build_table(bs.YeohBalloon())),
    }


def numbers(name: str) -> str:
    rows = ["axes,line,label,x,y"]
    for a, axes in enumerate(figures()[name].axes):
        for k, line in enumerate(axes.lines):
            label = str(line.get_label())
            x, y = (np.asarray(line.get_data()[i], dtype=float) for i in (0, 1))
            shown = np.unique(np.linspace(0, x.size - 1, min(x.size, POINTS_SHOWN)).astype(int)) if x.size else []
            name_or_none = "" if label.startswith("_") else f'"{label}"'
            rows += [f"{a},{k},{name_or_none},{x[i]:.5g},{y[i]:.5g}" for i in shown]
    return "\n".join(rows) + "\n"


def measurements(made: Measurements, what: str) -> str:
    return to_csv(made, comments=["Simulated, not measured: " + what, made.source])


if __name__ == "__main__":
    files = {PICTURES / f"{name}.csv": (lambda name=name: numbers(name)) for name in figures()}
    files[DATA / "single_bubble.csv"] = lambda: measurements(
        membrane.figure_4()[1], "one bubble at 15 heights, three times each, as in the paper's Fig. 4"
    )
    files[DATA / "sheet.csv"] = lambda: measurements(
        membrane.figure_6()[1], "seven bubbles of one sheet at rising pressures, three times each, as in Fig. 6"
    )
    pictures = {
        PICTURES / f"{name}.png": (lambda path, figure=figure: membrane.save(figure, path))
        for name, figure in figures().items()
    }
    generated.main(files, pictures)
