"""Draw the pictures of docs/contact.md and docs/sequences.md, and the heights behind figure 5 as a table.

python tools/generate/contact_pictures.py            # draw them, write the table
python tools/generate/contact_pictures.py --check    # fail if the model's heights are not those of the table
"""

import sys
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


def draw() -> None:
    membrane.save(contact.plot_order(shapes()), generated.ROOT / PICTURES / "contact_order.png")
    model = bs.CompliantContact(bs.Layout.hexagon(rings=1))
    found = bs.plan(PLANNED, model.layout, contact=model)
    membrane.save(contact.plot_plan(found, model), generated.ROOT / PICTURES / "contact_plan.png")
    with bs.connect("sim://wristband7") as skin:
        frames = watch(skin, bs.sequences.pulse(skin.layout, loops=1), rate=10)
        animate(skin.layout, frames, generated.ROOT / PICTURES / "pulse.gif", title="pulse")
    print("drew contact_order.png, contact_plan.png and pulse.gif")


if __name__ == "__main__":
    if "--check" not in sys.argv:
        draw()
    generated.main({PICTURES / "contact_order.csv": numbers})
