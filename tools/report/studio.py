"""How quick the studio is in a headless Chromium here: drawn updates a second, pointer to target; and the pictures of its page.

python tools/report/studio.py               # measures; takes a minute
python tools/report/studio.py --picture     # writes the pictures too
"""

import argparse
import asyncio
import dataclasses
import shutil
import threading
import time

import numpy as np
from nicegui import ui
from playwright.sync_api import BrowserContext, Page, sync_playwright

from bubbleskin.device.state import State
from bubbleskin.layout import Layout
from bubbleskin.studio.array import Array
from bubbleskin.studio.owner import RATE_HZ
from bubbleskin.studio.server import Studio

SECONDS = 5.0
PICTURE = "docs/pictures/studio.png"
EDITOR_PICTURE = "docs/pictures/studio_sequence.png"
DOME_MM = 9.6, 3.6  # its middle, and how much lower the outer ring is: no two touch, and none is lifted


def serve(studio: Studio, device: str) -> asyncio.AbstractEventLoop:
    """Run the studio in a thread; returns its loop once it is there."""
    ready, loops = threading.Event(), []

    async def run() -> None:
        loops.append(asyncio.get_running_loop())
        await studio.serve(device, ready.set)

    threading.Thread(target=lambda: asyncio.run(run()), daemon=True).start()
    if not ready.wait(60):
        raise SystemExit("The studio has not come up within a minute.")
    return loops[0]


def drawn_hz(page: Page) -> float:
    """Updates that a page draws a second."""
    figure = page.locator(".array-figure")
    begin, first = time.monotonic(), int(figure.get_attribute("data-drawn") or 0)
    page.wait_for_timeout(SECONDS * 1e3)
    return (int(figure.get_attribute("data-drawn") or 0) - first) / (time.monotonic() - begin)


async def wave(studio: Studio) -> None:
    """All bubbles go up and down, ten times a second elsewhere, until something else is asked."""
    random = np.random.default_rng(0)
    studio.owner.begin("report")
    while studio.owner.activity == "report":
        studio.owner.ask(random.uniform(6.0, 9.5, len(studio.desk.layout)))
        await asyncio.sleep(0.1)


def many(studio: Studio) -> None:
    """A page of synthetic states: no board has 37 bubbles."""

    @ui.page("/many")
    def page(rings: int) -> None:
        ui.add_head_html('<link rel="stylesheet" href="/studio/studio.css">')
        assert studio.owner.skin
        layout = Layout.hexagon(rings)
        n = len(layout)
        with ui.element("div").classes("studio card"):
            array = Array(dataclasses.replace(studio.owner.skin.info, bubbles=n), layout)
        random = np.random.default_rng(0)

        def take() -> None:
            heights, targets = random.uniform(6, 11, (2, n))
            sd = np.full(n, 0.1)
            array.take(
                State(
                    time=time.monotonic(),
                    mode="active",
                    height_mm=heights,
                    alone_mm=heights,
                    pressure_kpa=heights,
                    target_mm=targets,
                    status=("moving",) * n,
                    faults=((),) * n,
                    sd_mm=sd,
                )
            )

        ui.timer(1 / RATE_HZ, take)


def pointer_ms(studio: Studio, page: Page) -> tuple[float, float, int]:
    """Median and 95th percentile from a pointer's move to the wristband's answer that its target is another, ms."""
    page.goto(f"{studio.address}/?tab=terrain")
    page.get_by_role("button", name="Feel it").click()
    box = page.locator(".terrain svg").bounding_box()
    assert box
    studio.owner.latencies.clear()
    for turn in range(300):
        x, y = 0.5 + 0.35 * np.cos(turn / 15), 0.5 + 0.35 * np.sin(turn / 15)
        page.mouse.move(box["x"] + x * box["width"], box["y"] + y * box["height"])
        page.wait_for_timeout(1000 / 30)
    waits = 1e3 * np.array(studio.owner.latencies)
    return float(np.median(waits)), float(np.percentile(waits, 95)), len(waits)


def say_pointer(studio: Studio, page: Page) -> None:
    median, most, moves = pointer_ms(studio, page)
    bubbles = len(studio.owner.skin.layout)
    print(f"pointer to target, {bubbles} bubbles: median {median:.0f} ms, p95 {most:.0f} ms of {moves} targets")


def picture(studio: Studio, context: BrowserContext, loop: asyncio.AbstractEventLoop) -> None:
    """A dome on nineteen bubbles, as docs/studio.md shows it."""
    skin = studio.owner.skin
    assert skin
    away = np.linalg.norm(skin.layout.positions_mm, axis=1)
    high, less = DOME_MM
    page = context.new_page()
    page.goto(f"{studio.address}/?tab=live")
    page.locator("[data-bubble='0'][aria-label]").wait_for()
    loop.call_soon_threadsafe(studio.owner.ask, high - less * (away / away.max()) ** 2, 1.0)
    page.wait_for_timeout(12000)  # until the strip has forgotten what was before
    page.screenshot(path=PICTURE)
    page.close()  # a page behind another draws once a second
    print(f"wrote {PICTURE}")


def editor_picture(studio: Studio, context: BrowserContext) -> None:
    """A sequence whose order makes it higher than it was asked, in the sequence editor."""
    page = context.new_page()
    page.set_viewport_size({"width": 1280, "height": 900})
    page.goto(f"{studio.address}/?tab=sequence")
    page.get_by_role("button", name="Vent").click()
    page.get_by_role("combobox", name="Of the library").select_option("pop-up")
    page.get_by_role("button", name="Open it").click()
    page.get_by_role("combobox", name="Rows").select_option("rings")
    page.locator(".timeline-says").wait_for()
    page.locator("[data-key='0-0']").focus()
    page.get_by_role("slider", name="Playhead").focus()
    page.keyboard.press("End")
    page.wait_for_timeout(2000)
    page.evaluate("scrollTo(0, 0)")
    page.screenshot(path=EDITOR_PICTURE)
    page.close()
    print(f"wrote {EDITOR_PICTURE}")


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--picture", action="store_true")
    chosen = options.parse_args()
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None:
        raise SystemExit("There is no Chromium here: apt-get install chromium.")
    studio = Studio("127.0.0.1", 0)
    loop = serve(studio, "sim://wristband19")
    many(studio)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
        context = browser.new_context(viewport={"width": 1280, "height": 800})
        page = context.new_page()
        page.goto(studio.url)
        page.locator("[data-bubble='0'][aria-label]").wait_for()
        loop.call_soon_threadsafe(lambda: loop.create_task(wave(studio)))
        print(f"live, 19 bubbles that all move: {drawn_hz(page):.1f} of {RATE_HZ:g} updates/s drawn")
        say_pointer(studio, page)
        if chosen.picture:
            picture(studio, context, loop)
            editor_picture(studio, context)
        for rings in (2, 3):
            page.goto(f"{studio.address}/many?rings={rings}")
            page.locator("[data-bubble='0'][aria-label]").wait_for()
            print(
                f"synthetic, {len(Layout.hexagon(rings))} bubbles: {drawn_hz(page):.1f} of {RATE_HZ:g} updates/s drawn"
            )
        asyncio.run_coroutine_threadsafe(studio.owner.open("sim://wristband7"), loop).result(30)
        say_pointer(studio, page)
        browser.close()
    studio.leave()


if __name__ == "__main__":
    main()
