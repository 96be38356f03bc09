"""Files that are found whole or not at all."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.partial_file import partial_file


def test_what_was_there_stays_until_the_new_is_whole(tmp_path: Path) -> None:
    file = tmp_path / "word.txt"
    file.write_text("before")
    with partial_file(file) as partial:
        partial.write_text("after")
        assert file.read_text() == "before"
        assert partial.name == "word.txt.partial"
    assert (file.read_text(), list(tmp_path.iterdir())) == ("after", [file])


@pytest.mark.parametrize("written", [True, False])
def test_of_what_failed_nothing_stays(tmp_path: Path, written: bool) -> None:
    def fail() -> None:
        with partial_file(tmp_path / "word.txt", ending=".new") as partial:
            if written:
                partial.write_text("half a")
            raise ValueError("no more words")

    with pytest.raises(ValueError, match="no more words"):
        fail()
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_was_never_written_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), partial_file(tmp_path / "word.txt"):
        pass
