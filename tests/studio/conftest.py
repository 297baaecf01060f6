"""A studio in a thread of this process, so that the plant's true heights can be looked at, and a real Chromium for its pages."""

import asyncio
import os
import shutil
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
TOKEN = "the-token-of-these-tests"


def until(true, seconds=30.0):
    """Wait until `true()`, at most so long; what it said last. Where the machine is busy, simulated time slips."""
    end = time.monotonic() + seconds
    while not (said := true()) and time.monotonic() < end:
        time.sleep(0.02)
    return said


@pytest.fixture(name="until")
def _until():
    return until


class Running:
    """The studio, as tests use it."""

    def __init__(self):
        from bubbleskin.studio.server import Studio

        self.studio = Studio("127.0.0.1", 0, TOKEN, stays=True)
        self.loop = None
        ready = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve(ready)), name="studio")
        self._thread.start()
        assert ready.wait(60)

    async def _serve(self, ready):
        self.loop = asyncio.get_running_loop()
        await self.studio.serve("sim://wristband7", ready.set)

    def open(self, url):
        asyncio.run_coroutine_threadsafe(self.studio.owner.open(url), self.loop).result(30)
        assert self.studio.owner.problem == ""

    def close(self):
        self.studio.leave()
        self._thread.join(30)
        assert not self._thread.is_alive()

    until = staticmethod(until)

    @property
    def owner(self):
        return self.studio.owner

    @property
    def heights(self):
        """The true tops, mm: the plant's."""
        return self.owner.skin.simulated.height_mm

    @property
    def mode(self):
        return self.owner.state.mode if self.owner.state else ""


@pytest.fixture
def in_a_loop():
    """`in_a_loop(coroutine)`: its result, from a thread: while Chromium is open Playwright has this thread's loop."""
    with ThreadPoolExecutor(1) as pool:
        yield lambda coroutine: pool.submit(asyncio.run, coroutine).result()


@pytest.fixture(scope="package")
def running():
    """One for all tests: NiceGUI has one in a process."""
    one = Running()
    yield one
    one.close()


@pytest.fixture
def studio(running):
    """The studio with a fresh wristband of 7."""
    running.open("sim://wristband7")
    until(lambda: running.owner.state)
    return running


@pytest.fixture(scope="module")  # not longer: its event loop runs in this thread, where other tests run theirs
def chromium():
    if CHROMIUM is None:
        pytest.skip("there is no Chromium here: apt-get install chromium")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        options = ["--no-sandbox", "--disable-gpu"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=options)
        context = browser.new_context(viewport={"width": 1280, "height": 800})
        context.set_default_timeout(20000)
        yield context
        browser.close()


@pytest.fixture
def visit(chromium, studio):
    """`visit(tab)`: a page of the studio; an error of its scripts fails the test."""
    pages, errors = [], []

    def open_page(tab="live"):
        page = chromium.new_page()
        pages.append(page)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(f"{studio.studio.url}&tab={tab}")
        page.locator("[data-bubble='0'][aria-label]").wait_for()
        return page

    yield open_page
    for page in pages:
        page.close()
    assert errors == []
