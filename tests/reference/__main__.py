"""Writes docs/reference anew: `python -m tests.reference`."""

from __future__ import annotations

from tests.reference.pages import FOLDER, pages

FOLDER.mkdir(exist_ok=True)
for name, text in pages().items():
    (FOLDER / name).write_text(text, encoding="utf-8")
    print(f"docs/reference/{name}: {len(text.splitlines())} lines")
