"""Positions and yaws keep their place through every conversion."""

from __future__ import annotations

import math
import threading

import numpy as np
import pyproj
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.frames import (
    METRES_PER_DEG,
    GeoPoint,
    LocalFrame,
    base_from_sensor,
    geo_from_ecef,
    geo_from_local,
    geo_from_local_yaw,
    geo_pose,
    grid_convergence,
    local_from_geo,
    local_from_geo_yaw,
    local_pose,
    target_from_source,
    target_from_source_m,
    wrap_angle,
)

FRAMES = st.builds(
    lambda lat, lon: LocalFrame(GeoPoint(lat, lon)),
    st.floats(-80.0, 80.0),
    st.floats(-179.0, 179.0),
)
NEAR_M = st.floats(-20_000.0, 20_000.0)
YAWS = st.floats(-math.pi, math.pi)
BERLIN = LocalFrame(GeoPoint(52.51, 13.39))


@given(frame=FRAMES, x_m=NEAR_M, y_m=NEAR_M)
def test_positions_come_back_within_a_micrometre(frame: LocalFrame, x_m: float, y_m: float) -> None:
    xy_m = np.array([[x_m, y_m], [y_m, x_m]])

    lat_deg, lon_deg = geo_from_local(frame, xy_m).T

    assert np.abs(local_from_geo(frame, lat_deg, lon_deg) - xy_m).max() < 1e-6


@given(frame=FRAMES, x_m=NEAR_M, y_m=NEAR_M, yaw_rad=YAWS)
def test_yaws_come_back(frame: LocalFrame, x_m: float, y_m: float, yaw_rad: float) -> None:
    xy_m = np.array([x_m, y_m])
    lat_deg, lon_deg = geo_from_local(frame, xy_m)

    true_yaw = geo_from_local_yaw(frame, yaw_rad, xy_m)
    back = local_from_geo_yaw(frame, true_yaw, lat_deg, lon_deg)

    assert abs(wrap_angle(back - yaw_rad)) < 1e-9


@given(frame=FRAMES, x_m=NEAR_M, y_m=NEAR_M)
def test_convergence_is_the_slope_of_the_parallel(
    frame: LocalFrame, x_m: float, y_m: float
) -> None:
    lat_deg, lon_deg = geo_from_local(frame, np.array([x_m, y_m]))
    step_deg = 1e-4
    west, east = local_from_geo(
        frame, np.array([lat_deg, lat_deg]), np.array([lon_deg - step_deg, lon_deg + step_deg])
    )
    true_east_rad = math.atan2(east[1] - west[1], east[0] - west[0])

    assert grid_convergence(frame, lat_deg, lon_deg) == pytest.approx(true_east_rad, abs=1e-7)


def test_convergence_agrees_with_proj_within_100_km() -> None:
    for lat_deg in (-60.0, 5.0, 52.5, 75.0):
        frame = LocalFrame(GeoPoint(lat_deg, 13.4))
        lat, lon = geo_from_local(frame, np.array([[30_000.0, 9_000.0], [100_000.0, 0.0]])).T
        projection = pyproj.Proj(proj="tmerc", lat_0=lat_deg, lon_0=13.4, ellps="WGS84")

        expected = np.radians(projection.get_factors(lon, lat).meridian_convergence)

        assert np.abs(grid_convergence(frame, lat, lon) - expected).max() < 1e-6


def test_distances_are_those_of_the_ellipsoid() -> None:
    geod = pyproj.Geod(ellps="WGS84")
    lat, lon = geo_from_local(BERLIN, np.array([[0.0, 0.0], [300.0, 400.0]])).T

    _, _, distance_m = geod.inv(lon[0], lat[0], lon[1], lat[1])

    assert distance_m == pytest.approx(500.0, abs=1e-4)


@pytest.mark.parametrize("lat_deg", [-80.0, -45.0, 0.0, 52.5, 80.0])
def test_a_degree_of_latitude_is_nearly_as_long_everywhere(lat_deg: float) -> None:
    frame = LocalFrame(GeoPoint(lat_deg - 0.5, 13.4))
    assert local_from_geo(frame, lat_deg + 0.5, 13.4) == pytest.approx(
        (0.0, METRES_PER_DEG), rel=0.006, abs=1e-6
    )


