"""Recordings in parts: the first keeps its name, the others are numbered."""

from __future__ import annotations

from pathlib import Path

from foretwin.contracts.segments import (
    Roll,
    first_left,
    first_name,
    next_number,
    number_of,
    segment_file,
    segments_of,
)


def test_parts_are_found_in_their_order_and_others_are_none(tmp_path: Path) -> None:
    first = tmp_path / "drive.mcap"
    assert (segments_of(first), next_number(first)) == ([], 1)
    for number in (1, 10, 2, 1000):
        segment_file(first, number).touch()
    for other in ("drive-2.mcap", "drive-0002.mcap", "drive-002.rrd", "drives-002.mcap"):
        (tmp_path / other).touch()
    names = [path.name for path in segments_of(first)]
    assert names == ["drive.mcap", "drive-002.mcap", "drive-010.mcap", "drive-1000.mcap"]
    assert next_number(first) == 1001


def test_a_folder_that_is_not_there_holds_no_part(tmp_path: Path) -> None:
    assert segments_of(tmp_path / "missing" / "drive.mcap") == []


def test_a_name_tells_its_number() -> None:
    first = Path("drive.mcap")
    assert [number_of(first, segment_file(first, number)) for number in (1, 2, 999)] == [1, 2, 999]
    assert number_of(first, Path("drive-001.mcap")) is None


def test_a_part_tells_the_name_of_the_first() -> None:
    for name in ("drive.mcap", "drive-002.mcap", "drive-1000.mcap"):
        assert first_name(Path("run", name)) == Path("run/drive.mcap")
    for name in ("drive-001.mcap", "drive-02.mcap", "drive-0002.mcap"):
        assert first_name(Path(name)) == Path(name), "no part"


def test_the_oldest_part_that_is_left_is_found(tmp_path: Path) -> None:
    first = tmp_path / "drive.mcap"
    assert first_left(first) == first
    for number in (3, 4):
        segment_file(first, number).touch()
    assert first_left(first).name == "drive-003.mcap"


def test_a_part_ends_by_size_or_age() -> None:
    roll = Roll(most_bytes=10, most_s=5.0)
    assert [roll.is_due(size_bytes=b, age_s=s) for b, s in ((9, 4.9), (10, 0.0), (0, 5.0))] == [
        False, True, True,
    ]  # fmt: skip
