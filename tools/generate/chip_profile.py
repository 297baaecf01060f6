"""Write the tables of the chip's profile in docs/chip.md and draw it, from what the bench with `--profile --write` left.

python tools/generate/chip_profile.py            # write them
python tools/generate/chip_profile.py --check    # fail if the tables are not what would be written
"""

from pathlib import Path

import generated

from bubbleskin.bench.profile_page import PAGE, page, read
from bubbleskin.plot.flame import plot_flames
from bubbleskin.plot.save import save

PICTURE = Path("docs/pictures/profile.png")


def draw(path: Path) -> None:
    found = ((f"{one.board}, {one.situation}", one.stacks) for one in read(generated.ROOT))
    save(plot_flames(found), path)


if __name__ == "__main__":
    generated.main({PAGE: lambda: page(generated.ROOT)}, {PICTURE: draw})