@pytest.mark.parametrize(
    ("xyz_m", "expected"),
    [
        ((6_378_137.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        ((0.0, 6_378_137.0 + 100.0, 0.0), (0.0, 90.0, 100.0)),
        ((0.0, 0.0, 6_356_752.314245), (90.0, 0.0, 0.0)),
    ],
)
def test_ecef_axes(xyz_m: tuple[float, ...], expected: tuple[float, ...]) -> None:
    assert geo_from_ecef(np.array([xyz_m]))[0] == pytest.approx(expected, abs=1e-6)


@given(lat=st.floats(-89.0, 89.0), lon=st.floats(-179.0, 179.0), alt=st.floats(-100.0, 9000.0))
def test_ecef_follows_the_closed_formula(lat: float, lon: float, alt: float) -> None:
    a, f = 6_378_137.0, 1.0 / 298.257223563
    e2 = f * (2.0 - f)
    phi, lam = math.radians(lat), math.radians(lon)
    n = a / math.sqrt(1.0 - e2 * math.sin(phi) ** 2)
    xyz = np.array(
        [
            [
                (n + alt) * math.cos(phi) * math.cos(lam),
                (n + alt) * math.cos(phi) * math.sin(lam),
                (n * (1.0 - e2) + alt) * math.sin(phi),
            ]
        ]
    )

    got_lat, got_lon, got_alt = geo_from_ecef(xyz)[0]

    assert (got_lat, got_lon) == pytest.approx((lat, lon), abs=1e-10)
    assert got_alt == pytest.approx(alt, abs=1e-4)


@given(
    source=FRAMES,
    east_m=st.floats(-2000.0, 2000.0),
    north_m=st.floats(-2000.0, 2000.0),
    x_m=st.floats(-500.0, 500.0),
    yaw_rad=YAWS,
)
def test_there_and_back_between_two_frames(
    source: LocalFrame, east_m: float, north_m: float, x_m: float, yaw_rad: float
) -> None:
    target = LocalFrame(GeoPoint(*geo_from_local(source, np.array([east_m, north_m])).tolist()))
    xy_m, yaws_rad = np.array([[x_m, -x_m], [0.0, 0.0]]), np.array([yaw_rad, 0.0])

    there = target_from_source(target, source, xy_m, yaws_rad)
    back = target_from_source(source, target, there.xy_m, there.yaw_rad)

    assert np.abs(back.xy_m - xy_m).max() < 1e-6
    assert np.abs(wrap_angle(back.yaw_rad - yaws_rad)).max() < 1e-9
    assert np.hypot(*there.xy_m[1]) == pytest.approx(math.hypot(east_m, north_m), abs=1e-3)


def test_heading_points_along_the_motion_in_every_frame() -> None:
    # A frame 20 km to the east sees the same two points 0.2° turned.
    source = LocalFrame(GeoPoint(52.51, 13.39))
    target = LocalFrame(GeoPoint(52.51, 13.69))
    start, end = np.array([10.0, 20.0]), np.array([10.3, 20.4])
    yaw = math.atan2(0.4, 0.3)

    moved = target_from_source(target, source, np.stack([start, end]), np.array([yaw, yaw]))
    along = moved.xy_m[1] - moved.xy_m[0]

    assert moved.yaw_rad[0] == pytest.approx(math.atan2(along[1], along[0]), abs=1e-6)
    assert abs(moved.yaw_rad[0] - yaw) > 1e-3


@given(x_m=NEAR_M, y_m=NEAR_M, yaw_rad=YAWS, lever=st.tuples(*[st.floats(-5.0, 5.0)] * 3))
def test_base_link_from_an_antenna(
    x_m: float, y_m: float, yaw_rad: float, lever: tuple[float, float, float]
) -> None:
    forward = np.array([math.cos(yaw_rad), math.sin(yaw_rad)])
    left = np.array([-forward[1], forward[0]])
    antenna = np.array([x_m, y_m]) + lever[0] * forward + lever[1] * left

    base = base_from_sensor(antenna[None], np.array([yaw_rad]), lever)

    assert base[0] == pytest.approx((x_m, y_m), abs=1e-9)


@given(angle_rad=st.floats(-1e4, 1e4))
def test_wrapped_angles_point_the_same_way(angle_rad: float) -> None:
    wrapped = float(wrap_angle(angle_rad))

    assert -math.pi <= wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle_rad), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle_rad), abs=1e-9)


