"""The sequence editor in a real Chromium, by pointer and by keyboard; the plant's true heights say whether bubbles moved."""

import json

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe

import bubbleskin as bs

pytestmark = pytest.mark.slow

REST_MM = 5.0
EVERYTHING = bs.Sequence(
    [
        bs.Step([6.0] * 7, 0.4, "in", bs.Settled(0.3, 2.5, "hold"), "up"),
        bs.Repeat(
            [
                bs.Step([8.0, *[None] * 6], 0.3, "smooth", bs.After(0.1)),
                bs.Repeat([bs.Step([None, 7.5, *[None] * 5], 0.2), bs.Step([None] * 7, 0.1, "out", bs.After(0.05))], 3),
                bs.Step(None, until=bs.After(0.25), name="rest – “so”"),
            ],
            2,
        ),
        bs.Step([5.5] * 7, 0.25, until=bs.Settled(0.5, 1.0, "vent")),
    ],
    loops=2,
    name="everything there is",
    board="wristband7",
    layout=bs.Layout.hexagon(),
)


def short(*heights, name="short"):
    """All bubbles at each height, half a second each."""
    return bs.Sequence([bs.Step([height] * 7, 0.5, until=bs.After(0.1)) for height in heights], name=name)


@pytest.fixture
def edit(studio, visit):
    """`edit(sequence)`: a page that edits it, as a file that was opened."""

    def open_page(sequence, **file):
        page = visit("sequence")
        studio.studio.desk.editor.timeline.rows_are = "bubbles"  # whatever the test before has left
        upload(page, sequence.to_json(), **file)
        assert studio.until(lambda: edited(studio) == sequence)
        page.wait_for_function("n => document.querySelectorAll('[data-step]').length === n", arg=len(sequence.each))
        assert studio.until(lambda: (now := studio.studio.desk.editor.forecast) and now.sequence is edited(studio))
        return page

    return open_page


def upload(page, text, name="mine.json"):
    file = {"name": name, "mimeType": "application/json", "buffer": text.encode()}
    page.locator("input[type=file]").set_input_files(file)


def edited(studio):
    return studio.studio.desk.editor.timeline.sequence


def keyframe(page, row, step):
    return page.locator(f"[data-key='{row}-{step}']")


def middle(locator):
    box = locator.bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def drag(page, locator, right, down):
    x, y = middle(locator)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + right, y + down, steps=5)
    page.mouse.up()


def test_a_keyframe_is_dragged_played_and_undone(studio, edit):
    page = edit(short(6.0, 7.0))
    before = edited(studio)
    drag(page, keyframe(page, 3, 1), 0, -12)
    assert studio.until(lambda: (edited(studio).each[1].targets_mm[3] or 0) > 9)
    high = edited(studio).each[1].targets_mm[3]
    assert edited(studio).each[1].targets_mm[:3] == (7.0, 7.0, 7.0)
    assert edited(studio).duration == before.duration
    page.get_by_role("button", name="Play", exact=True).click()
    assert studio.until(lambda: abs(studio.heights[3] - high) < 0.3 and abs(studio.heights[0] - 7) < 0.4)
    assert studio.until(lambda: studio.studio.desk.editor.plays is False)
    page.get_by_role("button", name="Undo").click()
    assert studio.until(lambda: edited(studio) == before)
    page.get_by_role("button", name="Redo").click()
    assert studio.until(lambda: edited(studio).each[1].targets_mm[3] == high)


def test_a_keyframe_is_dragged_in_time_and_a_new_one_is_set_by_pointer(studio, edit):
    page = edit(short(6.0, 7.0))
    drag(page, keyframe(page, 0, 0), 60, 1)
    assert studio.until(lambda: edited(studio).each[0].ramp > 0.55)
    assert edited(studio).each[0].targets_mm == (6.0,) * 7  # and not in height
    assert edited(studio).duration == 1.2  # what is after it stays
    track = page.locator("[data-row='2']").bounding_box()
    page.mouse.dblclick(track["x"] + 0.93 * track["width"], track["y"] + 0.3 * track["height"])
    assert studio.until(lambda: len(edited(studio).each) == 3)
    assert edited(studio).each[2].targets_mm[2] > 8
    assert edited(studio).each[2].targets_mm[:2] == (None, None)
    page.locator("[data-key='2-2'].chosen").wait_for()


