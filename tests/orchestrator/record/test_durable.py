"""Whole files: the old one or the new one, never half of one."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.orchestrator.record.durable import sync_folder, whole_file


def test_a_file_gets_its_name_when_it_is_whole(tmp_path: Path) -> None:
    file = tmp_path / "a.txt"
    file.write_text("old")
    with whole_file(file) as partial:
        partial.write_text("new")
        assert file.read_text() == "old"
    sync_folder(tmp_path)

    assert file.read_text() == "new"
    assert list(tmp_path.iterdir()) == [file]


def test_what_fails_leaves_what_was_there(tmp_path: Path) -> None:
    file = tmp_path / "a.txt"
    file.write_text("old")
    with pytest.raises(OSError, match="full"):
        write_half(file)

    assert file.read_text() == "old"
    assert list(tmp_path.iterdir()) == [file]


def write_half(file: Path) -> None:
    with whole_file(file) as partial:
        partial.write_text("ne")
        raise OSError("full")
