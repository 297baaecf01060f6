"""Draw the picture of docs/calibration.md and write what is in it: a sheet of real rubber that has measured itself.

python tools/generate/calibration_picture.py            # draw it, write the figures
python tools/generate/calibration_picture.py --check    # fail if the figures are not those of the table

The picture is not compared: fonts differ from machine to machine. The figures are, to a hundredth.
"""

from functools import cache
from pathlib import Path

import generated

import bubbleskin as bs
from bubbleskin.plot.calibration import draw, save

PICTURE = Path("docs/pictures/calibration.png")
NUMBERS = Path("docs/pictures/calibration.csv")
URL = "sim://wristband7?spread=0.1&rubber=real&contact=0&seed=3"


@cache
def calibration() -> bs.SelfCalibration:
    with bs.connect(URL) as skin:
        skin.sleep(1.0)
        return skin.calibrate(save=False)


def numbers() -> str:
    rows = ["bubble,verdict,fill flow,vent flow"]
    for each in calibration().bubbles:
        fill, vent = (each.parameters[name][0] for name in ("fill_flow", "vent_flow"))
        rows.append(f"{each.bubble},{each.verdict.verdict},{fill:.2f},{vent:.2f}")
    return "\n".join(rows) + "\n"


if __name__ == "__main__":
    generated.main({NUMBERS: numbers}, {PICTURE: lambda path: save(draw(calibration()), path)})
