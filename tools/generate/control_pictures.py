"""Draw the picture of docs/control.md and write the heights behind it: one bubble, both laws, rubber as it is.

python tools/generate/control_pictures.py            # draw it, write the heights
python tools/generate/control_pictures.py --check    # fail if the heights are not those of the table

The picture is not compared: fonts differ from machine to machine. The heights are, to 0.01 mm.
"""

from functools import cache
from pathlib import Path

import generated
import numpy as np

from bubbleskin.bench.control.contenders import CONTENDERS, Contender
from bubbleskin.bench.control.plants import kind_named, sheet
from bubbleskin.plot.control import Track, plot_tracks
from bubbleskin.plot.save import save

PICTURE = Path("docs/pictures/control.png")
NUMBERS = Path("docs/pictures/control.csv")
PLANTS = ("real rubber", "μ × 1.5, real rubber")
HEIGHTS_MM = (8.0, 12.0, 7.0, 9.5, 6.0, 8.5)
HELD_S, EVERY_S = 5.0, 0.05
BUBBLE, SEED = 1, 3
LISTED = 25  # every so many of these points are in the table


def watch(contender: Contender) -> Track:
    rows = []
    for k, height in enumerate(HEIGHTS_MM):
        contender.show(np.full(len(contender.rest_mm), height))
        for j in range(round(HELD_S / EVERY_S)):
            contender.run(EVERY_S)
            told = contender.told().height_mm[BUBBLE]
            rows.append((k * HELD_S + (j + 1) * EVERY_S, height, contender.board.alone_mm[BUBBLE], told))
    return Track(*np.array(rows).T)


@cache
def tracks() -> dict[str, dict[str, Track]]:
    return {
        plant: {name: watch(make(sheet(kind_named(plant), SEED))) for name, make in CONTENDERS.items()}
        for plant in PLANTS
    }


def numbers() -> str:
    rows = ["plant,contender,s,asked mm,true mm,told mm"]
    for plant, by_contender in tracks().items():
        for name, track in by_contender.items():
            points = np.column_stack(track)[LISTED - 1 :: LISTED]
            rows += [f'"{plant}",{name},{t:.2f},{asked:g},{true:.2f},{told:.2f}' for t, asked, true, told in points]
    return "\n".join(rows) + "\n"


if __name__ == "__main__":
    generated.main({NUMBERS: numbers}, {PICTURE: lambda path: save(plot_tracks(tracks()), path)})
