"""The figures of a segment, and the greatest differences of a disagreement."""

from __future__ import annotations

import pytest

from foretwin.contracts.frames import GeoPoint
from foretwin.sim_worker.analysis.side_by_side.departure import Departure
from foretwin.sim_worker.analysis.side_by_side.segment import AspectWatch, DrivePlace, Segment

ASIDE = Departure(1.8, 0.0, 0.0, 0.0, 10.0, 10.0)
STANDING = Departure(None, None, 0.0, 0.0, 0.0, 0.0)
"""As departure() has a plan to stand where the car stood."""
HERE = DrivePlace(GeoPoint(52.5, 13.4))


def segment() -> Segment:
    return Segment(0, "manual", 0, (AspectWatch("ego", 0, "way"), AspectWatch("ego", 0, "pace")))


def test_standing_moves_no_figure_of_the_ways() -> None:
    """30 s of plans 1.8 m aside, then 600 s of standing as planned."""
    one = segment()
    for _ in range(150):
        one.count(ASIDE)
    for _ in range(3000):
        one.count(STANDING)
    told = one.record()
    assert (told.plans, told.ways) == (3150, 150)
    assert told.lateral_m == pytest.approx(1.8)
    assert (told.along_m, told.speed_mps) == (0.0, 0.0)


def test_without_a_way_there_is_no_figure_of_ways() -> None:
    one = segment()
    one.count(STANDING)
    assert (one.record().ways, one.record().lateral_m, one.record().along_m) == (0, None, 0.0)


def test_a_disagreement_has_the_greatest_differences_that_are_known() -> None:
    """The human stops where the ADS goes on; only some of the plans had a way to compare."""
    watch = AspectWatch("ego", 0, "pace")
    found = [STANDING, ASIDE._replace(lateral_m=-0.4), STANDING._replace(speed_mps=8.0)]
    for tick, departure in enumerate(found):
        watch.take(tick * 200_000_000, "human_stops", False, departure, HERE)
    (told,) = watch.finish()
    assert (told.lateral_m, told.speed_mps) == (-0.4, 8.0)


def test_a_disagreement_without_a_way_has_none_to_lie_beside() -> None:
    watch = AspectWatch("ego", 0, "pace")
    for tick in range(3):
        watch.take(tick * 200_000_000, "human_stops", False, STANDING, HERE)
    (told,) = watch.finish()
    assert told.lateral_m is None
