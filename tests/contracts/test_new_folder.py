"""What was made for nothing is taken away, and nothing else."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from foretwin.contracts.new_folder import (
    named_in_errors,
    new_files,
    new_folder,
    trouble_with_folder,
)


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


def test_it_is_tried_and_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    for folder in (tmp_path / "there", tmp_path / "a" / "b"):
        assert trouble_with_folder(folder) is None
    assert [path.name for path in tmp_path.rglob("*")] == ["there"]


def test_many_may_try_the_same_folder_at_once(tmp_path: Path) -> None:
    folder = tmp_path / "runs"
    with ThreadPoolExecutor(4) as threads:
        told = set(threads.map(trouble_with_folder, [folder] * 400))
    assert told == {None}
    assert not folder.exists()


def test_folders_of_the_system_take_nothing(tmp_path: Path) -> None:
    """Their permissions say otherwise to root."""
    for name in ("/proc/x", "/proc/x/y"):
        assert trouble_with_folder(Path(name)) == "folder /proc cannot be written to"
    long = trouble_with_folder(tmp_path / ("x" * 300))
    assert long == f"folder {tmp_path} cannot be written to: file name too long"


def test_new_files_are_all_there_or_none(tmp_path: Path) -> None:
    def half_written(folder: Path) -> None:
        with new_files(folder):
            (folder / "half").touch()
            raise OSError("no room")

    (tmp_path / "old").touch()
    for folder in (tmp_path, tmp_path / "a" / "b"):
        with pytest.raises(OSError, match="no room"):
            half_written(folder)
    assert [path.name for path in tmp_path.iterdir()] == ["old"]
    with new_files(tmp_path):
        (tmp_path / "whole").touch()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["old", "whole"]


def test_an_error_that_names_nothing_names_what_was_written() -> None:
    with pytest.raises(OSError, match="space") as full, named_in_errors("--out x"):
        raise OSError(28, "full")
    assert (full.value.errno, full.value.filename) == (28, "--out x")
    with pytest.raises(OSError, match="full") as other, named_in_errors("--out x"):
        raise OSError(28, "full", "y")
    assert other.value.filename == "y"
