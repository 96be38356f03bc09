import math
from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.codec import write_message
from foretwin.contracts.elevation import RoadSlopes
from foretwin.geometry.slopes import Slopes, read_slopes, road_slopes, slopes_of
from tests.sim_worker.hilly import hilly
from tests.sim_worker.places import crossroads


def grade_at(slopes: Slopes, x: float, y: float, yaw_deg: float) -> float:
    yaw = math.radians(yaw_deg)
    heading = np.array([[math.cos(yaw)], [math.sin(yaw)]])
    return float(slopes.grade_at(np.array([[x], [y]]), heading)[0])


def test_a_road_climbs_one_way_and_falls_the_other() -> None:
    slopes = slopes_of(hilly(0.08))
    assert slopes is not None

    assert grade_at(slopes, 60.0, -1.0, 0.0) == pytest.approx(0.08)
    assert grade_at(slopes, 60.0, -1.0, 180.0) == pytest.approx(-0.08)
    assert grade_at(slopes, 60.0, -1.0, 60.0) == pytest.approx(0.04)
    assert grade_at(slopes, 1.5, 60.0, 90.0) == pytest.approx(0.0, abs=1e-12)


def test_where_two_roads_cross_each_heading_feels_its_own() -> None:
    place = np.array([[0.0, 0.0], [1.0, 0.0]])
    across = RoadSlopes(
        xy_m=place,
        direction=np.array([[1.0, 0.0], [0.0, 1.0]]),
        grade=np.array([0.05, -0.12]),
        grade_std=0.0,
    )
    slopes = Slopes(across)

    assert grade_at(slopes, 0.6, 0.0, 0.0) == pytest.approx(0.05)
    assert grade_at(slopes, 0.4, 0.0, 90.0) == pytest.approx(-0.12)
    assert grade_at(slopes, 0.4, 0.0, 270.0) == pytest.approx(0.12)


def test_far_from_all_roads_and_in_a_flat_world_nothing_climbs() -> None:
    slopes = slopes_of(hilly(0.08))
    assert slopes is not None

    assert grade_at(slopes, 90.0, 90.0, 0.0) == 0.0
    assert slopes_of(crossroads()) is None
    assert slopes_of(None) is None


def test_slopes_come_back_from_a_file(tmp_path: Path) -> None:
    found = road_slopes(hilly(0.05))
    assert found is not None
    write_message(found, tmp_path / "slopes.msg")

    assert grade_at(read_slopes(tmp_path / "slopes.msg"), 60.0, -1.0, 0.0) == pytest.approx(0.05)
