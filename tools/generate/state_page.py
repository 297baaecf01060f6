"""Write the drawing of the board's states into `docs/safety.md`, from the table that the firmware uses.

python tools/generate/state_page.py            # write it
python tools/generate/state_page.py --check    # fail if it is not what would be written
"""

from pathlib import Path

import generated

from bubble_firmware.safety import state
from bubble_protocol.schema import modes

PATH = Path("docs/safety.md")
BEGIN, END = "<!-- states: made by tools/generate/state_page.py -->\n", "<!-- end of states -->\n"

EVENTS = (
    (state.TESTED, "self-test over"),
    (state.SHOW, "SHOW"),
    (state.STOP, "STOP"),
    (state.VENT, "VENT"),
    (state.DEPRESSURISED, "no pressure left"),
    (state.HOST_QUIET, "host silent, moving"),
    (state.HOST_SILENT, "host silent for long"),
    (state.EXCEPTION, "exception"),
    (state.BOARD_FAULT, "fault of the board"),
    (state.ESTOP, "emergency stop"),
    (state.CLEAR, "CLEAR"),
)

NAMES = {number: name for number, name, _ in modes.MODES}


def changes() -> dict[tuple[int, int], list[str]]:
    """For each (from, to) that differ, the events that lead from one to the other."""
    found: dict[tuple[int, int], list[str]] = {}
    for event, text in EVENTS:
        for mode in NAMES:
            board = state.SafetyState.__new__(state.SafetyState)
            board.mode = mode
            if board.handle(event):
                found.setdefault((mode, board.mode), []).append(text)
    return found


def drawing() -> str:
    """A mermaid diagram and the same as a table."""
    arrows = changes()
    lines = ["```mermaid", "stateDiagram-v2", "    [*] --> boot"]
    lines += [f"    {NAMES[one]} --> {NAMES[other]}: {', '.join(events)}" for (one, other), events in arrows.items()]
    lines += ["```", "", "| state | what | " + " | ".join(text for _, text in EVENTS) + " |"]
    lines += ["|---" * (2 + len(EVENTS)) + "|"]
    for number, name, meaning in modes.MODES:
        cells = []
        for event, _ in EVENTS:
            board = state.SafetyState.__new__(state.SafetyState)
            board.mode = number
            cells.append(NAMES[board.mode] if board.handle(event) else "")
        lines.append(f"| **{name}** | {meaning} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def page() -> str:
    """The page with the drawing of today."""
    text = (generated.ROOT / PATH).read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    return before + BEGIN + "\n" + drawing() + "\n" + END + rest.split(END)[1]


if __name__ == "__main__":
    generated.main({PATH: page})
