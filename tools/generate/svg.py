"""A pen for drawings of blocks with pins and wires between them, as SVG: the same input gives the same bytes."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from xml.sax.saxutils import escape

ROW = 20
"""px from one pin to the next."""
HEAD = 40
"""px of a block above its first pin: title and what stands below it."""
COLOURS = {"analog": "#0b7285", "bus": "#1c4fa8", "valve": "#a3450b", "stop": "#b3122f", "air": "#3b6d11"}
"""By kind of wire. All have a contrast of more than 5 on white, and no drawing is read by colour alone."""
STYLE = (
    "text{font:12px system-ui,sans-serif;fill:#1b1b1b}.title{font-weight:600;font-size:13px}.under{font-size:11px;fill:#444}"
    ".block{fill:#f6f7f9;stroke:#555}.wire{fill:none;stroke-width:1.6}"
)


@dataclass(frozen=True)
class Pin:
    """A pin of a block: its row, counted over the whole drawing, and what is written beside it."""

    row: int
    text: str


@dataclass
class Block:
    """A part with pins at its left and right."""

    title: str
    under: str
    x: int
    width: int
    left: list[Pin] = field(default_factory=list)
    right: list[Pin] = field(default_factory=list)

    @property
    def rows(self) -> tuple[int, int]:
        """The first and the last row with a pin."""
        rows = [pin.row for pin in (*self.left, *self.right)]
        return min(rows), max(rows)

    def draw(self) -> list[str]:
        """Its box, its words, its pins."""
        first, last = self.rows
        top, height = y_of(first) - HEAD, (last - first) * ROW + HEAD + ROW / 2
        lines = [f'<rect class="block" x="{self.x}" y="{top}" width="{self.width}" height="{height:g}" rx="4"/>']
        middle = self.x + self.width / 2
        lines.append(text(middle, top + 15, self.title, "middle", "title"))
        lines.append(text(middle, top + 28, self.under, "middle", "under"))
        lines += [text(self.x + 6, y_of(pin.row) + 4, pin.text) for pin in self.left]
        lines += [text(self.x + self.width - 6, y_of(pin.row) + 4, pin.text, "end") for pin in self.right]
        return lines


def y_of(row: int) -> int:
    """Where a row is, px from the top."""
    return 60 + row * ROW


def text(x: float, y: float, words: str, anchor: str = "start", kind: str = "") -> str:
    """Words at a place."""
    named = f' class="{kind}"' if kind else ""
    return f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}"{named}>{escape(words)}</text>'


def line(points: Iterable[tuple[float, float]], kind: str) -> str:
    """A wire through points."""
    path = " ".join(f"{x:g},{y:g}" for x, y in points)
    return f'<polyline class="wire" stroke="{COLOURS[kind]}" points="{path}"/>'


def straight(one: Block, other: Block, rows: Iterable[int], kind: str) -> list[str]:
    """Wires from the right of one block to the left of another, in the same row."""
    return [line([(one.x + one.width, y_of(row)), (other.x, y_of(row))], kind) for row in rows]


def trunk(x: float, right_of: list[tuple[Block, int]], left_of: list[tuple[Block, int]], kind: str) -> list[str]:
    """One net with a vertical part at `x`: from the right of some blocks to the left of others, each at a row."""
    ends = [(block.x + block.width, y_of(row)) for block, row in right_of]
    ends += [(block.x, y_of(row)) for block, row in left_of]
    low, high = min(y for _, y in ends), max(y for _, y in ends)
    lines = [line([(x, low), (x, high)], kind)] if high > low else []
    for end_x, y in ends:
        lines.append(line([(end_x, y), (x, y)], kind))
        if high > low and (low < y < high or [other for _, other in ends].count(y) > 1):
            lines.append(f'<circle cx="{x:g}" cy="{y}" r="3" fill="{COLOURS[kind]}"/>')
    return lines


def drawing(title: str, description: str, size: tuple[int, int], content: Iterable[str]) -> str:
    """The file: on white, so that it is read on a dark page as well."""
    width, height = size
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}"',
            'role="img">',
            f"<title>{escape(title)}</title>",
            f"<desc>{escape(description)}</desc>",
            f"<style>{STYLE}</style>",
            f'<rect width="{width}" height="{height}" rx="8" fill="#fff"/>',
            *content,
            "</svg>\n",
        ]
    )
