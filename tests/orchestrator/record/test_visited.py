"""The junctions of a run from its tables: each passage once, with the rounds that were its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from foretwin.orchestrator.record.results import TABLES
from foretwin.orchestrator.record.run_streams import RunStreams
from foretwin.orchestrator.record.visited import RoundsOf, visited_junctions


def passage(junction_id: str, seen_s: float, arrived_s: float, **more: Any) -> dict[str, Any]:
    return {
        "id": junction_id, "kind": "crossing", "name": "Mill Lane", "control": "stop", "lat": 45.0,
        "lon": -30.0, "seen_at_s": seen_s, "arrived_at_s": arrived_s, "built_at_s": seen_s,
        "within_radius_at_s": seen_s + 1.0, "world_ready_before_s": 1.0, **more,
    }  # fmt: skip


def a_round(junction_id: str, drive_time_s: float) -> dict[str, Any]:
    return {"intersection_id": junction_id, "drive_time_s": drive_time_s, "futures": 4}


def write(folder: Path, **tables: list[dict[str, Any]]) -> None:
    streams = RunStreams(folder, TABLES)
    for table, rows in tables.items():
        streams.take(table, rows)
    streams.write(sync=False)
    streams.close()


def test_each_passage_has_the_rounds_before_it_and_while_the_car_leaves(tmp_path: Path) -> None:
    write(
        tmp_path,
        junctions=[passage("a", 0.0, 10.0), passage("b", 2.0, 20.0), passage("a", 10.0, 30.0)],
        rounds=[a_round("a", 1.0), a_round("a", 9.0), a_round("a", 11.0), a_round("b", 12.0),
                a_round("a", 25.0)],
    )  # fmt: skip
    records = visited_junctions(tmp_path).records
    assert [(one["id"], one["rounds"], one["futures"]) for one in records] == [
        ("a", 3, 12), ("b", 1, 4), ("a", 1, 4),
    ]  # fmt: skip
    assert "seen_at_s" not in records[0]
    assert records[0]["arrived_at_s"] == 10.0


def test_the_last_row_of_a_passage_counts_and_what_is_ahead_is_counted(tmp_path: Path) -> None:
    late = passage("a", 0.0, 10.0, built_at_s=None)
    write(
        tmp_path,
        junctions=[late, passage("a", 0.0, 10.0, built_at_s=11.0)],
        rounds=[a_round("a", 12.0), a_round("c", 13.0), a_round("c", 14.0)],
    )
    (record,), ahead = visited_junctions(tmp_path)
    assert record["built_at_s"] == 11.0
    assert ahead == {"c": RoundsOf(2, 8)}


def test_a_run_without_tables_has_none(tmp_path: Path) -> None:
    assert visited_junctions(tmp_path) == ([], {})
