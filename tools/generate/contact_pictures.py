"""Draw the pictures of docs/contact.md and docs/sequences.md, and the heights behind figure 5 as a table.

python tools/generate/contact_pictures.py            # draw them, write the table
python tools/generate/contact_pictures.py --check    # fail if the model's heights are not those of the table
"""

from functools import cache
from pathlib import Path

import generated

import bubbleskin as bs
from bubbleskin.contact.model import Shape
from bubbleskin.plot import contact, membrane
from bubbleskin.plot.sequence import animate, watch

PICTURES = Path("docs/pictures")
PLANNED = [13.9, 11.88, 11.88, 11.88, 11.88, 11.88, 11.88]


@cache
def shapes() -> dict[str, Shape]:
    return contact.orders()


def numbers() -> str:
    rows = ["order,bubble,height mm", *map(",".join, contact.numbers(shapes()))]
    return "\n".join(rows) + "\n"


def draw_order(path: Path) -> None:
    membrane.save(contact.plot_order(shapes()), path)


def draw_plan(path: Path) -> None:
    model = bs.CompliantContact(bs.Layout.hexagon(rings=1))
    membrane.save(contact.plot_plan(bs.plan(PLANNED, model.layout, contact=model), model), path)


def draw_pulse(path: Path) -> None:
    with bs.connect("sim://wristband7") as skin:
        frames = watch(skin, bs.sequences.pulse(skin.layout, loops=1), rate=10)
        animate(skin.layout, frames, path, title="pulse")


if __name__ == "__main__":
    drawn = {"contact_order.png": draw_order, "contact_plan.png": draw_plan, "pulse.gif": draw_pulse}
    pictures = {PICTURES / name: draw for name, draw in drawn.items()}
    generated.main({PICTURES / "contact_order.csv": numbers}, pictures)
