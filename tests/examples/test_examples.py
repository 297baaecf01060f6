"""Every example runs on a simulated wristband, and says what it should; the page and the README name them."""

import io
import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
SAYS = {
    "01_first_shape": r"The middle is at 1[12]\.\d mm, its neighbours are at 7\.\d mm\.\n",
    "02_from_a_formula": r"The dome is at -15 mm, bubble 5 (.*\n)*.* \+0 mm, bubble 0 (.*\n)*.* bubble 2 is the highest\.\n",
    "03_watch": r"( *\d+\.\d\d){7} moving\n(.*\n){10,40}( *\d+\.\d\d){7} (settled|unsure)\n",
    "04_sequence": r"16 steps in \d\.\d s\n",
    "05_order_matters": r"pop-up: the middle is truly at 11\.[789] mm\nflat twin: the middle is truly at 11\.[01] mm\n",
    "06_pattern": r"\(\(ripple\(\)\.slow\(2\) \* 0\.5\) \+ \(wave\(\)\.rotate\(30\) \* 0\.5\)\): \d+ steps, within 0\.1 mm\n",
    "07_terrain": r"(\(\d+, \d+\) mm: contrast \d\.\d mm, \d+ steps of \d\.\d\d mm; .* apart\n){5}",
    "08_buttons": r"lamp on\nbrightness 1 of 6\nbrightness 2 of 6\nbrightness 3 of 6\nbubbles 0, 1, 2 and 3 are up\n",
    "09_record": r"(bubble \d was highest after \d\.\d\d s\n){7}",
    "10_notification_light": r"felt: mail from Ada\n",
}
"""What each prints on a simulated wristband of seven bubbles."""


@pytest.mark.medium
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_does_what_it_says(path, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", [str(path), "sim://wristband7"])
    monkeypatch.setattr("sys.stdin", io.StringIO("mail from Ada\n"))
    runpy.run_path(str(path), run_name="__main__")
    said = capsys.readouterr()
    assert re.fullmatch(SAYS[path.stem], said.out), said.out
    assert said.err == ""


def test_there_are_ten_and_all_are_on_the_page():
    page = (ROOT / "docs/examples.md").read_text(encoding="utf-8")
    assert re.findall(r"\]\(\.\./examples/(\w+)\.py\)", page) == [path.stem for path in EXAMPLES] == list(SAYS)


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short(path):
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 30