def test_all_of_it_by_keyboard(studio, edit):
    page = edit(short(6.0, 7.0))
    page.locator("[data-step='0']").focus()
    for key in ("ArrowDown", "ArrowDown", "ArrowRight"):  # to bubble 1, step 1
        page.keyboard.press(key)
    page.locator("[data-key='1-1']:focus").wait_for()
    for _ in range(5):
        page.keyboard.press("Shift+ArrowUp")  # faster than answers come
    page.keyboard.press("PageUp")
    page.keyboard.press("PageUp")
    assert studio.until(lambda: edited(studio).each[1].targets_mm[1] == 9.5)
    page.keyboard.press("Shift+ArrowRight")
    assert studio.until(lambda: edited(studio).each[1].ramp == 0.55)
    page.locator("[data-key='1-1']:focus").wait_for()
    play = page.get_by_role("button", name="Play", exact=True)
    play.focus()
    page.keyboard.press("Enter")
    assert studio.until(lambda: abs(studio.heights[1] - 9.5) < 0.4 and studio.heights[0] < 7.5)
    keyframe(page, 1, 1).focus()
    page.keyboard.press("Delete")
    assert studio.until(lambda: edited(studio).each[1].targets_mm[1] is None)
    for _ in range(9):
        page.keyboard.press("Control+z")
    assert studio.until(lambda: edited(studio) == short(6.0, 7.0), 5), edited(studio).to_json()
    page.keyboard.press("Control+y")
    assert studio.until(lambda: edited(studio).each[1].targets_mm[1] == 7.1)


def test_the_playhead_and_a_keyframe_there_by_keyboard(studio, edit):
    page = edit(short(6.0, 8.0))
    page.locator("[data-key='4-1']").focus()
    head = page.get_by_role("slider", name="Playhead")
    head.focus()
    page.keyboard.press("Home")
    for _ in range(5):
        page.keyboard.press("ArrowRight")
    page.keyboard.press("Insert")
    assert studio.until(lambda: len(edited(studio).each) == 3)
    assert edited(studio).each[0].targets_mm[4] == 5.5
    assert edited(studio).each[0].ramp == 0.25
    assert head.get_attribute("aria-valuenow") == "0.25"


def test_what_is_opened_is_saved_with_nothing_lost(studio, edit):
    page = edit(EVERYTHING)
    assert page.locator(".repeat").count() == 2
    label = page.locator("[data-step='0']").get_attribute("aria-label")
    assert label == "Step 0, up: 0.4 s ramp, in, until settled within 0.3 mm, for 2.5 s at most"
    with page.expect_download() as download:
        page.get_by_role("link", name="Save").click()
    assert download.value.suggested_filename == "everything-there-is.json"
    assert download.value.path().read_text(encoding="utf-8") == EVERYTHING.to_json()
    drag(page, keyframe(page, 6, 5), 0, -6)  # of the last step, outside all repeats
    assert studio.until(lambda: edited(studio) != EVERYTHING)
    assert edited(studio).steps[:2] == EVERYTHING.steps[:2]
    page.keyboard.press("Control+z")
    assert studio.until(lambda: edited(studio).to_json() == EVERYTHING.to_json())


def test_every_field_of_a_step_is_set(studio, edit):
    page = edit(short(6.0, 7.0, 8.0))
    keyframe(page, 0, 1).click()
    page.get_by_label("Height (mm)").fill("9.25")
    page.keyboard.press("Tab")
    page.get_by_label("Ramp (s)").fill("0.8")
    page.keyboard.press("Tab")
    page.get_by_label("Easing").select_option("smooth")
    page.get_by_label("Goes on").select_option("settled")
    page.get_by_label("At most (s)").fill("1.5")
    page.keyboard.press("Enter")
    page.get_by_role("combobox", name="Then").select_option("vent")
    page.get_by_label("Step's name").fill("peak")
    page.keyboard.press("Enter")
    page.get_by_label("All of it, times").fill("2")
    page.keyboard.press("Enter")
    wanted = bs.Step([9.25, *[7.0] * 6], 0.8, "smooth", bs.Settled(0.2, 1.5, "vent"), "peak")
    assert studio.until(lambda: edited(studio).each[1] == wanted and edited(studio).loops == 2), edited(studio).each[1]
    page.get_by_label("Height (mm)").fill("99")
    page.keyboard.press("Enter")
    page.locator(".timeline-problem", has_text="14 mm").wait_for()
    assert page.get_by_label("Height (mm)").input_value() == "9.25"
    assert edited(studio).each[1] == wanted


def test_steps_are_repeated_and_rows_are_rings(studio, edit):
    page = edit(short(6.0, 7.0, 8.0))
    page.locator("[data-step='0']").click()
    page.locator("[data-step='1']").click(modifiers=["Shift"])
    page.get_by_role("button", name="Repeat steps 0 to 1").click()
    page.locator(".repeat", has_text="× 2").wait_for()
    page.get_by_label("Repeat of 0 to 1").fill("4")
    page.keyboard.press("Enter")
    assert studio.until(lambda: getattr(edited(studio).steps[0], "times", 0) == 4)
    page.get_by_role("combobox", name="Rows").select_option("rings")
    page.get_by_text("Ring 1").wait_for()
    keyframe(page, 1, 2).focus()
    page.keyboard.press("PageUp")
    assert studio.until(lambda: edited(studio).each[2].targets_mm == (8.0, *[9.0] * 6))


