"""docs/reference says what the types and tables say; `python -m tests.reference` writes it anew."""

from __future__ import annotations

import pytest

from tests.reference.pages import FOLDER, MADE, pages

PAGES = pages()


def test_there_is_no_page_of_something_else() -> None:
    texts = {path.name: path.read_text(encoding="utf-8") for path in FOLDER.glob("*.md")}
    assert {name for name, text in texts.items() if text.startswith(MADE)} == set(PAGES)


@pytest.mark.parametrize("name", sorted(PAGES))
def test_a_page_is_what_the_program_is(name: str) -> None:
    written = (FOLDER / name).read_text(encoding="utf-8")
    assert written == PAGES[name], "run `python -m tests.reference`"


def test_pages_tell_what_is_looked_for() -> None:
    assert "| `horizon_s` | number | `8.0` | 1 to 60 |" in PAGES["drive.md"]
    assert "| `mass_kg` | table Parameter | needed | 150 to 60000 |" in PAGES["vehicle.md"]
    assert "| `gnss` | `foretwin/v1/vehicle/{vehicle}/telemetry/gnss` |" in PAGES["channels.md"]
    assert "| `criticality` | double |" in PAGES["tables.md"]
    assert "| 130 | interrupted" in PAGES["exit-codes.md"]
