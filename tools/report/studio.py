"""How quick the studio is in a headless Chromium here: drawn updates a second, pointer to target; and docs/pictures/studio.png.

python tools/report/studio.py               # measures; takes a minute
python tools/report/studio.py --picture     # writes the picture too
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
from bubbleskin.studio.server import Studio

SECONDS = 5.0
ASKED_HZ = 40.0
"""Of the synthetic states: more than the studio's 20, to see where drawing ends."""
PICTURE = "docs/pictures/studio.png"
DOME_MM = 12.5, 6.0  # its middle, and how much lower the outer ring is


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
            heights, targets = random.uniform(5, 13, (2, n))
            sd = np.full(n, 0.1)
            array.take(State(time.monotonic(), "active", heights, heights, targets, ("moving",) * n, ((),) * n, sd))

        ui.timer(1 / ASKED_HZ, take)


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
    page.wait_for_timeout(3500)
    page.screenshot(path=PICTURE)
    print(f"wrote {PICTURE}")


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
        print(f"live, 19 bubbles: {drawn_hz(page):.1f} of 20 updates/s drawn")
        median, most, moves = pointer_ms(studio, page)
        print(f"pointer to target, 19 bubbles: median {median:.0f} ms, p95 {most:.0f} ms of {moves} targets")
        if chosen.picture:
            picture(studio, context, loop)
        for rings in (2, 3):
            page.goto(f"{studio.address}/many?rings={rings}")
            page.locator("[data-bubble='0'][aria-label]").wait_for()
            print(
                f"synthetic, {len(Layout.hexagon(rings))} bubbles: {drawn_hz(page):.1f} of {ASKED_HZ:g} updates/s drawn"
            )
        browser.close()
    studio.leave()


if __name__ == "__main__":
    main()