def test_the_foreseen_shape_is_what_the_plant_then_has(studio, edit):
    """Bubbles that touch: the one in the middle rises last and is lifted by the ring around it."""
    touching = bs.Sequence([bs.Step([8.0, *[10.0] * 6], 1.0), bs.Step([11.0, *[None] * 6], 1.0, until=bs.After(0.5))])
    page = edit(touching)
    page.locator("[data-step='1']").focus()
    page.get_by_role("slider", name="Playhead").focus()
    page.keyboard.press("End")
    foreseen = "() => [...document.querySelectorAll('.bubble')].sort((a, b) => a.dataset.bubble - b.dataset.bubble)"
    assert studio.until(lambda: studio.studio.desk.editor.timeline.time_ms == 2500)
    page.wait_for_function(f"{foreseen.replace('() => ', '')}.every(b => b.dataset.foreseen > 8)")
    tops = np.array([float(one) for one in page.evaluate(f"({foreseen})().map(b => b.dataset.foreseen)")])
    forecast = studio.studio.desk.editor.forecast
    assert forecast.cut_mm is None
    assert np.abs(tops - np.array([11.0, *[10.0] * 6])).max() > 1  # not what was asked
    page.get_by_role("button", name="Play", exact=True).click()
    assert studio.until(lambda: studio.owner.played and studio.owner.played.step == 1)
    assert studio.until(lambda: not studio.owner.plays)
    assert np.abs(studio.heights - tops).max() < 0.4, (studio.heights, tops)


def test_what_cannot_be_had_is_marked(studio, edit):
    page = edit(short(6.0, 13.0))
    page.locator("[data-key='0-1'].passes").wait_for()
    assert "past the limit" in keyframe(page, 0, 1).get_attribute("aria-label")
    page.locator(".timeline-says", has_text="all targets are cut at").wait_for()
    keyframe(page, 0, 1).focus()
    page.keyboard.press("Control+z")
    page.keyboard.press("Control+y")
    page.get_by_role("combobox", name="Rows").select_option("all")
    page.get_by_text("All", exact=True).wait_for()
    keyframe(page, 0, 1).focus()
    for _ in range(6):
        page.keyboard.press("PageDown")
    assert studio.until(lambda: edited(studio) == short(6.0, 7.0))
    assert studio.until(lambda: (now := studio.studio.desk.editor.forecast) and now.sequence is edited(studio))
    page.locator(".timeline-says").wait_for(state="detached")
    page.wait_for_function("!document.querySelector('.handle.passes, .handle.off')")
    endless = bs.Sequence([bs.Repeat([bs.Step([6.0] * 7, 0.5)], 0), bs.Step([7.0] * 7, 0.5, name="end")])
    upload(page, endless.to_json())
    page.get_by_text("Step 1 (end) is never played: the repeat before it has no end.").wait_for()


def test_a_page_reloaded_in_the_middle_of_everything(studio, edit):
    page = edit(short(6.0, 8.0, 6.0, 8.0, 6.0, 8.0, 6.0, 8.0))
    keyframe(page, 2, 3).focus()
    page.keyboard.press("PageUp")
    assert studio.until(lambda: edited(studio).each[3].targets_mm[2] == 9.0)
    page.get_by_role("button", name="Play", exact=True).click()
    assert studio.until(lambda: studio.heights[0] > 7)
    x, y = middle(keyframe(page, 1, 1))
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y - 8)  # the hand is still down
    page.reload()
    page.locator("[data-key='1-1'].chosen").wait_for()
    assert edited(studio).each[1].targets_mm[1] == 8.0
    assert page.get_by_label("Height (mm)").input_value() == "8"
    page.get_by_role("button", name="Play", exact=True, pressed=True).wait_for()
    first = float(page.get_by_role("slider", name="Playhead").get_attribute("aria-valuenow"))
    page.wait_for_function(
        "t => document.querySelector('.head path').getAttribute('aria-valuenow') > t + 0.3", arg=first
    )
    assert studio.until(lambda: studio.heights[2] > 8.7)  # what was edited is what plays
    page.get_by_role("button", name="Undo").click()
    assert studio.until(lambda: edited(studio).each[3].targets_mm[2] == 8.0)
    page.get_by_role("button", name="Play", exact=True, pressed=True).click()
    assert studio.until(lambda: studio.mode == "holding")


