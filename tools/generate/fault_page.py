"""Write the tables of faults into `docs/safety.md`: what each means, how it comes about and what to do, from the data.

python tools/generate/fault_page.py            # write them
python tools/generate/fault_page.py --check    # fail if they are not what would be written
"""

from pathlib import Path

import generated

from bubble_protocol.schema import faults
from bubbleskin.fault_guide import GUIDE

PATH = Path("docs/safety.md")
BEGIN, END = "<!-- {}: made by tools/generate/fault_page.py -->\n", "<!-- end of {} -->\n"
REGIONS = {"bubble faults": faults.FAULTS, "board faults": (*faults.BOARD_FAULTS, *faults.EVENTS)}


def table(rows: tuple[tuple[int, str, str], ...]) -> str:
    """Name, meaning, cause and remedy of each fault."""
    lines = ["| fault | what it means | how it comes about | what to do |", "|---|---|---|---|"]
    for _, name, meaning in rows:
        cause, remedy = GUIDE[name]
        lines.append(f"| `{name}` | {meaning} | {cause} | {remedy} |")
    return "\n".join(lines) + "\n"


def page() -> str:
    """The page with the tables of today."""
    text = (generated.ROOT / PATH).read_text(encoding="utf-8")
    for region, rows in REGIONS.items():
        before, rest = text.split(BEGIN.format(region))
        text = (
            before
            + BEGIN.format(region)
            + "\n"
            + table(rows)
            + "\n"
            + END.format(region)
            + rest.split(END.format(region))[1]
        )
    return text


if __name__ == "__main__":
    generated.main({PATH: page})
