"""Bubbles and materials with a source."""

from __future__ import annotations

from dataclasses import dataclass

from bubbleskin.checks import shown
from bubbleskin.errors import InvalidInput
from bubbleskin.membrane.balloon import YeohBalloon


@dataclass(frozen=True)
class Preset:
    """A named bubble and where its material constants come from. All have the paper's rest sizes."""

    name: str
    balloon: YeohBalloon
    source: str


PRESETS: dict[str, Preset] = {
    preset.name: preset
    for preset in (
        Preset(
            "paper",
            YeohBalloon(mu=39.62e3, c2=417.3, c3=60.65),
            "The display paper's fit to one of its own inflated Ecoflex 00-30A bubbles (text below Eq. 7); "
            "there mu is called Young's modulus, in its Eq. 3 it is the shear modulus.",
        ),
        Preset(
            "ecoflex-00-30",
            YeohBalloon(mu=15.78e3, c2=91.8, c3=0.0),
            "Uniaxial tension of Ecoflex 00-30 up to stretch 3, fitted here with C3 >= 0 (a free fit gives "
            "C1 = 7.79 kPa, C2 = 127 Pa, C3 = -3.1 Pa). Data: L. Marechal et al., Soft Robotics 8 (2021), "
            "Soft Robotics Materials Database, ASTM D412 at 450 mm/min, open database licence.",
        ),
        Preset(
            "ecoflex-00-30-sorotoki",
            YeohBalloon(mu=34e3, c2=-200.0, c3=23.0),
            "Ecoflex 00-30 of the Sorotoki soft-robotics toolbox (B. Caasenbrood): C1 = 17 kPa, "
            "C2 = -0.2 kPa, C3 = 0.023 kPa.",
        ),
    )
}


def preset(name: str) -> YeohBalloon:
    """The balloon of the preset ``name``; its source is ``PRESETS[name].source``."""
    if not isinstance(name, str) or name not in PRESETS:
        raise InvalidInput(f"there is no preset {shown(name)}; there are {', '.join(PRESETS)}.")
    return PRESETS[name].balloon
