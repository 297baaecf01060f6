"""The demonstrations of the page in a real Chromium, by pointer and by keyboard; the plant's true heights are the judge."""

import io

import numpy as np
import pytest
from PIL import Image

pytestmark = pytest.mark.slow

REST_MM = 5.0


def middle(page, selector):
    box = page.locator(selector).bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def switch_on(studio, page, name, activity):
    page.get_by_role("button", name=name).click()
    assert studio.until(lambda: studio.owner.activity == activity)


@pytest.fixture
def ramp(studio):
    """A terrain that rises from the left to the right, uploaded as a picture: black to white."""
    file = io.BytesIO()
    Image.fromarray(np.tile(np.linspace(0, 255, 64).astype(np.uint8), (64, 1))).save(file, "PNG")
    return {"name": "ramp.png", "mimeType": "image/png", "buffer": file.getvalue()}


def test_the_terrain_under_the_pointer_and_under_keys(studio, visit, ramp, capsys):
    page = visit("terrain")
    page.locator("input[type=file]").set_input_files(ramp)
    assert studio.until(lambda: studio.studio.desk.ground.name == "ramp")
    page.locator("option[value=ramp]").wait_for(state="attached")
    switch_on(studio, page, "Feel it", "terrain")
    map_ = page.locator("[data-terrain]")
    box = map_.bounding_box()
    studio.owner.latencies.clear()
    for step in range(60):  # to where they are not so high that they touch, and lift one another
        page.mouse.move(box["x"] + box["width"] * (0.1 + 0.0075 * step), box["y"] + box["height"] / 2)
        page.wait_for_timeout(15)
    ground = studio.studio.desk.ground
    assert studio.until(lambda: ground.place[0] > 0.54 * ground.terrain.width_mm)
    right = ground.terrain.patch(*ground.place)
    assert studio.until(lambda: np.abs(studio.heights - right).max() < 0.4)
    waits = 1e3 * np.array(studio.owner.latencies)
    with capsys.disabled():
        print(
            f"\n  pointer to target: median {np.median(waits):.0f} ms, p95 {np.percentile(waits, 95):.0f} ms of {len(waits)}"
        )
    map_.focus()
    before = studio.heights[0]
    for _ in range(12):
        page.keyboard.press("Shift+ArrowLeft")
    assert studio.until(lambda: studio.heights[0] < before - 2)
    assert "contrast" in page.get_by_text("Here:").inner_text()


def test_what_was_stopped_is_not_felt_until_it_is_asked_again(studio, visit):
    page = visit("terrain")
    switch_on(studio, page, "Feel it", "terrain")
    x, y = middle(page, "[data-terrain]")
    page.mouse.move(x, y)
    assert studio.until(lambda: studio.heights.max() > 8)
    page.keyboard.press("Escape")
    page.keyboard.press("Escape")
    assert studio.until(lambda: studio.heights.max() < REST_MM + 0.4)
    for step in range(10):
        page.mouse.move(x + 5 * step, y)
    page.wait_for_timeout(400)
    assert studio.heights.max() < REST_MM + 0.4
    assert page.get_by_role("button", name="Feel it").get_attribute("aria-pressed") == "false"


def test_what_is_no_terrain_is_refused_with_a_reason(studio, visit):
    page = visit("terrain")
    for name, data, why in (
        ("virus.exe", b"MZ", ".exe is no terrain"),
        ("broken.png", b"nothing", "not a picture"),
        ("../../etc/passwd.npy", b"\x93NUMPY nothing", "passwd.npy"),
        ("objects.npy", pickled(), "objects.npy"),
    ):
        said = page.evaluate(
            "([name, data]) => fetch('/terrain?name=' + encodeURIComponent(name), "
            "{method: 'POST', body: new Uint8Array(data)}).then(a => a.text())",
            [name, list(data)],
        )
        assert why in said
        assert "/tmp" not in said
    too_large = page.evaluate(
        "fetch('/terrain?name=a.npy', {method: 'POST', body: new Uint8Array(9 << 20)}).then(a => a.status, e => 0)"
    )
    assert too_large in (403, 0)  # refused, or cut off while it was still sending
    assert studio.studio.desk.ground.uploaded is None or studio.studio.desk.ground.uploaded.name == "ramp"


def pickled():
    file = io.BytesIO()
    np.save(file, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    return file.getvalue()


def test_buttons_peek_rise_and_are_painted_by_pointer(studio, visit):
    page = visit("buttons")
    switch_on(studio, page, "Buttons on", "buttons")
    page.get_by_role("combobox", name="View").select_option("above")
    page.mouse.move(*middle(page, "[data-bubble='1'] .ball"))
    assert studio.until(lambda: 6 < studio.heights[1] < 8)
    page.mouse.down()
    page.mouse.up()
    assert studio.until(lambda: studio.heights[1] > 11)
    page.mouse.move(*middle(page, "[data-bubble='2'] .ball"))
    page.mouse.down()
    for bubble in (3, 4):
        page.mouse.move(*middle(page, f"[data-bubble='{bubble}'] .ball"), steps=4)
    page.mouse.up()
    assert studio.until(lambda: np.all(studio.heights[[2, 3, 4]] > 11))
    assert studio.heights[6] < REST_MM + 0.5
    page.locator(".card p", has_text="bubble 4").wait_for()
    page.get_by_role("button", name="All down").click()
    assert studio.until(lambda: studio.heights.max() < 8)


def test_buttons_by_keyboard(studio, visit):
    page = visit("buttons")
    switch_on(studio, page, "Buttons on", "buttons")
    page.locator("[data-bubble='0']").focus()
    page.keyboard.press("ArrowRight")
    assert studio.until(lambda: studio.heights[1] > 6)
    page.keyboard.press("Enter")
    assert studio.until(lambda: studio.heights[1] > 11)
    page.reload()
    page.locator(".card p", has_text="bubble 1").wait_for()
    assert studio.heights[1] > 11


def test_a_typed_pattern_moves_and_a_wrong_one_is_explained(studio, visit):
    page = visit("patterns")
    line = page.get_by_role("textbox", name="Pattern")
    line.fill("ripple.slwo(2)")
    page.get_by_role("button", name="Play", exact=True).click()
    page.locator(".notice", has_text="slow").wait_for()
    line.fill("wave.fast(2)")
    page.get_by_role("button", name="Play", exact=True).click()
    assert studio.until(lambda: studio.owner.activity == "pattern")
    seen = []
    assert studio.until(lambda: seen.append(studio.heights.copy()) or np.ptp(np.array(seen), axis=0).min() > 3)
