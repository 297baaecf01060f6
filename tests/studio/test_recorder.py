"""The recorder in a real Chromium, by pointer and by keyboard: what is recorded, looked at, replayed and downloaded."""

import io
import re
import time

import numpy as np
import pandas as pd
import pytest
from axe_playwright_python.sync_playwright import Axe
from PIL import Image

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def forgotten(running):
    """No test finds recordings of another."""
    yield
    recorder = running.studio.desk.recorder
    recorder.end()
    for number in list(recorder.takes):
        recorder.delete(number)


@pytest.fixture
def recorder(studio):
    return studio.studio.desk.recorder


@pytest.fixture
def recorded(studio, visit, recorder):
    """A page that looks at a recording of all bubbles on their way up to 10 mm; they are flat again."""
    page = visit("recorder")
    page.get_by_role("button", name="Record", exact=True).click()
    assert studio.until(lambda: recorder.current and recorder.current.states)
    studio.loop.call_soon_threadsafe(studio.owner.ask, np.full(7, 10.0), 0.4)
    assert studio.until(lambda: np.all(studio.heights > 9.7))
    assert studio.until(lambda: recorder.current.seconds > 2.0)
    page.get_by_role("button", name="Record", exact=True).click()
    page.keyboard.press("Escape")
    page.keyboard.press("Escape")
    assert studio.until(lambda: np.all(studio.heights < 5.4))
    page.get_by_role("slider", name="Position").wait_for()
    return page


def shown(page):
    """The heights that the page's array shows, mm; nan where it does not say that they are recorded."""
    labels = page.locator("[data-bubble]").evaluate_all(
        "nodes => nodes.map(one => [Number(one.dataset.bubble), one.getAttribute('aria-label')])"
    )
    heights = [re.match(r"Recorded, bubble \d+: ([\d.]+) mm", label) for _, label in sorted(labels)]
    return np.array([float(found[1]) if found else np.nan for found in heights])


def test_any_panel_is_recorded_and_scrubbed_by_pointer(studio, visit, recorder):
    page = visit("recorder")
    page.get_by_role("button", name="Record", exact=True).click()
    assert studio.until(lambda: recorder.current)
    page.get_by_role("button", name="Pulse", exact=True).click()
    page.get_by_role("slider", name="Rate").fill("20")
    page.get_by_role("button", name="Play the pulse").click()
    page.locator(".facts", has_text="recording").wait_for()
    assert studio.until(lambda: studio.heights[0] > 10)
    assert studio.until(lambda: studio.heights[1] > 10)
    page.get_by_role("button", name="Recorder", exact=True).click()
    page.get_by_role("button", name="Record", exact=True).click()
    slider = page.get_by_role("slider", name="Position")
    page.keyboard.press("Escape")
    box = slider.bounding_box()
    page.mouse.click(box["x"] + 0.8 * box["width"], box["y"] + box["height"] / 2)
    take = recorder.shown
    assert studio.until(lambda: 0.7 < recorder.at_s / take.seconds < 0.9)
    then = take.states[take.index(recorder.at_s)].height_mm
    page.get_by_text(f"Recording {take.number}: this is a recording, and not what the wristband does now.").wait_for()
    assert studio.until(lambda: np.allclose(shown(page), then, atol=0.051))
    assert max(state.height_mm[0] for state in take.states) > 10
    page.get_by_role("button", name="Back to now").click()
    page.locator("[data-bubble='0'][aria-label^='Bubble 0']").wait_for()
    assert page.locator(".recorded").is_hidden()


def test_scrubbed_and_replayed_by_keyboard_the_wristband_stays_where_it_is(studio, recorded, recorder):
    take = recorder.shown
    slider = recorded.get_by_role("slider", name="Position")
    slider.focus()
    recorded.keyboard.press("End")
    recorded.keyboard.press("ArrowLeft")
    assert studio.until(lambda: recorder.at_s == pytest.approx(take.seconds - 0.05, abs=0.06))
    assert studio.until(lambda: np.all(shown(recorded) > 9.5))
    recorded.keyboard.press("Home")
    assert studio.until(lambda: np.all(shown(recorded) < 5.4))
    recorded.get_by_role("button", name="Replay").focus()
    seen = recorded.evaluate_handle(
        """() => { const seen = []; const ball = document.querySelector("[data-bubble='0']");
        new MutationObserver(() => seen.push(ball.getAttribute("aria-label")))
          .observe(ball, { attributeFilter: ["aria-label"] }); return seen; }"""
    )
    recorded.keyboard.press("Enter")
    assert studio.until(lambda: recorder.replays)
    begin = time.monotonic()
    assert np.all(studio.heights < 5.4)
    assert studio.until(lambda: not recorder.replays)
    lasted = time.monotonic() - begin
    assert studio.until(lambda: np.all(shown(recorded) > 9.5))
    assert len(set(seen.json_value())) > 2, "it moves, and does not only jump to its end"
    assert take.seconds - 0.3 < lasted < take.seconds + 2.0, "at real time, as far as this machine keeps it"
    assert np.all(studio.heights < 5.4)
    assert studio.mode in ("idle", "venting")


