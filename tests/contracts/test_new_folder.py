"""What was made for nothing is taken away, and nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.new_folder import new_folder, trouble_with_folder


def half_made(folder: Path, *, file: str = "") -> None:
    with new_folder(folder):
        if file:
            (folder / file).touch()
        raise ValueError("no result")


def test_a_folder_is_made_with_those_around_it(tmp_path: Path) -> None:
    with new_folder(tmp_path / "a" / "b"):
        pass
    assert (tmp_path / "a" / "b").is_dir()


def test_it_goes_again_where_something_is_raised(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no result"):
        half_made(tmp_path / "a" / "b")
    assert list(tmp_path.iterdir()) == []


def test_folders_that_were_there_or_that_hold_something_stay(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    for folder, file in ((tmp_path / "a", ""), (tmp_path / "b", "precious")):
        with pytest.raises(ValueError, match="no result"):
            half_made(folder, file=file)
    assert (tmp_path / "a").is_dir()
    assert (tmp_path / "b" / "precious").is_file()


def test_what_stands_in_a_folders_way_is_told(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.touch()
    assert trouble_with_folder(tmp_path) is None
    assert trouble_with_folder(tmp_path / "a" / "b") is None
    assert trouble_with_folder(file) == "is no folder"
    assert trouble_with_folder(file / "a" / "b") == f"{file} is no folder"
