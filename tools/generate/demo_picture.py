"""Draw the README's picture: what `bubbleskin demo` draws, and the heights behind it as a table.

python tools/generate/demo_picture.py            # draw it, write the table
python tools/generate/demo_picture.py --check    # fail if the heights are not those of the table
"""

from functools import cache
from pathlib import Path

import generated

import bubbleskin as bs
from bubbleskin.demo import DEMO, Show, watch
from bubbleskin.plot.array import draw_shows

PICTURE = Path("docs/pictures/demo.png")
NUMBERS = Path("docs/pictures/demo.csv")


@cache
def shows() -> tuple[bs.Layout, list[Show]]:
    with bs.connect("sim://wristband7") as skin:
        return skin.layout, [watch(skin, title, shape(skin.layout), lambda *_: None) for title, shape in DEMO.items()]


def numbers() -> str:
    rows = ["shape,bubble,asked mm,true mm"]
    for show in shows()[1]:
        asked, true = show.states[-1].target_mm, show.height_mm[-1]
        rows += [f"{show.title},{i},{asked[i]:.2f},{true[i]:.1f}" for i in range(len(asked))]
    return "\n".join(rows) + "\n"


if __name__ == "__main__":
    generated.main({NUMBERS: numbers}, {PICTURE: lambda path: draw_shows(path, *shows(), (5.0, 14.0))})