def test_a_page_reloaded_in_the_middle_records_on_and_looks_where_it_did(studio, recorded, recorder):
    recorder.seek(1.0)
    recorded.reload()
    recorded.locator("[data-bubble='0'][aria-label^='Recorded']").wait_for()
    assert float(recorded.get_by_role("slider", name="Position").input_value()) == pytest.approx(1.0)
    recorded.get_by_role("button", name="Record", exact=True).click()
    assert studio.until(lambda: recorder.current and len(recorder.current.states) > 3)
    recorded.reload()
    switch = recorded.get_by_role("button", name="Record", exact=True)
    switch.wait_for()
    assert switch.get_attribute("aria-pressed") == "true"
    before = len(recorder.current.states)
    assert studio.until(lambda: len(recorder.current.states) > before)
    switch.click()
    assert studio.until(lambda: len(recorder.takes) == 2)


def downloaded(page, name):
    with page.expect_download() as download:
        page.get_by_role("link", name=name).click()
    with open(download.value.path(), "rb") as file:  # noqa: PTH123
        return io.BytesIO(file.read())


def test_what_is_downloaded_is_what_was_recorded(studio, recorded, recorder):
    take = recorder.shown
    columns = [f"height_mm_{bubble}" for bubble in range(7)]
    heights = np.array([state.height_mm for state in take.states])
    frame = pd.read_csv(downloaded(recorded, ".csv"), comment="#")
    np.testing.assert_allclose(frame[columns], heights, atol=1e-6)
    recorded.get_by_role("button", name="Make Parquet").click()
    frame = pd.read_parquet(downloaded(recorded, ".parquet"))
    np.testing.assert_allclose(frame[columns], heights, atol=1e-6)
    assert frame.attrs["board"] == "wristband7"


def test_a_film_is_made_while_page_and_wristband_go_on(studio, recorded, recorder):
    begin = 0.5
    recorder.seek(begin)
    recorded.get_by_role("button", name="Make GIF").focus()
    recorded.keyboard.press("Enter")
    recorded.get_by_text("% done").wait_for()
    with recorded.expect_response("**/vent") as answer:
        recorded.get_by_role("button", name="Vent").click()
    assert answer.value.ok
    with Image.open(downloaded(recorded, ".gif")) as film:
        lasts = 0.0
        for frame in range(film.n_frames):
            film.seek(frame)
            lasts += film.info["duration"] / 1000
    assert lasts == pytest.approx(recorder.shown.seconds - begin, abs=0.15)


def test_without_ffmpeg_and_pyarrow_the_page_says_so(studio, recorded, monkeypatch):
    monkeypatch.setenv("PATH", "/nowhere")
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    recorded.reload()
    recorded.get_by_text("MP4 needs the program ffmpeg, which is not here.").wait_for()
    recorded.get_by_text("Parquet needs pyarrow").wait_for()
    assert recorded.get_by_role("button", name="Make MP4").count() == 0


def test_only_recordings_of_this_run_are_given_and_only_to_those_who_may(studio, recorded, recorder):
    address, name = studio.studio.address, recorder.shown.path.name

    def status(path):
        return recorded.evaluate("path => fetch(path).then(answer => answer.status)", path)

    assert status(f"/recordings/{name}") == 200
    for other in ("..%2F..%2Fetc%2Fpasswd", "%2Fetc%2Fpasswd", "recording.csv", f".%2F{name}", f"{name}%00", "."):
        assert status(f"/recordings/{other}") == 404, other
    recorded.get_by_role("button", name="Delete recording").click()
    assert status(f"/recordings/{name}") == 200, "deleted is what is asked for twice"
    recorded.get_by_role("button", name="Really delete").click()
    assert studio.until(lambda: not recorder.takes)
    assert status(f"/recordings/{name}") == 404
    assert list(recorder.folder.iterdir()) == []
    recorded.locator("[data-bubble='0'][aria-label^='Bubble 0']").wait_for()
    stranger = recorded.context.browser.new_context()
    assert stranger.request.get(f"{address}/recordings/{name}").status == 403
    stranger.close()


def test_everybody_can_use_it_in_light_and_dark(studio, recorded):
    recorded.get_by_role("button", name="Make GIF").click()
    recorded.get_by_role("link", name=".gif").wait_for()
    for scheme in ("light", "dark"):
        recorded.emulate_media(color_scheme=scheme)
        found = Axe().run(recorded).response["violations"]
        bad = [(one["id"], one["nodes"][0]["html"]) for one in found if one["impact"] in ("serious", "critical")]
        assert bad == [], scheme