def test_two_pages_edit_the_same_and_none_undoes_the_other_unseen(studio, edit, visit):
    first = edit(short(6.0, 7.0))
    second = visit("sequence")
    keyframe(first, 0, 1).focus()
    first.keyboard.press("PageUp")
    second.locator("[data-key='0-1'][aria-label*='8.0 mm']").wait_for()
    editor = studio.studio.desk.editor
    stale = {"kind": "place", "step": 1, "row": 0, "height": 12.0, "revision": editor.timeline.revision - 1}
    studio.loop.call_soon_threadsafe(editor.change, stale)
    assert studio.until(lambda: "changed elsewhere" in editor.problem)
    assert edited(studio).each[1].targets_mm[0] == 8.0
    second.locator("[data-key='0-1']").focus()
    second.keyboard.press("PageUp")
    first.locator("[data-key='0-1'][aria-label*='9.0 mm']").wait_for()


def test_what_is_no_sequence_is_refused_with_a_reason(studio, edit):
    page = edit(short(6.0))
    for name, text, why in (
        ("virus.exe", "MZ", ".exe is no sequence"),
        ("broken.json", "nothing", "broken.json is not JSON"),
        ("/etc/passwd.json", "/etc/passwd", "passwd.json is not JSON"),
        ("goto.json", '{"bubbleskin_sequence": 1, "steps": [{"goto": 3}]}', "goto"),
        ("long.json", bs.Sequence([bs.Step([6.0] * 7, 0.1)] * 2001).to_json(), "2001 steps; the editor takes 2000"),
        ("table.csv", "time_s,b1\n0,6\n", "bubbles count from 0"),
    ):
        said = page.evaluate(
            "([name, text]) => fetch('/sequence?name=' + encodeURIComponent(name), {method: 'POST', body: text})"
            ".then(a => a.text())",
            [name, text],
        )
        assert why in json.loads(said)["problem"], said
        assert "/tmp" not in said
    upload(page, "{", "broken.json")
    page.locator(".timeline-problem", has_text="broken.json is not JSON").wait_for()
    assert edited(studio) == short(6.0)
    upload(page, "time_s,b0,b1,b2,b3,b4,b5,b6\n0.5,6,6,6,6,6,6,6\n1,7,,,,,,\n", "table.csv")
    assert studio.until(lambda: len(edited(studio).each) == 2)


def test_a_sequence_for_another_wristband_is_kept_and_said_to_be(studio, edit):
    page = edit(short(6.0))
    other = bs.sequences.breathing(bs.Layout.hexagon(rings=2))
    upload(page, other.to_json())
    page.get_by_text("The sequence is for 19 bubbles; this wristband7 has 7.").wait_for()
    page.locator("[data-key='18-1']").wait_for()
    page.get_by_role("button", name="Play", exact=True).click()
    page.locator(".notice", has_text="for 19 bubbles").wait_for()
    studio.open("sim://wristband19")
    page.locator("[data-bubble='18'][aria-label]").wait_for()
    page.locator("[data-key='18-1']").wait_for()
    assert edited(studio) == other
    page.get_by_text("for 19 bubbles").wait_for(state="detached")


def test_the_library_and_a_pattern_are_opened(studio, edit):
    page = edit(short(6.0))
    page.get_by_role("combobox", name="Of the library").select_option("ripple")
    page.get_by_role("button", name="Open it").click()
    page.get_by_role("combobox", name="Rows").select_option("all")  # at once: the page does not know the ripple yet
    assert studio.until(lambda: edited(studio).name == "ripple")
    page.wait_for_function("document.querySelectorAll('[data-row]').length === 1")
    keyframe(page, 0, 15).wait_for()
    line = page.get_by_role("textbox", name="Of a pattern")
    line.fill("wave.slwo(2)")
    page.get_by_role("button", name="Make keyframes of it").click()
    page.locator(".timeline-problem", has_text="slow").wait_for()
    line.fill("wave.slow(2)")
    page.get_by_role("slider", name="Length").fill("3")
    page.get_by_role("button", name="Make keyframes of it").click()
    assert studio.until(lambda: edited(studio).name == "wave().slow(2)")
    assert edited(studio).duration == 4.0
    page.get_by_role("button", name="Play", exact=True).click()
    assert studio.until(lambda: np.ptp(studio.heights) > 1)
    page.keyboard.press("Escape")
    assert studio.until(lambda: studio.mode == "holding")


def test_everybody_can_use_it_in_light_and_dark(studio, edit):
    page, axe = edit(EVERYTHING), Axe()
    keyframe(page, 0, 0).click()
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        page.wait_for_timeout(400)
        found = axe.run(page).response["violations"]
        bad = [(one["id"], one["nodes"][0]["html"]) for one in found if one["impact"] in ("serious", "critical")]
        assert bad == [], scheme
    page.set_viewport_size({"width": 390, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
