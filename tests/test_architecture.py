"""ARCHITECTURE.md names files that are there, and its walks lead where it says."""

from __future__ import annotations

import re

import pytest

from tests.test_layout import ROOT, tracked_files

TEXT = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
MOST_WORDS = 1_650
"""Two printed pages."""


def test_it_is_read_in_two_pages() -> None:
    assert len(TEXT.split()) <= MOST_WORDS


def test_every_file_that_it_names_is_there() -> None:
    named = set(re.findall(r"`([\w/]+\.py)`", TEXT))
    there = ["/" + path.relative_to(ROOT).as_posix() for path in tracked_files()]

    assert len(named) > 50
    assert sorted(one for one in named if not any(p.endswith("/" + one) for p in there)) == []


@pytest.mark.parametrize(
    ("file", "says"),
    [
        ("orchestrator/drive/intake.py", "telemetry.estimator.estimator import"),
        ("orchestrator/other_vehicles/live.py", "telemetry.estimator."),
        ("world_gen/lanes/lane_tags.py", "width"),
        ("world_gen/lanes/cross_section.py", "lanes.lane_tags import"),
        ("world_gen/lanes/lane_curves.py", "width"),
        ("contracts/numbers.py", '"friction'),
        ("sim_worker/futures/number_columns.py", "changed_numbers("),
        ("sim_worker/futures/play.py", "friction"),
        ("sim_worker/batch/batch_simulation.py", "friction"),
        ("sim_worker/vehicle/actuation.py", "friction"),
        ("sim_worker/futures/future_rows.py", "numbers_of("),
    ],
)
def test_a_walk_goes_through_the_files_that_it_names(file: str, says: str) -> None:
    walks = TEXT.split("**Three walks.**")[1].split("\n\n")[0]

    assert file.rpartition("/")[2] in walks
    assert says in (ROOT / file).read_text(encoding="utf-8")
