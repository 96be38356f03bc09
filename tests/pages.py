"""What pages of the documentation say, for tests that hold it against the program."""

from __future__ import annotations

from functools import cache

from tests.test_layout import ROOT


@cache
def page(name: str) -> str:
    """Return the words of a page below docs/, as one line."""
    return " ".join((ROOT / "docs" / name).read_text(encoding="utf-8").split())
