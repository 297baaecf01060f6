"""The live widget of notebooks: a real anywidget, told by a simulated wristband, and its module drawn in a real Chromium."""

import json
import re
import sys
import threading
import time
from dataclasses import replace

import anywidget
import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe

import bubbleskin as bs
from bubbleskin.browser.messages import message
from bubbleskin.errors import BubbleskinError, InvalidInput

PLACE = "http://notebook.example/"
PAGE = """<!doctype html><html lang="en" data-jp-theme-light="true"><title>notebook</title><main><h1>notebook</h1></main>"""
OPEN = """async traits => {
  const style = document.createElement("style");
  style.textContent = traits._css;
  document.head.append(style);
  const heard = {};
  window.model = {
    get: name => traits[name],
    set: (name, value) => { traits[name] = value; (heard["change:" + name] || []).forEach(call => call()); },
    on: (name, call) => (heard[name] ||= []).push(call),
    off: (name, call) => { heard[name] = heard[name].filter(other => other !== call); },
    heard,
  };
  const { default: widget } = await import("/widget.js");
  window.end = widget.render({ model: window.model, el: document.querySelector("main") });
}"""


@pytest.fixture
def skin():
    with bs.connect("sim://wristband7") as skin:
        yield skin


@pytest.fixture
def widget(skin):
    shown = bs.live(skin, rate_hz=30)
    yield shown
    shown.close()


def heights(page):
    labels = page.locator("[data-bubble]").evaluate_all(
        "nodes => nodes.sort((a, b) => a.dataset.bubble - b.dataset.bubble).map(one => one.getAttribute('aria-label'))"
    )
    return np.array([float(re.match(r"Bubble \d+: ([\d.]+) mm", label)[1]) for label in labels])


@pytest.mark.medium
def test_its_traits_are_what_the_wristband_does(skin, widget, until):
    assert isinstance(widget, anywidget.AnyWidget)
    assert bs.live(skin) is widget
    skin.show(np.linspace(6, 10, 7))
    assert until(lambda: widget.state["t"] >= skin.simulated.time - 0.02)
    np.testing.assert_allclose(widget.state["h"], skin.simulated.height_mm, atol=0.3)
    np.testing.assert_allclose(widget.state["g"], np.linspace(6, 10, 7), atol=0.006)
    assert json.loads(json.dumps(widget.get_state(["state", "geometry", "said"])))["said"] == ""


@pytest.mark.medium
def test_to_look_changes_nothing_and_ends_with_either(skin, widget, until):
    skin.show(np.full(7, 8.0))
    assert until(lambda: widget.state["t"] >= skin.simulated.time - 0.02)
    time.sleep(0.1)
    before = skin.simulated.time
    time.sleep(0.3)
    assert skin.simulated.time == before
    widget.close()
    assert until(lambda: not following())
    again = bs.live(skin)
    assert again is not widget
    skin.close()
    assert until(lambda: "closed" in again.said)
    assert until(lambda: not following())


def following():
    return [thread for thread in threading.enumerate() if thread.name == "bubbleskin live"]


def test_wrong_things_are_sentences(skin, monkeypatch):
    with pytest.raises(InvalidInput, match=r"bubbleskin\.connect"):
        bs.live("sim://wristband7")
    with pytest.raises(InvalidInput, match="rate_hz"):
        bs.live(skin, rate_hz=0)
    monkeypatch.setitem(sys.modules, "anywidget", None)
    with pytest.raises(BubbleskinError, match=r"pip install 'bubbleskin\[notebook\]'"):
        bs.live(skin)


@pytest.mark.slow
def test_its_module_draws_the_plants_heights(skin, widget, until, chromium):
    page, errors = chromium.new_page(), []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.route(f"{PLACE}**", lambda route: route.fulfill(body=PAGE, content_type="text/html"))
    module = widget.get_state()["_esm"]
    page.route(f"{PLACE}widget.js", lambda route: route.fulfill(body=module, content_type="text/javascript"))
    page.goto(PLACE)
    skin.show([12, 7, 8, 9, 10, 6, 7])
    skin.sleep(1.0)
    assert until(lambda: widget.state["t"] >= skin.simulated.time - 0.02)
    page.evaluate(OPEN, widget.get_state(["geometry", "state", "said", "_css"]))
    page.locator("[data-bubble='0'][aria-label^='Bubble 0: 1']").wait_for()
    np.testing.assert_allclose(heights(page), skin.simulated.height_mm, atol=0.2)
    skin.show([6, 11, 8, 7, 6, 10, 9])
    skin.sleep(1.0)
    assert until(lambda: widget.state["t"] >= skin.simulated.time - 0.02)
    page.evaluate("state => window.model.set('state', state)", widget.state)
    page.locator("[data-bubble='1'][aria-label^='Bubble 1: 1']").wait_for()
    np.testing.assert_allclose(heights(page), skin.simulated.height_mm, atol=0.2)
    # By keyboard and pointer: another bubble, another view; the kernel hears nothing of it.
    page.locator("[data-bubble='0']").focus()
    page.keyboard.press("ArrowRight")
    chosen = page.locator(".strip-title").inner_text()
    assert chosen != "Bubble 0"
    page.get_by_role("combobox", name="View").select_option("above")
    page.locator("[data-bubble='4']").click()
    assert page.locator(".strip-title").inner_text() == "Bubble 4"
    for light in ("true", "false"):  # JupyterLab's own word for its theme
        page.evaluate("light => { document.documentElement.dataset.jpThemeLight = light; }", light)
        found = Axe().run(page).response["violations"]
        assert [one["id"] for one in found if one["impact"] in ("serious", "critical")] == [], light
        ground = page.locator(".bubbleskin").evaluate("one => getComputedStyle(one).backgroundColor")
        assert ground == {"true": "rgb(255, 255, 255)", "false": "rgb(27, 33, 42)"}[light]
    page.evaluate("model.set('said', 'The wristband is closed.')")
    page.get_by_text("The wristband is closed.").wait_for()
    page.evaluate("end()")
    assert page.evaluate("Object.values(model.heard).flat().length") == 0
    page.close()
    assert errors == []


def test_what_is_not_known_is_json(skin):
    short = message(replace(skin.state(), sd_mm=np.full(7, np.nan)))
    assert json.loads(json.dumps(short, allow_nan=False))["sd"] == [0.0] * 7
