"""Which stretches two drives have in common: loops, holes, crossings, the other way round."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.sim_worker.analysis.two_drives.common_stretches import common_ways
from tests.sim_worker.analysis.two_drives.drawn_drives import BEND, LOOP, driven, line


def lengths(*stretches: object) -> list[float]:
    return sorted(round(one.length_m) for one in stretches)  # type: ignore[attr-defined]


def test_one_road_is_one_stretch_whoever_drove_first() -> None:
    a, b = line(driven(BEND, 8.0)), line(driven(BEND, 12.0, left_m=3.0, start_s=5000.0))
    for first, second in ((a, b), (b, a)):
        (one,) = common_ways(first, second).stretches
        assert one.length_m == pytest.approx(first.length_m, abs=12.0)
        assert (np.diff(one.rows_a) >= 0).all()
        assert (np.diff(one.rows_b) > 0).all()


def test_a_road_driven_the_other_way_round_is_told_and_not_compared() -> None:
    a, b = line(driven(BEND, 8.0)), line(driven(BEND[::-1], 8.0))
    found = common_ways(a, b)
    assert found.stretches == ()
    assert found.opposite_b.mean() > 0.95


def test_roads_that_cross_have_nothing_in_common() -> None:
    a = line(driven(np.array([[-100.0, 0.0], [100.0, 0.0]]), 8.0))
    b = line(driven(np.array([[0.0, -100.0], [0.0, 100.0]]), 8.0))
    found = common_ways(a, b)
    assert found.stretches == ()
    assert not found.opposite_b.any()


def test_a_parallel_road_is_another_road() -> None:
    a, b = line(driven(BEND, 8.0)), line(driven(BEND, 8.0, left_m=15.0))
    assert common_ways(a, b).stretches == ()
    # Positions known to 5 m: it may be the same.
    rough = line(driven(BEND, 8.0, left_m=15.0, std_m=5.0))
    assert common_ways(a, rough).stretches


def test_each_lap_of_a_loop_meets_each_lap_of_another() -> None:
    once, twice = line(driven(LOOP, 8.0)), line(driven(np.concatenate([LOOP, LOOP[1:]]), 8.0))
    assert lengths(*common_ways(twice, once).stretches) == pytest.approx([480, 480], abs=12)
    assert lengths(*common_ways(once, twice).stretches) == pytest.approx([480, 480], abs=12)


def test_a_drive_meets_itself_only_where_it_came_again() -> None:
    thrice = line(driven(np.concatenate([LOOP, LOOP[1:], LOOP[1:]]), 8.0))
    found = common_ways(thrice, thrice, same_drive=True).stretches
    # The second lap with the first, the third with both: the latter two in one go.
    assert sum(one.length_m for one in found) == pytest.approx(3 * 480, abs=40)
    for one in found:
        assert (thrice.time_s[one.rows_b] - thrice.time_s[one.rows_a] > 30.0).all()
    once = line(driven(LOOP, 8.0))
    assert common_ways(once, once, same_drive=True).stretches == ()


def test_a_hole_in_one_drive_parts_the_stretch() -> None:
    a, b = line(driven(BEND, 10.0)), line(driven(BEND, 10.0, hole_s=(10.0, 20.0)))
    for first, second in ((a, b), (b, a)):
        found = common_ways(first, second).stretches
        assert len(found) == 2
        assert sum(one.length_m for one in found) == pytest.approx(b.length_m, abs=15.0)


def test_a_short_detour_leaves_two_stretches() -> None:
    straight = np.array([[0.0, 0.0], [400.0, 0.0]])
    around = np.array(
        [[0.0, 0.0], [150.0, 0.0], [150.0, 60.0], [250.0, 60.0], [250.0, 0.0], [400.0, 0.0]]
    )
    a, b = line(driven(straight, 8.0)), line(driven(around, 8.0))
    found = common_ways(a, b).stretches
    assert lengths(*found) == pytest.approx([150, 150], abs=15)


def test_a_stretch_ends_where_one_of_the_drives_does() -> None:
    longer = np.array([[-40.0, 0.0], [460.0, 0.0]])
    a, b = line(driven(np.array([[0.0, 0.0], [400.0, 0.0]]), 8.0)), line(driven(longer, 8.0))
    (one,) = common_ways(a, b).stretches
    assert b.xy_m[one.rows_b[[0, -1]], 0] == pytest.approx([0.0, 400.0], abs=1.6)


def test_a_way_that_is_longer_for_a_moment_parts_the_stretch() -> None:
    """8 m of one are 20 m of the other, round something that stands there."""
    around = np.array([[0.0, 0.0], [150.0, 0.0], [154.0, 9.0], [158.0, 0.0], [300.0, 0.0]])
    straight = np.array([[0.0, 0.0], [300.0, 0.0]])
    found = common_ways(line(driven(around, 5.0)), line(driven(straight, 5.0))).stretches
    assert len(found) == 2
