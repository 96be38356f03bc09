"""How the pages of this folder become a site, `make docs`: nothing is fetched, now or when read."""

from pathlib import Path

from sphinx.application import Sphinx

project = "foretwin"
project_copyright = "the foretwin authors; maps © OpenStreetMap contributors"
extensions = ["myst_parser"]
myst_heading_anchors = 4
html_theme = "furo"
html_title = "foretwin"
html_theme_options = {"footer_icons": []}
html_show_sourcelink = False


def setup(app: Sphinx) -> None:
    """Let pages that the first one does not name stand at the end of its reference."""
    app.connect("source-read", name_the_rest)


def name_the_rest(app: Sphinx, page: str, source: list[str]) -> None:
    """Replace `(all other pages)` in the first page by those of this folder that it lacks."""
    if page == "index":
        named = set(source[0].split())
        rest = [path.stem for path in sorted(Path(app.srcdir).glob("*.md"))]
        rest = [name for name in rest if name not in named | {"index"}]
        source[0] = source[0].replace("(all other pages)", "\n".join(rest))
