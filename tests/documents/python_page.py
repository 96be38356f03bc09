"""`python -m tests.documents.python_page` writes docs/reference/python.md from the docstrings."""

from __future__ import annotations

import inspect

import foretwin
from tests.documents.blocks import ROOT

PAGE = ROOT / "docs" / "reference" / "python.md"
HEAD = """# From Python

`import foretwin` gives these; each is loaded when it is first used. `help(foretwin.NAME)` tells the
rest: arguments, units, frames, errors. Programs that speak with a drive import `foretwin.bus`
([bus](../bus.md)). This page is written from the docstrings.

| name | |
|---|---|
"""


def written() -> str:
    """Return the page."""
    rows = []
    for name in sorted(foretwin._MODULE_OF, key=str.casefold):
        what = getattr(foretwin, name)
        called = callable(what) and not inspect.isclass(what)
        told = (inspect.getdoc(what) or "").split("\n\n")[0].replace("\n", " ")
        rows.append(f"| `{name}{'(…)' if called else ''}` | {told.replace('|', chr(92) + '|')} |")
    return HEAD + "\n".join(rows) + "\n"


if __name__ == "__main__":
    PAGE.write_text(written(), encoding="utf-8")
