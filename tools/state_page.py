"""Write the drawing of the board's states into `docs/safety.md`, from the table that the firmware uses.

python tools/state_page.py            # write it
python tools/state_page.py --check    # fail if it is not what would be written
"""

from pathlib import Path

import generated
from bubble_firmware import safety
from bubble_protocol import messages

PATH = Path("docs/safety.md")
BEGIN, END = "<!-- states: made by tools/state_page.py -->\n", "<!-- end of states -->\n"

NAMES = {number: name for number, name, _ in messages.MODES}


def changes() -> dict[tuple[int, int], list[str]]:
    """For each (from, to) that differ, the events that lead from one to the other."""
    found: dict[tuple[int, int], list[str]] = {}
    for event, text in safety.EVENTS:
        for mode in NAMES:
            state = safety.Safety.__new__(safety.Safety)
            state.mode = mode
            if state.take(event):
                found.setdefault((mode, state.mode), []).append(text)
    return found


def drawing() -> str:
    """A mermaid diagram and the same as a table."""
    arrows = changes()
    lines = ["```mermaid", "stateDiagram-v2", "    [*] --> boot"]
    lines += [f"    {NAMES[one]} --> {NAMES[other]}: {', '.join(events)}" for (one, other), events in arrows.items()]
    lines += ["```", "", "| state | what | " + " | ".join(text for _, text in safety.EVENTS) + " |"]
    lines += ["|---" * (2 + len(safety.EVENTS)) + "|"]
    for number, name, meaning in messages.MODES:
        cells = []
        for event, _ in safety.EVENTS:
            state = safety.Safety.__new__(safety.Safety)
            state.mode = number
            cells.append(NAMES[state.mode] if state.take(event) else "")
        lines.append(f"| **{name}** | {meaning} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def page() -> str:
    """The page with the drawing of today."""
    text = (generated.ROOT / PATH).read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    return before + BEGIN + "\n" + drawing() + "\n" + END + rest.split(END)[1]


if __name__ == "__main__":
    generated.main({PATH: page})
