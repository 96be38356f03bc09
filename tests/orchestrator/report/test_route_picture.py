"""Numbers of junctions that lie side by side stay readable on the map of a long drive."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local
from foretwin.orchestrator.report.drawing import UNITS_PER_M
from foretwin.orchestrator.report.driven_track import CarTrack
from foretwin.orchestrator.report.passages import JunctionPassed
from foretwin.orchestrator.report.route_picture import apart, route_svg

places = st.lists(st.tuples(st.floats(0.0, 500.0), st.floats(0.0, 500.0)), max_size=12)
LONG_M = 10_000.0


def geo(*xy_m: tuple[float, float]) -> Array:
    return np.asarray(geo_from_local(LocalFrame(GeoPoint(50.0, 8.0)), np.array(xy_m)))


def picture(*junctions_at_m: float) -> str:
    """Return the picture of a long way due east, past junctions at these metres of it."""
    way = CarTrack(
        stamp_ns=np.arange(2, dtype=np.int64),
        lat_lon_deg=geo((0.0, 0.0), (LONG_M, 0.0)),
        speed_mps=np.full(2, 10.0),
        time_s=np.array([0.0, 1000.0]),
    )
    passed = [
        JunctionPassed(number, {"lat": lat, "lon": lon}, (), (), (), None, 0, 0)
        for number, (lat, lon) in enumerate(geo(*((at_m, 0.0) for at_m in junctions_at_m)).tolist())
    ]
    drawn = route_svg(way, [], passed)
    assert drawn is not None
    return drawn


def marks(drawn: str) -> list[tuple[int, int, int]]:
    """Return where the marks of junctions are, and their radius."""
    found = re.findall(r'<circle cx="(\d+)" cy="(\d+)" r="(\d+)" fill="#8a929c"', drawn)
    return [(int(x), int(y), int(radius)) for x, y, radius in found]


def test_a_long_way_has_a_twentieth_of_its_length_around_it() -> None:
    (wide,) = re.findall(r'viewBox="0 0 (\d+) ', picture(5000.0))
    assert int(wide) == pytest.approx(1.1 * LONG_M * UNITS_PER_M, rel=0.01)


def test_marks_that_moved_have_a_line_to_their_junctions_and_others_have_none() -> None:
    drawn = picture(2000.0, 5000.0, 5010.0)
    alone, one, other = marks(drawn)
    assert np.hypot(one[0] - other[0], one[1] - other[1]) >= 1.99 * one[2], "side by side"
    starts = re.findall(r'<path d="M(\d+) [^"]*" fill="none" stroke="#8a929c"', drawn)
    west = alone[0] - 2000.0 * UNITS_PER_M
    assert [(int(x) - west) / UNITS_PER_M for x in starts] == pytest.approx([5000, 5010], abs=20)


@given(places)
def test_no_two_marks_cover_each_other(found: list[tuple[float, float]]) -> None:
    shown = apart(np.array(found, dtype=float).reshape(-1, 2), 10.0)

    between = shown[:, None] - shown[None]
    far_m = np.hypot(between[..., 0], between[..., 1]) + 1e6 * np.eye(len(shown))
    assert far_m.min(initial=1e6) > 9.5


def test_marks_that_have_room_stay_where_they_are_and_a_pair_parts_evenly() -> None:
    lone = np.array([[0.0, 0.0], [30.0, 0.0]])
    assert (apart(lone, 10.0) == lone).all()
    assert np.allclose(apart(np.array([[0.0, 0.0], [4.0, 0.0]]), 10.0), [[-3.0, 0.0], [7.0, 0.0]])
