"""Recordings in parts: the first keeps its name, the others are numbered."""

from __future__ import annotations

from pathlib import Path

from foretwin.contracts.segments import next_number, number_of, segment_file, segments_of


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
