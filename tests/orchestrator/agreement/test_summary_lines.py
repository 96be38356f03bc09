"""What a drive's end says of human and ADS."""

from __future__ import annotations

from typing import Any

from foretwin.orchestrator.drive.summary import DISAGREEMENTS_SHOWN, side_by_side_lines


def test_each_segment_and_each_place_is_a_line_and_many_are_counted() -> None:
    segment: dict[str, Any] = {
        "control_mode": "manual", "from_stamp_ns": 0, "to_stamp_ns": 12_000_000_000, "plans": 40,
        "lateral_m": 3.4, "along_m": 5.0, "speed_mps": 1.0,
    }  # fmt: skip
    unplanned = segment | {"control_mode": "autonomous", "plans": 0, "lateral_m": None}
    one = {
        "drive_time_s": 6.0, "kind": "ads_stops", "duration_s": 3.0, "lat_deg": 52.5,
        "lon_deg": 13.4, "junction_id": "n4",
    }  # fmt: skip
    lines = side_by_side_lines({"segments": [segment, unplanned], "disagreements": [one] * 15})
    assert lines[0].startswith("  manual for 12.0 s: 40 plans of the ADS, 95 % within 3.4 m across")
    assert lines[1] == "      6.0 s  ads stops for 3.0 s at 52.500000, 13.400000 (n4)"
    assert len(lines) == 1 + DISAGREEMENTS_SHOWN + 1
    assert lines[-1] == "  and 3 more in results/disagreements.parquet"
    assert side_by_side_lines(None) == []


def test_of_how_many_plans_the_way_is_known_is_said_where_it_is_not_of_all() -> None:
    segment: dict[str, Any] = {
        "control_mode": "manual", "from_stamp_ns": 0, "to_stamp_ns": 630_000_000_000, "plans": 3150,
        "ways": 150, "lateral_m": 1.8, "along_m": 0.0, "speed_mps": 0.0,
    }  # fmt: skip
    stood = segment | {"ways": 0, "lateral_m": None}
    lines = side_by_side_lines({"segments": [segment, stood], "disagreements": []})
    assert lines == [
        "  manual for 630.0 s: 3150 plans of the ADS, 95 % within 1.8 m across (of the 150 whose "
        "way could be compared), 0.0 m along, 0.0 m/s of what was then driven",
        "  manual for 630.0 s: 3150 plans of the ADS, 95 % within 0.0 m along, 0.0 m/s of what was "
        "then driven",
    ]
