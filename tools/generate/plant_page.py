"""Write the tables of tolerances and of failures into `docs/simulator.md`, from those that the simulator has.

python tools/generate/plant_page.py            # write it
python tools/generate/plant_page.py --check    # fail if it is not what would be written
"""

from pathlib import Path

import generated

from bubbleskin.sim.failures import TABLE
from bubbleskin.sim.parameters import PlantParameters, Supply
from bubbleskin.sim.tolerances import IDEAL, REAL, SPRINGS, SUPPLY, SUPPLY_OFFSET, Tolerance

PATH = Path("docs/simulator.md")
BEGIN, END = "<!-- tolerances: made by tools/generate/plant_page.py -->\n", "<!-- end of tolerances -->\n"


FAIL_BEGIN, FAIL_END = "<!-- failures: made by tools/generate/plant_page.py -->\n", "<!-- end of failures -->\n"


def failures() -> str:
    """What can fail in which way, and what it does then."""
    lines = ["| part | how | what it does | on a real board |", "|---|---|---|---|"]
    for failure in TABLE:
        real = "" if failure.board is None else "✓"
        lines.append(f"| {failure.part} | {failure.how} | {failure.meaning} | {real} |")
    return "\n".join(lines) + "\n"


def between(text: str, begin: str, end: str, table: str) -> str:
    """The text with this table between its marks."""
    before, rest = text.split(begin)
    return before + begin + "\n" + table + "\n" + end + rest.split(end)[1]


def line(row: Tolerance, nominal: float, where: str) -> str:
    """One row of the table."""
    if row.absolute:
        amount = f"± {row.absolute:g}" + (", not below 0" if row.least == 0.0 else "")
    else:
        amount = f"{'factor ' if row.factor else '± '}{100 * row.share:g} %"
    return f"| `{row.name}` | {nominal:.6g} | {amount} | {where} | {row.meaning} |"


def table() -> str:
    """What differs, its nominal value in SI units, how much, and for which rubber."""
    one, supply = PlantParameters.nominal(1), Supply()
    lines = ["| figure | nominal | at 0.1 | of | |", "|---|---|---|---|---|"]
    lines += [line(row, getattr(one, row.name)[0], "both rubbers") for row in IDEAL]
    lines += [line(row, getattr(one, row.name)[0], "real rubber") for row in (*REAL, *SPRINGS)]
    lines.append(line(SUPPLY_OFFSET, supply.sensor_offset, "supply, both"))
    lines += [line(row, getattr(supply, row.name), "supply, real") for row in SUPPLY]
    return "\n".join(lines) + "\n"


def page() -> str:
    """The page with the tables of today."""
    text = (generated.ROOT / PATH).read_text(encoding="utf-8")
    return between(between(text, BEGIN, END, table()), FAIL_BEGIN, FAIL_END, failures())


if __name__ == "__main__":
    generated.main({PATH: page})
