"""What a calibration is worth: true heights of simulated sheets before and after `skin.calibrate()`, as one table.

    python tools/report/calibration.py
    python tools/report/calibration.py --sheets 4 --shows 5 --json
    python tools/report/calibration.py --sheets 7 --alone                 # each bubble by itself, as after a swap
    python tools/report/calibration.py --tables ecoflex-00-30 --extra sheet=ecoflex-00-30

Each sheet is real rubber with everything ± 10 % (`docs/simulator.md`), fresh from the mould, its bubbles apart: no sheet, gas,
valve or sensor is what the calibration's model has. The same random shapes from 5.5 to 13 mm are asked before and after, two in
ten for a minute, the others for ten seconds. Heights of bubbles that were emptied on their way, to know their air afresh, are
left out of errors at 0.6 s. The same arguments give the same values.
"""

import argparse
import json
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

import bubbleskin as bs
from bubbleskin.cli.options import progress_of_parts

LOW_MM, HIGH_MM = 5.5, 13.0
TIMES_S = (0.6, 10.0, 60.0)
LONG_EVERY = 5
NEAR_MM, WRONG_MM, EMPTY_MM = 0.25, 0.5, 0.3
URL = "sim://{board}?spread=0.1&rubber=real&contact=0&seed={seed}"


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--sheets", type=int, default=10)
    parser.add_argument("--shows", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1, help="the first sheet's")
    parser.add_argument("--board", default="wristband7")
    parser.add_argument("--extra", default="", help="more of the URL, such as atmosphere_kpa=84")
    parser.add_argument("--alone", action="store_true", help="calibrate each bubble by itself")
    parser.add_argument("--tables", help="a preset whose tables are uploaded first")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    console = Console(stderr=True)
    before: list[dict[str, Any]] = []
    after: list[dict[str, Any]] = []
    facts: list[dict[str, Any]] = []
    with progress_of_parts(console) as bar:
        task = bar.add_task("sheets", total=given.sheets)
        for seed in range(given.seed, given.seed + given.sheets):
            url = URL.format(board=given.board, seed=seed) + ("&" + given.extra if given.extra else "")
            before += list(_shows(url, seed, given, None))
            after += list(_shows(url, seed, given, facts))
            bar.advance(task)
    report = {"before": _figures(before), "after": _figures(after), "sheets": given.sheets} | _of_calibrations(facts)
    if given.json:
        print(json.dumps(report, indent=2))
        return 0
    _print(report)
    return 0


def _shows(
    url: str, seed: int, given: argparse.Namespace, facts: list[dict[str, Any]] | None
) -> Iterator[dict[str, Any]]:
    rng = np.random.default_rng((seed, 14))
    with bs.connect(url) as skin:
        skin.sleep(1.0)
        if given.tables:
            skin.upload_tables(bs.build_table(bs.preset(given.tables)))
        if facts is not None:
            for bubble in range(skin.info.bubbles) if given.alone else [None]:
                found = skin.calibrate(bubble, save=False)
                facts.append(
                    {"seconds": found.device_s, "accepted": len(found.accepted), "bubbles": len(found.bubbles)}
                )
        for number in range(given.shows):
            target = rng.uniform(LOW_MM, HIGH_MM, skin.info.bubbles)
            yield from _one(skin, target, TIMES_S if number % LONG_EVERY == 0 else TIMES_S[:2])
            if skin.faults():
                skin.vent()
                skin.clear_faults()


def _one(skin: bs.Skin, target: NDArray[np.float64], moments: tuple[float, ...]) -> Iterator[dict[str, Any]]:
    board = skin.simulated
    assert board is not None
    low = min(float(board.alone_mm.min()), float(target.min()))
    skin.show(target, wait=False)
    lowest = board.alone_mm
    passed = 0.0
    while passed < moments[0] - 1e-9:
        skin.sleep(0.02)
        passed += 0.02
        lowest = np.minimum(lowest, board.alone_mm)
    emptied = (lowest < skin.info.height_rest_mm + EMPTY_MM) & (low > skin.info.height_rest_mm + 2 * EMPTY_MM)
    for moment in moments:
        skin.sleep(moment - passed) if moment > passed else None
        passed = moment
        state = skin.state()
        true = board.alone_mm
        faulty = np.array([bool(found) for found in state.faults])
        yield {
            "moment": moment,
            "off": (true - target)[~(faulty | emptied & (moment < 1.0))],
            "told": np.abs(state.height_mm - true)[~faulty]
            / (state.sd_mm if state.sd_mm is not None else np.inf)[~faulty],
            "settled_off": np.abs(true - target)[np.array(state.status) == "settled"],
            "bubbles": len(true),
            "faulty": int(faulty.sum()),
        }


def _figures(rows: list[dict[str, Any]]) -> dict[str, Any]:
    off = {m: np.concatenate([row["off"] for row in rows if row["moment"] == m]) for m in TIMES_S}
    every = np.concatenate(list(off.values()))
    told = np.concatenate([row["told"] for row in rows])
    settled = np.concatenate([row["settled_off"] for row in rows])
    return {
        "rms_mm": [float(np.sqrt(np.mean(one**2))) for one in off.values()],
        "largest_mm": float(np.abs(every).max()),
        "within_0.25_mm": float((np.abs(every) <= NEAR_MM).mean()),
        "95 %_mm": float(np.percentile(np.abs(every), 95)),
        "within_2_sd": float((told <= 2).mean()),
        "settled": len(settled) / sum(row["bubbles"] for row in rows),
        "settled_wrong": float((settled > WRONG_MM).mean()) if len(settled) else 0.0,
        "faulty": sum(row["faulty"] for row in rows),
    }


def _of_calibrations(facts: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "device_s": max(one["seconds"] for one in facts),
        "accepted": sum(one["accepted"] for one in facts),
        "bubbles": sum(one["bubbles"] for one in facts),
    }


def _print(report: dict[str, Any]) -> None:
    table = Table("true heights, mm", "goal", "nobody has calibrated", "calibrated", title_justify="left")
    before, after = report["before"], report["after"]

    def row(name: str, goal: str, key: str, shown: str) -> None:
        table.add_row(name, goal, shown.format(before[key]), shown.format(after[key]))

    times = " / ".join(f"{moment:g}" for moment in TIMES_S)
    rms = [" / ".join(f"{one:.3f}" for one in figures["rms_mm"]) for figures in (before, after)]
    table.add_row(f"RMS at {times} s", "≤ 0.12", *rms)
    row("95 % are within", "0.25", "95 %_mm", "{:.3f}")
    row("within 0.25 mm", "95 %", "within_0.25_mm", "{:.1%}")
    row("largest", "", "largest_mm", "{:.2f}")
    row("told within 2 sd", "90 to 99 %", "within_2_sd", "{:.1%}")
    row("settled", "", "settled", "{:.1%}")
    row("of these more than 0.5 mm off", "≤ 1 %", "settled_wrong", "{:.2%}")
    row("looks at bubbles with a fault", "0", "faulty", "{}")
    console = Console()
    console.print(table)
    console.print(
        f"{report['sheets']} sheets, {report['accepted']} of {report['bubbles']} bubbles accepted, "
        f"at most {report['device_s']:.1f} s of device time.",
        highlight=False,
    )


if __name__ == "__main__":
    sys.exit(main())
