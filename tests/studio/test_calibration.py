"""The calibration assistant in a real Chromium: measured, looked at, accepted or done again; the old set stays until then."""

import asyncio

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe

import bubbleskin as bs

pytestmark = pytest.mark.slow

SHEET = "sim://wristband7?spread=0.1&rubber=real&contact=0&seed=3"
LEAK = 8e-8
"""m³/s per Pa: a bubble of 12 mm loses 1.5 % of its air a second, which the firmware does not take for a fault."""


@pytest.fixture
def sheet(studio):
    """The studio with a sheet of real rubber, whose bubbles differ."""
    studio.open(SHEET)
    assert studio.until(lambda: studio.owner.state)
    return studio


@pytest.fixture
def assistant(sheet):
    return sheet.studio.desk.assistant


@pytest.fixture
def in_use(sheet):
    """`in_use()`: flow gains and first knots of the tables that the wristband uses now."""

    def ask():
        async def read():
            skin = sheet.owner.skin
            return (await skin.trim()).flow_gain.tolist(), [
                int(table.pressure_pa[5]) for table in await skin.read_tables()
            ]

        return asyncio.run_coroutine_threadsafe(read(), sheet.loop).result(20)

    return ask


def measured(studio, assistant):
    assert studio.until(lambda: assistant.progress, 10)
    assert studio.until(lambda: not assistant.progress, 90)


def test_a_bubble_is_repaired_by_pointer(sheet, visit, assistant, in_use):
    before, page, plant = in_use(), visit("calibration"), sheet.owner.skin.simulated
    plant.inject("leak", 2, LEAK)
    page.get_by_role("combobox", name="What to measure").select_option("2")
    page.get_by_role("button", name="Measure", exact=True).click()
    measured(sheet, assistant)
    page.get_by_role("heading", name="Bubble 2: out of family").wait_for()
    page.get_by_text("of its air a second: look at barb, tube and rubber").wait_for()
    assert page.get_by_role("button", name="Accept").count() == 0
    plant.inject("leak", 2, 0.0)
    page.get_by_role("button", name="Measure bubble 2 again").click()
    measured(sheet, assistant)
    page.get_by_role("heading", name="Bubble 2: can be accepted").wait_for()
    assert in_use() == before, "the old set until it is accepted"
    page.get_by_role("button", name="Accept bubble 2").click()
    page.get_by_role("heading", name="Bubble 2: in use").wait_for()
    gains, tables = in_use()
    assert [bubble for bubble in range(7) if tables[bubble] != before[1][bubble]] == [2]
    assert [bubble for bubble in range(7) if gains[bubble] != before[0][bubble]] == [2]
    sheet.loop.call_soon_threadsafe(sheet.owner.ask, np.full(7, 9.0))
    assert sheet.until(lambda: abs(sheet.heights[2] - 9.0) < 0.2)


def test_by_keyboard_it_begins_goes_on_over_a_reload_and_stops(sheet, visit, assistant, in_use):
    before, page = in_use(), visit("calibration")
    page.get_by_role("combobox", name="What to measure").focus()
    page.keyboard.press("ArrowDown")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    assert sheet.until(lambda: sheet.heights[0] > 9)
    page.reload()
    page.get_by_text("Stretching and stepping of 0:").wait_for()
    assert page.get_by_role("combobox", name="What to measure").input_value() == "0"
    page.get_by_role("button", name="Live", exact=True).click()
    page.get_by_role("slider", name="All bubbles").fill("11")
    page.locator(".notice", has_text="A calibration has the wristband").wait_for()
    assert page.evaluate("fetch('/notify', {method: 'POST'}).then(answer => answer.status)") == 409
    assert np.all(sheet.heights[1:] < 5.5)
    page.keyboard.press("Escape")
    assert sheet.until(lambda: np.all(sheet.heights < 5.5))
    page.get_by_role("button", name="Calibration", exact=True).click()
    page.get_by_text("It was ended before it was done").wait_for()
    assert assistant.bubbles == []
    assert in_use() == before
    page.get_by_role("button", name="Live", exact=True).click()
    page.get_by_role("slider", name="All bubbles").fill("8")
    assert sheet.until(lambda: np.all(sheet.heights > 7))


def test_results_are_stepped_through_and_accepted_together(sheet, visit, assistant, in_use):
    before, page = in_use(), visit("calibration")
    with bs.connect(SHEET) as twin:
        found = twin.calibrate([1, 4], upload=False)
    sheet.loop.call_soon_threadsafe(assistant.take, found)
    page.get_by_role("heading", name="Bubble 1: can be accepted").wait_for()
    page.get_by_role("button", name="Next").focus()
    page.keyboard.press("Enter")
    page.get_by_role("heading", name="Bubble 4: can be accepted").wait_for()
    page.get_by_role("img", name="Bubble 4: pressure across").wait_for()
    assert page.locator("img.fitted").evaluate("one => one.decode().then(() => one.naturalWidth)") > 400
    page.reload()
    page.get_by_role("heading", name="Bubble 4: can be accepted").wait_for()
    page.get_by_text("Figures with 95 % intervals").click()
    page.get_by_role("cell", name="line mm3").wait_for()
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        bad = Axe().run(page).response["violations"]
        bad = [(one["id"], one["nodes"][0]["html"]) for one in bad if one["impact"] in ("serious", "critical")]
        assert bad == [], scheme
    page.get_by_role("button", name="Bubble 1, can be accepted").click()
    assert in_use() == before
    page.get_by_role("button", name="Accept all 2").click()
    page.get_by_role("heading", name="Bubble 1: in use").wait_for()
    changed = [bubble for bubble in range(7) if in_use()[1][bubble] != before[1][bubble]]
    assert changed == [1, 4]
    page.get_by_role("button", name="Discard all").click()
    page.get_by_role("heading", name="Bubble 1").wait_for(state="detached")


def test_a_wristband_with_faults_is_not_measured(sheet, visit, assistant):
    page = visit("calibration")
    sheet.owner.skin.simulated.inject("sensor_absent", 2)
    assert sheet.until(lambda: sheet.owner.state.faults[2])
    page.get_by_role("button", name="Measure", exact=True).click()
    page.locator(".notice", has_text="Bubbles 2 have faults").wait_for()
    assert sheet.until(lambda: not sheet.owner.is_lent)
