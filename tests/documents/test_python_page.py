"""The page of the public face is that of the face as it is."""

from __future__ import annotations

from tests.documents.python_page import PAGE, written


def test_the_page_is_what_the_docstrings_say() -> None:
    assert PAGE.read_text(encoding="utf-8") == written(), "python -m tests.documents.python_page"
