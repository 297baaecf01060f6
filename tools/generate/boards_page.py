"""Write into `docs/boards.md` what a board's file defines, from what is checked, and the example's file.

python tools/generate/boards_page.py            # write it
python tools/generate/boards_page.py --check    # fail if it is not what would be written
"""

from collections.abc import Sequence
from pathlib import Path

import generated

from bubbleskin.boards.fields import EXPANDER_FIELDS, FIELDS, Field

PATH = Path("docs/boards.md")
EXAMPLE = Path("docs/data/pad8.py")
BEGIN, END = "<!-- {}: made by tools/generate/boards_page.py -->\n", "<!-- end of {} -->\n"


def table(fields: Sequence[Field]) -> str:
    """Fields with what is allowed."""
    rows = [f"| `{field.name}` | {field.unit} | {field.allowed_text} | {field.meaning} |" for field in fields]
    return "\n".join(["| name | unit | allowed | meaning |", "|---|---|---|---|", *rows]) + "\n"


def page() -> str:
    """The page with the regions of today."""
    text = (generated.ROOT / PATH).read_text(encoding="utf-8")
    example = (generated.ROOT / EXAMPLE).read_text(encoding="utf-8")
    regions = {
        "example": f"```python\n{example}```\n",
        "numbers": table(FIELDS),
        "expander": table(EXPANDER_FIELDS),
    }
    for name, content in regions.items():
        begin, end = BEGIN.format(name), END.format(name)
        before, rest = text.split(begin)
        text = f"{before}{begin}\n{content}\n{end}{rest.split(end)[1]}"
    return text


if __name__ == "__main__":
    generated.main({PATH: page})
