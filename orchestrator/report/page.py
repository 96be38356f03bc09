"""From a report to one HTML file: style, scripts and the plots' library inside, nothing outside."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import jinja2

from foretwin.contracts.terminal import visible
from foretwin.orchestrator.report.blocks import Block, Chapter, Plotted, Report

TEMPLATES = Path(__file__).with_name("templates")


def html_of(report: Report) -> str:
    """Return a report as one HTML file that needs no network and no other file.

    The library of the plots is in it where there are plots.
    """
    figures = list(_figures(report))
    library, script, places = _plots(figures)
    environment = jinja2.Environment(
        autoescape=True,
        loader=jinja2.FileSystemLoader(TEMPLATES),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
    )
    environment.filters |= {
        "shown": visible,
        "kind": lambda block: type(block).__name__,
        "plot": lambda figure: places[id(figure)],
    }
    return environment.get_template("page.html.j2").render(
        report=report,
        style=_text("page.css"),
        script=_text("page.js"),
        library=library,
        plots=script,
    )


def _text(name: str) -> str:
    return (TEMPLATES / name).read_text(encoding="utf-8")


def _figures(report: Report) -> Iterator[Any]:
    for block in all_blocks(report):
        if isinstance(block, Plotted):
            yield block.figure


def all_blocks(report: Report) -> Iterator[Block]:
    """Yield the blocks of a report, those of inner sections too."""
    yield from report.front
    waiting: list[Chapter] = list(reversed(report.parts))
    while waiting:
        part = waiting.pop()
        yield from part.blocks
        waiting += reversed(part.parts)


def _plots(figures: Sequence[Any]) -> tuple[str, str, dict[int, str]]:
    """Return the library, the script that draws, and the place of each figure by its identity."""
    if not figures:
        return "", "", {}
    from bokeh.document import Document
    from bokeh.embed import components
    from bokeh.resources import Resources

    document = Document()
    with document.models.freeze():  # Else all models are gathered anew with each figure.
        for one in figures:
            document.add_root(one)
    script, places = components(tuple(figures))
    library = "\n".join(Resources(mode="inline", components=["bokeh"]).js_raw)
    return library, script, {id(one): place for one, place in zip(figures, places, strict=True)}
