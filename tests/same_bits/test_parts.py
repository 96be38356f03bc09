"""What the parts draw and read, without running a command."""

from __future__ import annotations

import math
from pathlib import Path

from foretwin.world_gen.export.formats import FORMATS
from tests.same_bits.sweeps import columns, trajectories
from tests.same_bits.worlds import EXPORTS, draw_places, file_digest

TOWN = {"town.osm": [{"id": f"n{i}", "lat": 45.0, "lon": -30.0} for i in range(5)]}
MOST = {"town.osm": 2, "other.osm": 2}


def test_every_format_is_exported() -> None:
    assert {options[1] for _, options in EXPORTS.values()} == set(FORMATS)


def test_places_are_drawn_by_the_seed_and_by_map() -> None:
    other = {"other.osm": [{"id": f"n{i}"} for i in range(40)]}

    places = draw_places(TOWN, most=MOST, seed=1)

    assert len(places) == 3
    assert places[-1].arguments == ("--bbox=-30.00200,44.99800,-29.99800,45.00200",)
    assert draw_places(other | TOWN, most=MOST, seed=1)[-3:] == places
    assert any(draw_places(TOWN, most=MOST, seed=seed) != places for seed in range(2, 6))


def test_the_day_of_writing_is_left_out_and_nothing_else(tmp_path: Path) -> None:
    texts = (
        '<commonRoad benchmarkID="a" date="2026-01-01">',
        '<commonRoad benchmarkID="a" date="2026-01-02">',
        '<commonRoad benchmarkID="b" date="2026-01-01">',
    )
    digests = []
    for number, text in enumerate(texts):
        file = tmp_path / f"{number}.xml"
        file.write_text(text)
        digests.append(file_digest(file))

    assert digests[0] == digests[1] != digests[2]


def test_rows_are_compared_in_any_order_and_whatever_numbers_them() -> None:
    one = {"cell": 0, "trajectory_sha256": "a", "collision_with": "", "metric_ttc": None}
    two = {"cell": 1, "trajectory_sha256": "b", "collision_with": "road_user", "metric_ttc": 1.5}
    again = {"cell": 7, "trajectory_sha256": "b", "collision_with": 1, "metric_ttc": 1.5}
    nan = {"cell": 9, "trajectory_sha256": "a", "collision_with": 0, "metric_ttc": math.nan}

    assert trajectories([one, two, two]) == {"a": {"times": "1"}, "b": {"times": "2"}}
    before, other = columns([one, two], "ab"), two | {"metric_ttc": math.nextafter(1.5, 2.0)}
    assert before == columns([again, nan], "ab")
    after = columns([one, other], "ab")
    assert [name for name in before if after[name] != before[name]] == ["metric_ttc"]
    assert columns([one, two], "a") == columns([one, other], "a")
