"""How Sphinx makes the site of the pages as they stand in the repository: `make docs`."""

import tomllib
from pathlib import Path

from pygments.lexers.special import TextLexer

ROOT = Path(__file__).parents[2]
MENU = tomllib.loads((ROOT / "docs/site/menu.toml").read_text(encoding="utf-8"))
START = "README"

project = "bubbleskin"
extensions = ["myst_parser"]
root_doc = START
# The root of the repository is the source, so links between pages are the same here and there.
include_patterns = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "docs/**.md"]
exclude_patterns = [".*", "build", "dist", "**/__pycache__", "protocol", "firmware", "host_sdk", "tests", "tools"]

myst_heading_anchors = 4  # every heading can be linked to, by the name that it has in a repository's view
nitpicky = True

html_theme = "furo"  # its fonts are the reader's own, and it fetches nothing
html_title = "bubbleskin"
html_static_path = ["static"]
html_css_files = ["style.css"]
html_extra_path = ["root"]  # index.html, which leads to the first page
html_copy_source = False
html_show_search_summary = False  # it is fetched, which a browser does not do where pages are files
html_show_sphinx = False
html_show_copyright = False
html_theme_options = {"top_of_page_buttons": []}  # they would lead to a repository's page


def menu(sections: list[dict], there: set[str]) -> str:
    """The sections as MyST's lists of pages; a page that is not there yet is left out."""
    blocks = []
    for section in sections:
        pages = [page for page in section["pages"] if page in there or page not in MENU["not_there_yet"]["pages"]]
        lines = "\n".join("/" + page.removesuffix(".md") for page in pages)
        blocks.append(f"\n```{{toctree}}\n:hidden:\n:caption: {section['name']}\n{lines}\n```\n")
    return "".join(blocks)


def add_menu(app, docname: str, source: list[str]) -> None:
    """Give the first page the menu, and the decisions' page all decisions: neither is written in a page."""
    if docname == START:
        source[0] += menu(MENU["section"], {f"{name}.md" for name in app.env.found_docs})
    elif docname == "docs/decisions/README":
        source[0] += "\n```{toctree}\n:hidden:\n:glob:\n[0-9]*\n```\n"


def setup(app) -> None:
    """What Sphinx calls."""
    app.add_lexer("mermaid", TextLexer)  # a browser would have to fetch what draws it; the table below it says the same
    app.connect("source-read", add_menu)
