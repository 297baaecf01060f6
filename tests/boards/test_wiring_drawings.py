"""The drawings of docs/wiring.md: every wire can be followed, to where the board's file has it."""

import re
from collections import Counter, defaultdict
from itertools import combinations, pairwise
from pathlib import Path
from xml.etree import ElementTree

import pytest

from bubble_firmware import boards

PICTURES = Path(__file__).parents[2] / "docs" / "pictures"
BOARDS = ("wristband7", "wristband19")
SIDES = ("valves", "sensors")
SVG = "{http://www.w3.org/2000/svg}"


class Drawing:
    """What is in a file, by where it is."""

    def __init__(self, name: str):
        root = ElementTree.parse(PICTURES / f"wiring_{name}.svg").getroot()
        _, _, self.width, self.height = map(int, root.get("viewBox").split())
        self.texts = [
            (float(t.get("x")), float(t.get("y")), t.text, t.get("text-anchor")) for t in root.iter(f"{SVG}text")
        ]
        self.dots = {(float(dot.get("cx")), float(dot.get("cy"))) for dot in root.iter(f"{SVG}circle")}
        self.segments = []
        for wire in root.iter(f"{SVG}polyline"):
            points = [tuple(map(float, point.split(","))) for point in wire.get("points").split()]
            self.segments += [tuple(sorted(pair)) for pair in pairwise(points) if pair[0] != pair[1]]

    def nets(self) -> list[Counter]:
        """The words of all pins that hang together: wires that share an end, or meet at a dot."""
        groups: list[set] = []
        for segment in self.segments:
            touching = [group for group in groups if any(self._joined(segment, other) for other in group)]
            groups = [group for group in groups if group not in touching] + [set().union({segment}, *touching)]
        return [Counter(self._pin(end) for segment in group for end in segment if self._pin(end)) for group in groups]

    def _joined(self, one, other) -> bool:
        return bool(set(one) & set(other)) or any(_on(dot, one) and _on(dot, other) for dot in self.dots)

    def _pin(self, end) -> str:
        """The words beside a wire's end, inside the block that it ends at."""
        x, y = end
        for at, below, words, anchor in self.texts:
            if below == y + 4 and at - x == {"start": 6, "end": -6}.get(anchor):
                return words
        return ""


def _on(point, segment) -> bool:
    (x, y), ((x0, y0), (x1, y1)) = point, segment
    return x0 <= x <= x1 and min(y0, y1) <= y <= max(y0, y1) and (x0 == x1 == x or y0 == y1 == y)


def overlap(one, other) -> bool:
    """Whether two wires lie on each other for a stretch: nobody could tell them apart."""
    (ax, ay), (bx, by) = one
    (cx, cy), (dx, dy) = other
    if ay == by == cy == dy:
        return min(bx, dx) > max(ax, cx)
    return ax == bx == cx == dx and min(max(ay, by), max(cy, dy)) > max(min(ay, by), min(cy, dy))


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("name", BOARDS)
def test_no_wire_lies_on_another_and_all_is_in_the_picture(name, side):
    drawing = Drawing(f"{name}_{side}")
    assert [pair for pair in combinations(drawing.segments, 2) if overlap(*pair)] == []
    assert all(0 < x < drawing.width and 0 < y < drawing.height for segment in drawing.segments for x, y in segment)
    for x, y, words, anchor in drawing.texts:
        length = 6.5 * len(words)  # px, of a 12 px font
        assert x + {"start": length, "middle": length / 2, "end": 0}[anchor] < drawing.width, words
        assert 0 < y < drawing.height


@pytest.mark.parametrize("name", BOARDS)
def test_every_bubble_has_its_converter_and_its_valves(name):
    board = boards.load(name)
    valves, sensors = Drawing(f"{name}_valves"), Drawing(f"{name}_sensors")
    reached = [words for net in valves.nets() for words in net if re.match(r"fill|vent", words)]
    wanted = [f"{what} {n}, {kind}" for n in range(board.BUBBLES) for what, kind in (("fill", "NC"), ("vent", "NO"))]
    assert sorted(reached) == sorted(wanted)
    channels = [words for net in sensors.nets() if any(w.startswith("bubble") for w in net) for words in net]
    ends = [channel for _, count in board.CONVERTERS for channel in range(count)]
    assert [words for words in channels if words.startswith("CH")] == [f"CH{n} {n + 1}" for n in ends]


def gpio(drawing) -> dict[int, Counter]:
    """What hangs on each GPIO."""
    found = defaultdict(Counter)
    for net in drawing.nets():
        for words in net:
            if at := re.match(r"GPIO (\d+), pin", words):
                found[int(at[1])] += Counter({other: n for other, n in net.items() if other != words})
    return found


def test_the_smaller_boards_wires_lead_where_its_file_says():
    board = boards.load("wristband7")
    valves, sensors = gpio(Drawing("wristband7_valves")), gpio(Drawing("wristband7_sensors"))
    assert valves[board.PIN_DISABLE] == {"/OE 1, 19": 2}
    assert valves[0] == {"A1 2": 1}
    assert valves[8] == {"A1 2": 1}
    assert set(valves) == {*range(14), board.PIN_PUMP, board.PIN_DUMP, board.PIN_DISABLE}
    selects = [select for select, _ in board.CONVERTERS]
    lines = [board.PIN_SCK, board.PIN_MOSI, board.PIN_MISO, board.PIN_SUPPLY, board.PIN_ESTOP]
    assert set(sensors) == {*lines, *selects}


def test_the_larger_boards_wires_lead_where_its_file_says():
    board = boards.load("wristband19")
    valves, sensors = Drawing("wristband19_valves"), Drawing("wristband19_sensors")
    chips = len(board.DRIVERS)
    on = {number: {words: n for words, n in net.items() if n > 1} for number, net in gpio(valves).items()}
    assert on[board.PIN_SDA] == {"SDA 27": chips}
    assert on[board.PIN_SCL] == {"SCL 26": chips}
    assert on[board.PIN_CLOCK] == {"EXTCLK 25": chips}
    assert on[board.PIN_DISABLE] == {"/OE 23": chips}
    nets = sensors.nets()
    assert {"CLK 13": 3, "1Y 3": 1} in nets
    assert {"DIN 11": 3, "2Y 6": 1} in nets
    assert {"DOUT 12": 3, "5 V": 1} in nets
    assert [net["CS 10"] for net in nets if net["CS 10"]] == [1, 1, 1]
    selects = [select for select, _ in board.CONVERTERS]
    assert set(selects) <= set(gpio(sensors))


def test_wires_on_each_other_are_found():
    assert overlap(((0, 1), (9, 1)), ((5, 1), (12, 1)))
    assert overlap(((3, 0), (3, 9)), ((3, 2), (3, 4)))
    assert not overlap(((0, 1), (9, 1)), ((9, 1), (12, 1)))
    assert not overlap(((0, 1), (9, 1)), ((5, 0), (5, 9)))
