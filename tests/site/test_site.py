"""The site is whole: every page in its menu, every link and anchor leads somewhere, and nothing is fetched from elsewhere."""

import re
import shutil
import subprocess
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from html.parser import HTMLParser
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SITE = ROOT / "docs" / "site"
MENU = tomllib.loads((SITE / "menu.toml").read_text(encoding="utf-8"))
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


def build(root: Path, target: Path) -> tuple[int, str]:
    """What `make docs` does, in a folder that is like the repository's: status, and what was said."""
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html", "-d", str(target / "doctrees")]
    command += ["-c", str(root / "docs/site"), str(root), str(target / "html")]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False, timeout=300)
    return done.returncode, done.stdout + done.stderr


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    target = tmp_path_factory.mktemp("site")
    status, said = build(ROOT, target)
    assert status == 0, said
    return target / "html"


def test_every_page_is_in_the_menu_once_and_every_entry_is_a_page():
    listed = [page for section in MENU["section"] for page in section["pages"]]
    assert len(set(listed)) == len(listed)
    pages = {str(page.relative_to(ROOT)) for page in (ROOT / "docs").glob("*.md")} | {"CONTRIBUTING.md", "CHANGELOG.md"}
    waiting = set(MENU["not_there_yet"]["pages"])
    assert pages | {"docs/decisions/README.md"} == set(listed) - (waiting - pages)
    assert waiting <= set(listed)


@pytest.mark.medium
def test_it_is_built_and_begins_at_its_index(site):
    assert 'url=README.html"' in (site / "index.html").read_text(encoding="utf-8")
    first = (site / "README.html").read_text(encoding="utf-8")
    for section in MENU["section"]:
        assert f">{section['name']}</span>" in first
    decisions = (site / "docs/decisions/README.html").read_text(encoding="utf-8")
    assert all(f"{page.stem}.html" in decisions for page in (ROOT / "docs/decisions").glob("0*.md"))


class _Fetched(HTMLParser):
    """What a browser fetches of a page by itself."""

    def __init__(self):
        super().__init__()
        self.found = []

    def handle_starttag(self, tag, attrs):
        names = dict(attrs)
        self.found += [names[name] for name in ("src", "poster") if names.get(name)]
        if tag == "link" and names.get("href"):
            self.found.append(names["href"])


@pytest.mark.medium
def test_nothing_is_fetched_from_elsewhere(site):
    for page in site.rglob("*.html"):
        parser = _Fetched()
        parser.feed(page.read_text(encoding="utf-8"))
        assert parser.found or page.name == "index.html"
        assert [name for name in parser.found if re.match(r"(?:\w+:)?//", name)] == [], page
    for sheet in site.rglob("*.css"):
        assert re.findall(r"(?:url\(|@import)\s*[\"']?(?:https?:)?//", sheet.read_text(encoding="utf-8")) == [], sheet


@pytest.mark.medium
def test_a_browser_shows_it_from_files_on_a_narrow_screen_light_and_dark(site):
    assert CHROMIUM, "the site's tests need a Chromium: apt-get install chromium"
    with ThreadPoolExecutor(1) as pool:  # the studio's tests may have left their browser's event loop in this thread
        pool.submit(look_at, site).result()


def look_at(site):
    from playwright.sync_api import sync_playwright

    asked, wrong = [], []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 390, "height": 800})
        page.on("request", lambda request: asked.append(request.url))
        page.on("requestfailed", lambda request: wrong.append(request.url))
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.goto(f"file://{site}/index.html")
        page.wait_for_url("**/README.html")
        for name in ("wiring", "safety", "cli"):
            page.goto(f"file://{site}/docs/{name}.html")
            assert page.evaluate("document.documentElement.scrollWidth") <= 390, name
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme=scheme)
            colour = page.evaluate("getComputedStyle(document.body).backgroundColor")
            assert (sum(map(int, re.findall(r"\d+", colour)[:3])) > 380) == (scheme == "light")
        page.goto(f"file://{site}/search.html?q=deadman")
        page.wait_for_selector("#search-results li a")
        browser.close()
    assert wrong == []
    assert {url.split(":")[0] for url in asked} <= {"file", "data"}


def repository(root: Path, text: str, listed: list[str]) -> Path:
    """A small one, whose page `docs/a.md` has that text, and whose menu has these pages."""
    shutil.copytree(SITE, root / "docs/site")
    (root / "README.md").write_text("# One\n\n## A heading\n", encoding="utf-8")
    (root / "docs/a.md").write_text(f"# A\n\n{text}\n", encoding="utf-8")
    menu = f'[[section]]\nname = "All"\npages = {listed}\n\n[not_there_yet]\npages = ["docs/later.md"]\n'
    (root / "docs/site/menu.toml").write_text(menu, encoding="utf-8")
    return root


@pytest.mark.medium
def test_what_leads_nowhere_fails(tmp_path):
    text = "[page](gone.md) [heading](../README.md#no-such-heading) ![picture](none.png)"
    root = repository(tmp_path / "bad", text, ["docs/a.md", "docs/b.md"])
    (root / "docs/c.md").write_text("# C\n", encoding="utf-8")
    status, said = build(root, tmp_path)
    assert status != 0
    warnings = [line for line in said.splitlines() if "WARNING" in line]
    for fault in ("gone.md", "no-such-heading", "none.png", "c.md: WARNING: document isn't included", "docs/b"):
        assert sum(fault in line for line in warnings) == 1, said
    assert len(warnings) == 5, said


@pytest.mark.medium
def test_a_page_that_is_not_there_yet_is_left_out(tmp_path):
    root = repository(tmp_path / "good", "[heading](../README.md#a-heading)", ["docs/a.md", "docs/later.md"])
    assert build(root, tmp_path) == (0, "")
