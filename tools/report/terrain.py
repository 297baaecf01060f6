"""How well a wristband follows a pointer over a terrain: its true heights, held against those that are asked, 30 times a second.

python tools/report/terrain.py [--device URL] [--seconds 6] [--speed 20]
"""

import argparse

import numpy as np

import bubbleskin as bs
from bubbleskin.demonstrations.landscapes import LANDSCAPES
from bubbleskin.demonstrations.pointer import PATHS, RATE_HZ, SPEED_MM_S, Pointer, follow
from bubbleskin.demonstrations.terrain import MODES, Terrain

SKIPPED = 0.2  # seconds of the pointer's start: it begins at once, a hand does not


def errors(url: str, name: str, mode: str, path: str, speed: float, seconds: float) -> np.ndarray:
    """True minus asked at the end of each period, mm, (moments, n)."""
    with bs.connect(url) as skin:
        terrain = Terrain.named(name, skin.layout)
        pointer = Pointer(PATHS[path](terrain), speed)
        off = [
            skin.simulated.height_mm - moment.heights_mm
            for moment in follow(skin, terrain, pointer, mode=mode, seconds=seconds)
            if moment.time > SKIPPED
        ]
    return np.array(off)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="sim://wristband7")
    parser.add_argument("--seconds", type=float, default=6.0)
    parser.add_argument("--speed", type=float, default=SPEED_MM_S)
    asked = parser.parse_args()
    print(f"{asked.device}, pointer at {asked.speed:g} mm/s, {RATE_HZ:g} shapes a second; true minus asked, mm")
    print("terrain    mode        path     RMS   95 %    max")
    every = []
    for name in LANDSCAPES:
        for mode in MODES:
            for path in PATHS:
                off = np.abs(errors(asked.device, name, mode, path, asked.speed, asked.seconds))
                every.append(off.ravel())
                print(f"{name:10} {mode:11} {path:8} {_row(off)}", flush=True)
    print(f"{'all':31} {_row(np.concatenate(every))}")


def _row(off: np.ndarray) -> str:
    return f"{np.sqrt(np.mean(off**2)):.3f}  {np.quantile(off, 0.95):.3f}  {off.max():.3f}"


if __name__ == "__main__":
    main()
