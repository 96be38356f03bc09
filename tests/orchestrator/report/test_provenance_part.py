"""What a report says of where its figures come from, and what it leaves out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from foretwin.orchestrator.report import provenance_part as module
from foretwin.orchestrator.report.blocks import Chapter, Listed
from foretwin.orchestrator.report.provenance_part import provenance_part
from foretwin.orchestrator.report.redaction import PlaceNames, names_of

CONFIG: dict[str, Any] = {
    "map": "maps/berlin.osm",
    "futures": 64,
    "planner": "pure_pursuit_idm",
    "scenarios": ["scp", "ccftap"],
    "secure": "tempelhof",
    "anchor": "tempelhof.toml",
    "vehicles": [{"id": "second", "log": "/data/gendarmenmarkt_friday.mcap"}],
    "virtual_traffic": {"source": "sumo", "network": "networks/kreuzberg.xodr"},
    "metrics": "192.168.7.3:9464",
}
TELLING = "berlin", "tempelhof", "gendarmenmarkt", "kreuzberg", "192.168"


def table_of(chapter: Chapter, title: str) -> Listed:
    (found,) = (one for one in chapter.blocks if isinstance(one, Listed) and one.title == title)
    return found


def settings(*, places: bool, folder: Path) -> str:
    chapter = provenance_part(folder, {"config": CONFIG}, places=places)
    return str(table_of(chapter, "Settings that were not left out"))


def test_settings_that_name_a_file_at_any_depth_are_left_out_with_places(tmp_path: Path) -> None:
    told = settings(places=False, folder=tmp_path)
    assert [word for word in TELLING if word in told] == []
    assert all(word in told for word in ("futures", "pure_pursuit_idm", "ccftap"))
    whole = settings(places=True, folder=tmp_path)
    assert [word for word in TELLING if word in whole] == list(TELLING)


def test_files_of_other_cars_are_known_by_name_wherever_they_are_told() -> None:
    names = PlaceNames(names_of({"config": CONFIG}, ()))
    said = names.without("gendarmenmarkt_friday.mcap follows kreuzberg, of berlin.osm")
    assert not any(word in said for word in TELLING)


def test_what_is_too_large_to_hash_leaves_the_others_their_hashes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_HASHED_BYTES", 100)
    (tmp_path / "results").mkdir()
    for name, size in (("drive.mcap", 101), ("results/futures.parquet", 60), ("run.json", 40)):
        (tmp_path / name).write_bytes(bytes(size))
    listed = table_of(provenance_part(tmp_path, {}), "Files of the folder")
    hashed = {str(one[0]): "not hashed" not in str(one) for one in listed.rows}
    assert sorted(hashed.values()) == [False, True, True]
    (large,) = (name for name, known in hashed.items() if not known)
    assert "drive.mcap" in large
