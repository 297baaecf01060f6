"""The page in a real Chromium, by pointer and by keyboard; the plant's true heights say whether bubbles moved."""

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe

pytestmark = pytest.mark.slow

REST_MM = 5.0


def is_flat(studio):
    return np.all(studio.heights < REST_MM + 0.4)


def test_a_slider_raises_the_chosen_bubble_by_pointer(studio, visit):
    page = visit()
    page.locator("[data-bubble='3']").click()
    slider = page.get_by_role("slider", name="Chosen bubble")
    box = slider.bounding_box()
    page.mouse.click(box["x"] + 0.8 * box["width"], box["y"] + box["height"] / 2)
    assert studio.until(lambda: 11.0 < studio.heights[3] < 13.5)
    assert np.all(np.delete(studio.heights, 3) < 8)


def test_a_slider_raises_all_by_keyboard(studio, visit):
    page = visit()
    page.get_by_role("slider", name="All bubbles").focus()
    page.keyboard.press("End")
    for _ in range(40):
        page.keyboard.press("ArrowLeft")
    assert studio.until(lambda: np.all(studio.heights > 9) and np.all(studio.owner.state.target_mm < 11))


def test_the_page_says_what_the_wristband_does(studio, visit):
    page = visit()
    page.get_by_role("slider", name="All bubbles").fill("9")
    page.locator("[data-bubble='2'][aria-label^='Bubble 2: 9.0 mm, target 9.0 mm']").wait_for()
    page.get_by_text("All figures").click()
    page.locator("tbody tr:nth-child(3)", has_text="9.00").wait_for()
    for words in ("active", "kPa", "± "):
        page.locator(".bar", has_text=words).wait_for()


def test_escape_stops_and_twice_vents(studio, visit):
    page = visit()
    page.get_by_role("slider", name="All bubbles").fill("10")
    assert studio.until(lambda: np.all(studio.heights > 9))
    page.keyboard.press("Escape")
    assert studio.until(lambda: studio.mode == "holding")
    assert np.all(studio.heights > 8.5)
    page.wait_for_timeout(1100)
    page.keyboard.press("Escape")
    page.keyboard.press("Escape")
    assert studio.until(lambda: is_flat(studio))


def test_stop_and_vent_by_pointer(studio, visit):
    page = visit("pulse")
    page.get_by_role("button", name="Play the pulse").click()
    assert studio.until(lambda: studio.heights[0] > 8)
    page.get_by_role("button", name="Stop").click()
    assert studio.until(lambda: studio.mode == "holding")
    assert studio.owner.activity == ""
    assert studio.heights[0] > 8
    page.get_by_role("button", name="Vent").click()
    assert studio.until(lambda: is_flat(studio))


def test_stop_goes_through_while_the_page_floods_the_studio(studio, visit):
    page = visit()
    page.evaluate(
        """() => { const slider = document.querySelector('input[type=range]'); let n = 0;
        window.flood = setInterval(() => { for (let i = 0; i < 20; i++) {
          slider.value = 6 + (n++ % 60) / 10; slider.dispatchEvent(new Event('input')); } }, 5); }"""
    )
    assert studio.until(lambda: studio.heights[0] > 6.5)
    with page.expect_response("**/stop") as answer:
        page.keyboard.press("Escape")
    assert answer.value.status == 200
    page.evaluate("clearInterval(window.flood)")


def test_a_fault_is_named_with_cause_and_remedy(studio, visit):
    page = visit()
    studio.owner.skin.simulated.inject("sensor_absent", 2)
    fault = page.locator(".fault")
    fault.wait_for()
    assert "Bubble 2: sensor lost" in fault.inner_text()
    assert "Check the sensor's wires" in fault.inner_text()
    page.locator(".bubble.faulty[data-bubble='2']").wait_for()
    studio.owner.skin.simulated.inject("sensor_absent", 2, 0)
    page.get_by_role("button", name="Clear faults").click()
    fault.wait_for(state="detached")


def test_another_wristband_is_chosen(studio, visit):
    page = visit()
    page.get_by_role("combobox", name="Device").select_option("sim://wristband19")
    page.get_by_role("textbox", name="Options").fill("seed=3&spread=0.1")
    page.get_by_role("button", name="Connect").click()
    page.locator("[data-bubble='18'][aria-label]").wait_for()
    page.locator(".bar", has_text="seed=3").wait_for()
    assert len(studio.heights) == 19


def test_what_cannot_be_opened_is_said_and_chosen_again(studio, visit):
    page = visit()
    page.get_by_role("textbox", name="Or any URL").fill("sim://wristband8")
    page.get_by_role("button", name="Connect").click()
    page.get_by_text("There is no board 'wristband8'").wait_for()
    page.get_by_role("combobox", name="Device").select_option("sim://wristband7")
    page.get_by_role("button", name="Connect").click()
    page.locator("[data-bubble='6'][aria-label]").wait_for()


def test_a_page_reloaded_in_the_middle_shows_what_goes_on(studio, visit):
    page = visit("pulse")
    page.get_by_role("slider", name="Rate").fill("8")
    page.get_by_role("button", name="Play the pulse").click()
    assert studio.until(lambda: studio.heights[0] > 8)
    page.reload()
    page.get_by_text("Playing.").wait_for()
    assert page.get_by_role("slider", name="Rate").input_value() == "8"
    assert studio.owner.activity == "pulse"
    assert studio.until(lambda: studio.heights[1] > 9)


def test_two_tabs_share_a_wristband(studio, visit):
    first, second = visit(), visit()
    first.get_by_role("slider", name="All bubbles").fill("8.5")
    second.locator("[data-bubble='5'][aria-label*='target 8.5 mm']").wait_for()
    second.keyboard.press("Escape")
    assert studio.until(lambda: studio.mode == "holding")
    first.get_by_text("holding", exact=True).first.wait_for()


def test_what_a_lost_tab_has_raised_is_vented(studio, visit):
    page = visit()
    page.get_by_role("slider", name="All bubbles").fill("11")
    assert studio.until(lambda: np.all(studio.heights > 10))
    page.close()
    assert studio.until(lambda: is_flat(studio))


def test_the_pulse_by_keyboard(studio, visit):
    page = visit("pulse")
    page.get_by_role("slider", name="Rate").fill("20")
    page.get_by_role("button", name="Play the pulse").focus()
    page.keyboard.press("Enter")
    assert studio.until(lambda: studio.heights[0] > 10)  # the inner bubble first, then the ring
    assert studio.until(lambda: np.all(studio.heights[1:] > 10) and studio.heights[0] < 9)


def test_everybody_can_use_it_in_light_and_dark(studio, visit):
    page, axe = visit(), Axe()
    for tab, scheme in zip(
        ("Live", "Pulse", "Terrain", "Buttons", "Patterns", "Live"), ("light", "dark") * 3, strict=True
    ):
        page.emulate_media(color_scheme=scheme)
        page.get_by_role("button", name=tab, exact=True).click()
        page.locator("h2").first.wait_for()
        page.wait_for_timeout(500)
        found = axe.run(page).response["violations"]
        bad = [(one["id"], one["nodes"][0]["html"]) for one in found if one["impact"] in ("serious", "critical")]
        assert bad == [], f"{tab}, {scheme}"


def test_a_narrow_window_has_everything(studio, visit):
    page = visit()
    page.set_viewport_size({"width": 390, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    for name in ("Stop", "Vent"):
        assert page.get_by_role("button", name=name).is_visible()
