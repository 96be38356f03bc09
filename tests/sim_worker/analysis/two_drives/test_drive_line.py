"""A drive as a line: what it did at each metre, and where it was at each moment."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from foretwin.sim_worker.analysis.two_drives.drive_line import drive_line
from tests.sim_worker.analysis.two_drives.drawn_drives import BEND, FRAME, driven, line

STRAIGHT = np.array([[0.0, 0.0], [300.0, 0.0]])


def test_places_stand_a_metre_apart_with_time_and_speed() -> None:
    found = line(driven(STRAIGHT, 8.0))
    assert found.length_m == pytest.approx(299.0, abs=1.0)
    assert found.xy_m[100] == pytest.approx([100.0, 0.0], abs=0.05)
    assert found.time_s == pytest.approx(found.arc_m / 8.0, abs=0.02)
    assert found.speed_mps == pytest.approx(8.0)
    assert found.along == pytest.approx(np.tile([1.0, 0.0], (len(found.along), 1)), abs=1e-3)
    assert found.std_m == 0.02


def test_standing_still_is_time_at_one_place() -> None:
    found = line(driven(STRAIGHT, 10.0, stands=(100.0, 20.0)))
    assert found.time_s[95] == pytest.approx(9.5, abs=0.1)
    assert found.time_s[105] == pytest.approx(30.5, abs=0.1)
    assert found.come_m(np.array([12.0, 20.0, 29.0])) == pytest.approx(100.0, abs=0.6)
    assert found.come_m(np.array([35.0])) == pytest.approx(149.0, abs=1.5)


def test_positions_that_jitter_while_the_car_stands_are_no_way() -> None:
    states = driven(STRAIGHT, 10.0, stands=(100.0, 60.0))
    noise = np.random.default_rng(3).normal(0.0, 1e-6, (len(states), 2))
    jittered = [
        msgspec.structs.replace(
            s,
            position=msgspec.structs.replace(
                s.position, lat_deg=s.position.lat_deg + n, lon_deg=s.position.lon_deg + e
            ),
        )
        for s, (n, e) in zip(states, noise.tolist(), strict=True)
    ]
    found = line(jittered)
    assert found.length_m == pytest.approx(300.0, abs=12.0)
    assert (np.diff(found.moment_m) >= 0.0).all()
    assert found.come_m(np.array([70.0]))[0] < found.at_m(found.arc_m, np.array([115.0]))[0]


def test_a_hole_parts_the_way_and_is_not_counted() -> None:
    found = line(driven(STRAIGHT, 10.0, hole_s=(10.0, 20.0)))
    assert found.length_m == pytest.approx(200.0, abs=3.0)
    assert found.piece[50] == 0
    assert found.piece[150] != found.piece[50]
    assert found.piece[250] > found.piece[150]


def test_a_car_that_goes_nowhere_has_no_line() -> None:
    assert drive_line([], FRAME) is None
    assert drive_line(driven(STRAIGHT, 10.0)[:2], FRAME) is None


def test_directions_follow_a_bend() -> None:
    found = line(driven(BEND, 8.0))
    assert found.along[50] == pytest.approx([1.0, 0.0], abs=0.01)
    assert found.along[-50] == pytest.approx([0.0, 1.0], abs=0.01)
