"""What a radar lists: how far, where, how fast nearing; who hides whom, how often who is found."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
import shapely
import shapely.affinity
from hypothesis import example, given
from hypothesis import strategies as st

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalPose
from foretwin.contracts.point_cloud import Mount
from foretwin.sim_worker.sensors.base_motion import BaseMotion, moved, sensor_motion
from foretwin.sim_worker.sensors.kinds import Radar
from foretwin.sim_worker.sensors.materials import RCS_DBSM, rcs_m2_of
from foretwin.sim_worker.sensors.moving_boxes import NO_BODIES, MovingBoxes
from foretwin.sim_worker.sensors.radar import RadarReturns, detect, found_share
from foretwin.sim_worker.sensors.ray_world import RayWorld
from foretwin.sim_worker.sensors.sensor_file import SensorFile, load_sensor
from tests.sim_worker.places import box, crossroads
from tests.sim_worker.sensors.test_lidar import HERE, bodies

COVERS = ("foretwin.sim_worker.sensors.base_motion", "foretwin.sim_worker.sensors.materials")
NOWHERE = RayWorld()


def exact(*, mount: Mount | None = None, **changes: object) -> SensorFile:
    """A radar in the bumper without noise that finds whatever is in view within 150 m."""
    radar = Radar(
        rate_hz=20.0, field_of_view_deg=120.0, max_range_m=150.0, min_range_m=0.0, seen_to_m=2000.0,
        seen_share=0.999, range_std_m=0.0, azimuth_std_deg=0.0, elevation_std_deg=0.0,
        range_rate_std_mps=0.0,
    )  # fmt: skip
    mount = Mount(forward_m=0.0, up_m=0.5) if mount is None else mount
    return SensorFile(
        name="exact", source="drawn", mount=mount, radar=msgspec.structs.replace(radar, **changes)
    )


def listed(
    who: MovingBoxes, motion: BaseMotion = HERE, sensor: SensorFile | None = None, seed: int = 0
) -> RadarReturns:
    return detect(NOWHERE, exact() if sensor is None else sensor, motion, who, seed=seed)


def test_a_car_ahead_is_as_far_as_its_rear_and_nears_as_fast_as_both_drive() -> None:
    ahead = bodies((30.0, 0.0, 0.0, 4.0, 1.8, 1.5, 8.0))
    found = listed(ahead, BaseMotion(LocalPose(0.0, 0.0, 0.0), speed_mps=20.0))

    assert found.returns == pytest.approx(np.array([[28.0, 0.0, 0.0, -12.0, 10.0]]), abs=1e-5)
    assert (found.body.tolist(), found.ghost.tolist()) == ([0], [False])


@example(x=11.5, aside=11.5, speed=0.0, own=0.0)
@given(
    x=st.floats(8.0, 60.0), aside=st.floats(2.5, 12.0), speed=st.floats(-25.0, 25.0),
    own=st.floats(0.0, 20.0),
)  # fmt: skip
def test_a_car_that_drives_by(x: float, aside: float, speed: float, own: float) -> None:
    """Its nearest point is the near corner ahead: range, bearing and rate are those of that."""
    who = bodies((x + 2.0, aside + 0.9, 0.0, 4.0, 1.8, 1.5, speed))
    ((range_m, azimuth, _, rate_mps, _),) = listed(
        who, BaseMotion(LocalPose(0.0, 0.0, 0.0), speed_mps=own), exact(field_of_view_deg=179.0)
    ).returns.tolist()

    assert range_m == pytest.approx(math.hypot(x, aside), abs=2e-3)
    assert azimuth == pytest.approx(math.atan2(aside, x), abs=1e-3)
    assert rate_mps == pytest.approx((speed - own) * math.cos(azimuth), abs=5e-3)


def test_range_rates_are_what_ranges_do_also_where_the_car_turns() -> None:
    """The sensor sits aside and ahead, the car turns, the other drives across."""
    sensor = exact(mount=Mount(forward_m=3.0, left_m=0.8, up_m=0.5, yaw_deg=20.0))
    begin = BaseMotion(LocalPose(5.0, -3.0, 0.4), speed_mps=12.0, yaw_rate_radps=0.5)
    other = (35.0, 18.0, -2.0, 0.05, 0.05, 1.5, 9.0)

    def at(time_s: float) -> RadarReturns:
        x, y, yaw, *size, speed = other
        there = x + speed * time_s * math.cos(yaw), y + speed * time_s * math.sin(yaw)
        return listed(bodies((*there, yaw, *size, speed)), moved(begin, time_s), sensor)

    before, now, after = (at(one).returns[0].astype(float) for one in (-0.02, 0.0, 0.02))
    assert now[3] == pytest.approx((after[0] - before[0]) / 0.04, abs=0.02)
    assert abs(now[3]) > 5.0


def test_angles_are_those_of_the_mount() -> None:
    left = bodies((0.0, 30.0, 0.0, 1.0, 1.0, 4.0, 0.0))
    turned = exact(mount=Mount(forward_m=0.0, up_m=1.0, yaw_deg=80.0, pitch_deg=-5.0))
    found = listed(left, sensor=turned).returns[0]

    axes = sensor_motion(HERE, Mount(yaw_deg=80.0, pitch_deg=-5.0)).world_from_sensor
    x, y, z = axes.T @ np.array([0.0, 1.0, 0.0])
    assert found[:3] == pytest.approx(
        [29.5, math.atan2(y, x), math.atan2(z, math.hypot(x, y))], abs=2e-3
    )
    assert found[1] > 0.1
    assert found[2] < 0.0


def test_what_is_beside_the_view_too_near_or_too_far_is_not_listed() -> None:
    def count(x: float, y: float, **changes: object) -> int:
        small = bodies((x, y, 0.0, 0.5, 0.5, 1.5, 0.0))
        return len(listed(small, sensor=exact(**changes)).returns)

    assert [count(10.0, y, field_of_view_deg=90.0) for y in (9.0, -9.0, 11.0, -11.0)] == [
        1,
        1,
        0,
        0,
    ]
    assert [count(x, 0.0) for x in (-10.0, 149.0, 151.0)] == [0, 1, 0]
    assert [count(x, 0.0, min_range_m=5.0) for x in (5.0, 5.5)] == [0, 1]
    high = exact(mount=Mount(forward_m=0.0, up_m=9.0), elevation_of_view_deg=20.0)
    assert [
        len(listed(bodies((x, 0.0, 0.0, 1.0, 1.0, 1.5, 0.0)), sensor=high).returns)
        for x in (30.0, 60.0)
    ] == [0, 1]
    inside = bodies((0.5, 0.0, 0.0, 4.0, 2.0, 1.5, 0.0))
    assert len(listed(inside).returns) == 0
    assert listed(NO_BODIES).returns.shape == (0, 5)


def test_in_drawn_scenes_houses_and_others_hide_what_they_hide_in_a_plan() -> None:
    random = np.random.default_rng(11)
    origin, kinds = shapely.Point(0.0, 0.0), {"free": 0, "hidden": 0, "in part": 0}
    for case in range(40):
        house = box(*random.uniform([8.0, -20.0, 1.0, 1.0], [40.0, 20.0, 5.0, 5.0]).tolist())
        rays = RayWorld(crossroads(buildings=(house,)))
        count = int(random.integers(2, 10))
        bearing, away = random.uniform(-0.95, 0.95, count), random.uniform(6.0, 70.0, count)
        drawn = bodies(
            *np.column_stack(
                [
                    away * np.cos(bearing), away * np.sin(bearing), random.uniform(-3, 3, count),
                    random.uniform(0.4, 9.0, count), random.uniform(0.4, 2.5, count),
                    random.uniform(1.0, 4.0, count), np.zeros(count),
                ]
            )
        )  # fmt: skip
        found = detect(rays, exact(field_of_view_deg=360.0), HERE, drawn)
        plans = [plan_of(drawn, k) for k in range(count)]
        if any(one.distance(origin) < 1.0 for one in plans):
            continue
        for k, plan in enumerate(plans):
            others = shapely.unary_union(
                [shapely.Polygon(house.outline), *plans[:k], *plans[k + 1 :]]
            )
            between = shapely.convex_hull(shapely.union(origin, plan))
            seen = found.returns[found.body == k]
            if not others.intersects(between):
                kinds["free"] += 1
                assert len(seen) == 1, case
                assert seen[0, 0] == pytest.approx(plan.distance(origin), abs=5e-3), case
                continue
            share = visible_share(plan, others)
            if share == 0.0:
                kinds["hidden"] += 1
                assert len(seen) == 0, case
            elif share > 0.15:
                kinds["in part"] += 1
                assert len(seen) == 1, case
                assert seen[0, 0] >= plan.distance(origin) - 5e-3
                amplitude_db = 10.0 * math.log10(10.0 * share)
                assert seen[0, 4] == pytest.approx(amplitude_db, abs=3.0), case
    assert min(kinds.values()) > 20, kinds


def plan_of(who: MovingBoxes, k: int) -> shapely.Polygon:
    turn = shapely.affinity.rotate(
        shapely.box(*-who.size_m[k, :2] / 2.0, *who.size_m[k, :2] / 2.0), who.yaw_rad[k],
        origin=(0.0, 0.0), use_radians=True,
    )  # fmt: skip
    return shapely.affinity.translate(turn, *who.xy_m[k])


def visible_share(plan: shapely.Polygon, others: shapely.Geometry) -> float:
    """Of 301 lines from the origin over all of a plan, how many meet it before the others."""
    corners = np.array(plan.exterior.coords)
    bearing = np.arctan2(corners[:, 1], corners[:, 0])
    free = 0
    for one in np.linspace(bearing.min(), bearing.max(), 303)[1:-1]:
        line = shapely.LineString([(0.0, 0.0), (200.0 * math.cos(one), 200.0 * math.sin(one))])
        origin = shapely.Point(0.0, 0.0)
        free += line.intersection(plan).distance(origin) < _or_far(line.intersection(others))
    return free / 301


def _or_far(met: shapely.Geometry) -> float:
    return math.inf if met.is_empty else float(met.distance(shapely.Point(0.0, 0.0)))


def test_how_often_a_body_is_found_is_what_the_file_says_and_falls_as_the_formula() -> None:
    radar = load_sensor("long_range_radar").measures(Radar)
    ten_m2 = np.full(3, 10.0)
    near, there, far = found_share(radar, np.array([100.0, 250.0, 400.0]), ten_m2)

    assert there == pytest.approx(0.9)
    assert near > 0.99
    # Swerling 1: ln F / ln P = 1 + S, S at 250 m is 130, and falls by (400 / 250)^4 = 6.55.
    signal = math.log(1e-6) / math.log(0.9) - 1.0
    assert far == pytest.approx(1e-6 ** (1.0 / (1.0 + signal / 1.6**4)), rel=1e-9)
    # A body of 1 m2 is found as often as one of 10 m2 that is 10^(1/4) as far away.
    small = found_share(radar, np.array([250.0 * 0.1**0.25]), np.array([1.0]))
    assert small == pytest.approx([0.9])
    assert found_share(radar, np.array([10.0]), np.array([0.0])).tolist() == [0.0]


def test_people_are_lost_before_cars_are() -> None:
    order = sorted(RCS_DBSM, key=RCS_DBSM.__getitem__)
    assert order[:3] == ["pedestrian", "bicycle", "motorcycle"]
    assert rcs_m2_of("car") == pytest.approx(10.0)
    share = []
    for kind in ("pedestrian", "car"):
        who = bodies((120.0, 0.0, 0.0, 0.5, 0.5, 1.5, 0.0))
        who = who._replace(rcs_m2=np.array([rcs_m2_of(kind)]))
        lists = [listed(who, sensor=load_sensor("long_range_radar"), seed=k) for k in range(400)]
        share.append(np.mean([len(one.returns) for one in lists]))
    wanted = found_share(
        load_sensor("long_range_radar").measures(Radar), np.array([116.15] * 2),
        np.array([rcs_m2_of("pedestrian"), 10.0]),
    )  # fmt: skip
    assert share == pytest.approx(wanted, abs=0.05)
    assert share[0] < share[1] - 0.05


def test_noise_is_as_large_as_the_file_says_and_the_same_for_the_same_seed() -> None:
    noisy = exact(
        range_std_m=0.4, azimuth_std_deg=1.0, elevation_std_deg=0.5, range_rate_std_mps=0.2
    )
    ahead = bodies((50.0, 0.0, 0.0, 4.0, 1.8, 1.5, 0.0))
    lists = np.array([listed(ahead, sensor=noisy, seed=k).returns[0] for k in range(1000)])

    assert lists[:, :4].std(axis=0) == pytest.approx(
        [0.4, math.radians(1.0), math.radians(0.5), 0.2], rel=0.1
    )
    assert lists[:, :4].mean(axis=0) == pytest.approx([48.0, 0.0, 0.0, 0.0], abs=0.05)
    again = listed(ahead, sensor=noisy, seed=7).returns
    assert np.array_equal(again[0], lists[7])
    flat = exact(elevation_std_deg=None, mount=Mount(forward_m=0.0, up_m=3.0))
    assert listed(ahead, sensor=flat).returns[0, 2] == 0.0


def test_ghosts_come_at_twice_the_range_and_rate() -> None:
    ahead = bodies((30.0, 0.0, 0.0, 4.0, 1.8, 1.5, -5.0))
    found = listed(ahead, sensor=exact(ghosts=1.0))

    assert found.returns[1] - found.returns[0] == pytest.approx([28.0, 0.0, 0.0, -5.0, -20.0])
    assert (found.body.tolist(), found.ghost.tolist()) == ([0, 0], [False, True])
    far = bodies((90.0, 0.0, 0.0, 4.0, 1.8, 1.5, -5.0))
    assert len(listed(far, sensor=exact(ghosts=1.0)).returns) == 1
    share = [len(listed(ahead, sensor=exact(ghosts=0.3), seed=k).returns) for k in range(300)]
    assert np.mean(share) == pytest.approx(1.3, abs=0.08)


def test_clutter_stands_anywhere_in_view_and_none_is_the_default() -> None:
    sensor = exact(clutter=5.0)
    drives = BaseMotion(LocalPose(0.0, 0.0, 0.3), speed_mps=10.0)
    lists = [listed(NO_BODIES, drives, sensor, seed=k) for k in range(400)]
    all_of_them = np.concatenate([one.returns for one in lists])

    assert len(all_of_them) / len(lists) == pytest.approx(5.0, abs=0.4)
    assert all((one.body == -1).all() and not one.ghost.any() for one in lists)
    assert all_of_them[:, 3] == pytest.approx(-10.0 * np.cos(all_of_them[:, 1]), abs=1e-4)
    assert np.abs(all_of_them[:, 1]).max() == pytest.approx(math.radians(60.0), abs=0.02)
    # Evenly over the ground: half of them beyond the range within which half of it lies.
    assert _share(all_of_them[:, 0] > 150.0 / math.sqrt(2.0)) == pytest.approx(0.5, abs=0.05)
    assert listed(NO_BODIES).returns.shape == (0, 5)


def _share(flags: Array) -> float:
    return float(np.mean(flags))
