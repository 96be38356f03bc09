"""An anchor is rigid but for its scale, goes back where it came from, and mirrors on request."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.anchor import Anchor, AnchorLine, AnchorPose
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local, local_pose

LOT = AnchorPose(lat_deg=48.19, lon_deg=16.37, alt_m=170.0, yaw_deg=25.0)
WORLD = AnchorPose(lat_deg=52.51, lon_deg=13.39, alt_m=35.0, yaw_deg=-140.0)

anchors = st.builds(
    Anchor,
    lot=st.just(LOT),
    world=st.just(WORLD),
    scale=st.sampled_from([0.1, 1.0, 10.0, 14.0]),
    mirrored=st.booleans(),
)
metres = st.floats(-150.0, 150.0)
angles = st.floats(-math.pi, math.pi)


def on_lot(x_m: float, y_m: float) -> GeoPoint:
    lat, lon = geo_from_local(LOT.frame, np.array([x_m, y_m])).tolist()
    return GeoPoint(lat, lon, 170.5)


def test_the_anchor_point_is_the_same_point_and_direction_in_both():
    anchor = Anchor(lot=LOT, world=WORLD)
    position, yaw_rad = anchor.world_from_lot(LOT.frame.origin, LOT.yaw_rad)
    assert (position.lat_deg, position.lon_deg) == pytest.approx((52.51, 13.39), abs=1e-9)
    assert position.alt_m == pytest.approx(35.0)
    assert yaw_rad == pytest.approx(math.radians(-140.0))


@given(anchor=anchors, x_m=metres, y_m=metres, yaw_rad=angles)
def test_there_and_back_is_the_same_place(anchor: Anchor, x_m, y_m, yaw_rad):
    place = on_lot(x_m, y_m)
    back, yaw = anchor.lot_from_world(*anchor.world_from_lot(place, yaw_rad))
    here = local_pose(LOT.frame, back, yaw)
    assert (here.x_m, here.y_m) == pytest.approx((x_m, y_m), abs=1e-4)
    assert math.cos(here.yaw_rad - local_pose(LOT.frame, place, yaw_rad).yaw_rad) == pytest.approx(
        1.0, abs=1e-9
    )
    assert back.alt_m == pytest.approx(170.5)


@given(anchor=anchors, ax_m=metres, ay_m=metres, bx_m=metres, by_m=metres)
def test_distances_go_with_the_scale(anchor: Anchor, ax_m, ay_m, bx_m, by_m):
    frame = LocalFrame(WORLD.frame.origin)
    places = [
        local_pose(frame, *anchor.world_from_lot(on_lot(*at), 0.0))
        for at in ((ax_m, ay_m), (bx_m, by_m))
    ]
    apart_m = math.dist(places[0][:2], places[1][:2])
    assert apart_m == pytest.approx(
        anchor.scale * math.hypot(ax_m - bx_m, ay_m - by_m), rel=1e-6, abs=1e-5
    )


@pytest.mark.parametrize(("mirrored", "left_m"), [(False, 3.0), (True, -3.0)])
def test_left_stays_left_unless_it_is_mirrored(mirrored, left_m):
    anchor = Anchor(lot=LOT, world=WORLD, mirrored=mirrored)
    cos, sin = math.cos(LOT.yaw_rad), math.sin(LOT.yaw_rad)
    aside = on_lot(-3.0 * sin, 3.0 * cos)
    position, yaw_rad = anchor.world_from_lot(aside, LOT.yaw_rad + 0.2)
    x_m, y_m, yaw = local_pose(WORLD.frame, position, yaw_rad)
    cos, sin = math.cos(WORLD.yaw_rad), math.sin(WORLD.yaw_rad)
    assert cos * y_m - sin * x_m == pytest.approx(left_m, abs=1e-4)
    assert math.sin(yaw - WORLD.yaw_rad) == pytest.approx(
        math.copysign(math.sin(0.2), left_m), abs=1e-6
    )


@pytest.mark.parametrize("scale", [0.0, -1.0, 0.0099, 100.1, 1000.0, math.nan])
def test_a_scale_of_no_vehicle_is_refused(scale):
    with pytest.raises(ValueError, match="scale"):
        Anchor(lot=LOT, world=WORLD, scale=scale).validate()
    for whole in (0.01, 1.0, 100.0):
        Anchor(lot=LOT, world=WORLD, scale=whole).validate()


@given(anchor=anchors, places=st.lists(st.tuples(metres, metres, angles), min_size=1, max_size=4))
def test_a_line_goes_where_each_of_its_points_goes(anchor: Anchor, places):
    points = [on_lot(x_m, y_m) for x_m, y_m, _ in places]
    line = AnchorLine(
        np.array([one.lat_deg for one in points]),
        np.array([one.lon_deg for one in points]),
        np.array([yaw_rad for *_, yaw_rad in places]),
    )
    there = anchor.world_from_lot_line(line)
    for number, (point, yaw_rad) in enumerate(zip(points, line.yaw_rad.tolist(), strict=True)):
        position, yaw = anchor.world_from_lot(point, yaw_rad)
        assert there.lat_deg[number] == pytest.approx(position.lat_deg, abs=1e-9)
        assert there.lon_deg[number] == pytest.approx(position.lon_deg, abs=1e-9)
        assert math.cos(there.yaw_rad[number] - yaw) == pytest.approx(1.0, abs=1e-9)
    back = anchor.lot_from_world_line(there)
    assert back.lat_deg == pytest.approx(line.lat_deg, abs=1e-9)
    assert np.cos(back.yaw_rad - line.yaw_rad) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(
    ("lat_deg", "lon_deg"),
    [(90.0, 0.0), (-90.0, 0.0), (0.0, 180.5), (0.0, -180.5), (math.nan, 0.0)],
)
def test_a_point_that_is_none_of_the_earth_is_refused(lat_deg, lon_deg):
    with pytest.raises(ValueError, match="lat_deg, lon_deg"):
        AnchorPose(lat_deg=lat_deg, lon_deg=lon_deg, yaw_deg=0.0).validate()


def test_the_edges_of_the_map_are_points():
    for lon_deg in (-180.0, 180.0):
        AnchorPose(lat_deg=89.9, lon_deg=lon_deg, yaw_deg=0.0).validate()


@given(anchor=anchors, x_m=metres, y_m=metres, yaw_rad=angles)
def test_turned_round_it_leads_back(anchor: Anchor, x_m: float, y_m: float, yaw_rad: float) -> None:
    there = anchor.world_from_lot(on_lot(x_m, y_m), yaw_rad)
    back = anchor.turned_round.world_from_lot(there.position, there.yaw_rad)
    expected = anchor.lot_from_world(there.position, there.yaw_rad)
    assert (back.position.lat_deg, back.position.lon_deg, back.yaw_rad) == pytest.approx(
        (expected.position.lat_deg, expected.position.lon_deg, expected.yaw_rad), abs=1e-9
    )
    assert anchor.turned_round.scale * anchor.scale == pytest.approx(1.0)