@pytest.mark.parametrize(
    ("lat_deg", "lon_deg", "text"),
    [
        (math.nan, 0.0, "not finite"), (0.0, math.inf, "not finite"), (90.1, 0.0, "outside"),
        (-90.1, 0.0, "outside"), (0.0, 180.1, "outside"), (0.0, -180.1, "outside"),
    ],
)  # fmt: skip
def test_points_off_the_earth_are_refused(lat_deg: float, lon_deg: float, text: str) -> None:
    with pytest.raises(ValueError, match=text):
        GeoPoint(lat_deg, lon_deg).validate()
    for there in (GeoPoint(90.0, 180.0), GeoPoint(-90.0, -180.0), GeoPoint(52.0, 13.0)):
        assert there.validate() == there


@given(
    frame=FRAMES,
    lat_deg=st.floats(-90.0, 90.0) | st.floats(),
    lon_deg=st.floats(-180.0, 180.0) | st.floats(),
    yaw_rad=st.floats(-1e4, 1e4) | st.sampled_from([math.nan, math.inf]),
)
def test_one_position_gives_what_an_array_of_it_gives(
    frame: LocalFrame, lat_deg: float, lon_deg: float, yaw_rad: float
) -> None:
    lats, lons, yaws = np.array([lat_deg]), np.array([lon_deg]), np.array([yaw_rad])
    with np.errstate(invalid="ignore", over="ignore"):
        xy = local_from_geo(frame, lat_deg, lon_deg)
        assert np.array_equal(xy, local_from_geo(frame, lats, lons)[0], equal_nan=True)
        back = geo_from_local(frame, xy)
        assert np.array_equal(back, geo_from_local(frame, xy[None])[0], equal_nan=True)
        np.testing.assert_allclose(
            local_from_geo_yaw(frame, yaw_rad, lat_deg, lon_deg),
            local_from_geo_yaw(frame, yaws, lats, lons)[0],
            atol=1e-12,
        )


@pytest.mark.parametrize("shape", [(), (3,), (2, 3)])
def test_positions_of_any_shape_keep_it(shape: tuple[int, ...]) -> None:
    xy_m = np.arange(2.0 * np.prod(shape)).reshape(*shape, 2) * 100.0
    geo = geo_from_local(BERLIN, xy_m)
    back = local_from_geo(BERLIN, geo[..., 0], geo[..., 1])
    assert geo.shape == back.shape == (*shape, 2)
    assert back == pytest.approx(xy_m, abs=1e-6)
    yaw_rad = np.full(shape, 0.5)
    assert geo_from_local_yaw(BERLIN, yaw_rad, xy_m).shape == shape
    ahead = base_from_sensor(xy_m, yaw_rad, (2.0, 0.0, 1.0)) + 2.0 * np.array(
        [math.cos(0.5), math.sin(0.5)]
    )
    assert ahead == pytest.approx(xy_m)


def test_one_pose_there_and_back() -> None:
    at = geo_pose(BERLIN, 300.0, -400.0, 0.5, alt_m=35.0)
    assert at.position.alt_m == 35.0
    assert geo_pose(BERLIN, 0.0, 0.0, 0.0).position == GeoPoint(52.51, 13.39, 0.0)
    assert local_pose(BERLIN, at.position, at.yaw_rad) == pytest.approx((300.0, -400.0, 0.5))
    other = LocalFrame(GeoPoint(52.6, 13.5))
    xy_m = np.array([[300.0, -400.0], [1.0, 2.0]])
    moved = target_from_source_m(other, BERLIN, xy_m)
    assert moved == pytest.approx(target_from_source(other, BERLIN, xy_m, np.zeros(2)).xy_m)
    assert target_from_source_m(BERLIN, BERLIN, xy_m) == pytest.approx(xy_m)


def test_threads_project_side_by_side() -> None:
    expected = geo_from_local(BERLIN, np.array([[100.0, 200.0]]))
    results: list[bool] = []

    def project() -> None:
        results.extend(
            np.array_equal(geo_from_local(BERLIN, np.array([[100.0, 200.0]])), expected)
            for _ in range(200)
        )

    threads = [threading.Thread(target=project) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()

    assert results == [True] * 800
