from __future__ import annotations

from tests.orchestrator.across.views_document import DOCUMENT, written


def test_the_document_lists_every_view_with_its_columns() -> None:
    text = DOCUMENT.read_text(encoding="utf-8")

    assert written(text) == text, "python -m tests.orchestrator.across.views_document"
