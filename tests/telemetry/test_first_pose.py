"""A car's first settled pose on its lot: when it is settled, and where it is then."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest
from msgspec.structs import replace

from foretwin.contracts.anchor import AnchorPose
from foretwin.contracts.drive import GnssFix, HeadingSample, SpeedSample, VehicleInfo
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.first_pose import FirstPose, first_pose
from foretwin.telemetry.logs.log import Sample
from tests.telemetry.test_anchored import on, seen_from

LOT = AnchorPose(lat_deg=52.4739, lon_deg=13.395, alt_m=40.0, yaw_deg=110.0)
S = 10**9
INFO = VehicleInfo(
    vehicle_id="ego", time_base="utc", start_stamp_ns=S, source="a lot",
    reference_point="base_link", sends=("gnss", "speed"),
)  # fmt: skip
ROAD = load_vehicle(None)


def straight(
    speed_mps: float, *, std_m: float = 0.02, heading: bool = False, seconds: float = 20.0
) -> Iterator[Sample]:
    """A car along the lot's axis, ten times a second, from a standstill's place on."""
    for n in range(round(10 * seconds)):
        stamp_ns = S + n * S // 10
        yield "speed", SpeedSample(stamp_ns=stamp_ns, speed_mps=speed_mps)
        if heading:
            yield "heading", HeadingSample(stamp_ns=stamp_ns + 1, yaw_rad=LOT.yaw_rad)
        place = on(LOT, speed_mps * n / 10, 0.0)["position"]
        yield "gnss", GnssFix(stamp_ns=stamp_ns + 2, position=place, std_m=std_m)


@pytest.mark.parametrize(("scale", "speed_mps"), [(1.0, 5.0), (10.0, 0.5)])
def test_it_is_settled_where_the_car_is_after_some_metres(scale: float, speed_mps: float):
    """Of a small car on the lot after the same metres of the World, and in the lot's own size."""
    watch = FirstPose(INFO, ROAD, scale=scale)
    pose = None
    for channel, message in straight(speed_mps, std_m=0.02 / scale):
        if (pose := watch.take(channel, message)) is not None:
            break
    assert pose is not None
    assert message.stamp_ns < 6 * S  # type: ignore[attr-defined]
    along_m, left_m, yaw = seen_from(LOT, pose.frame.origin, pose.yaw_rad)
    driven_m = speed_mps * (message.stamp_ns / S - 1.0)  # type: ignore[attr-defined]
    assert scale * along_m == pytest.approx(scale * driven_m, abs=0.1)
    assert scale * left_m == pytest.approx(0.0, abs=0.1)
    assert yaw == pytest.approx(0.0, abs=0.03)
    assert pose.alt_m == pytest.approx(40.0, abs=0.01)


def test_a_standing_car_has_one_by_its_measured_heading_alone():
    watch = FirstPose(INFO, ROAD, scale=1.0)
    assert first_pose(watch, straight(0.0)) is None
    assert "heading is not known" in watch.lacks
    pose = first_pose(FirstPose(INFO, ROAD, scale=1.0), straight(0.0, heading=True))
    assert pose is not None
    assert math.remainder(pose.yaw_rad - LOT.yaw_rad, math.tau) == pytest.approx(0.0, abs=1e-3)
    assert seen_from(LOT, pose.frame.origin)[:2] == pytest.approx((0.0, 0.0), abs=0.01)


def test_it_takes_a_second_of_good_states():
    given = list(straight(0.0, heading=True, seconds=5.0))
    watch = FirstPose(INFO, ROAD, scale=1.0)
    settled_ns = next(
        message.stamp_ns  # type: ignore[attr-defined]
        for channel, message in given
        if watch.take(channel, message) is not None
    )
    assert 2 * S <= settled_ns <= 2.3 * S


def test_what_is_lacking_is_said():
    def lacks(samples: Iterator[Sample]) -> str:
        watch = FirstPose(INFO, ROAD, scale=1.0)
        assert first_pose(watch, samples) is None
        return watch.lacks

    assert lacks(iter([])) == "no position has come"
    assert lacks(iter([*straight(5.0)][:1])) == "no position has come"
    assert "position is known to" in lacks(straight(0.0, std_m=8.0, heading=True, seconds=2.0))
    assert "settled for a second" in lacks(straight(0.0, heading=True, seconds=0.8))
    assert "heading is known to" in lacks(straight(5.0, std_m=0.5, seconds=4.0))


def test_a_place_beside_the_antenna_counts_for_the_body():
    """The antenna is 1 m ahead of base_link, whose pose it is."""
    info = VehicleInfo(
        vehicle_id="ego", time_base="utc", start_stamp_ns=S, source="a lot",
        reference_point="antenna", body_from_antenna_m=(1.0, 0.0, 1.5), sends=("gnss", "heading"),
    )  # fmt: skip
    pose = first_pose(FirstPose(info, ROAD, scale=1.0), straight(0.0, heading=True))
    assert pose is not None
    assert seen_from(LOT, pose.frame.origin)[:2] == pytest.approx((-1.0, 0.0), abs=0.01)
    assert pose.alt_m == pytest.approx(LOT.alt_m - 1.5, abs=0.01)


def test_a_small_cars_positions_are_to_be_as_much_better_as_it_is_smaller():
    """0.5 m on a lot of 1:10 are 5 m in the World."""
    rough = list(straight(0.0, std_m=0.5, heading=True, seconds=3.0))
    assert first_pose(FirstPose(INFO, ROAD, scale=1.0), rough) is not None
    watch = FirstPose(INFO, ROAD, scale=10.0)
    assert first_pose(watch, rough) is None
    assert "position is known to" in watch.lacks


def test_after_overdue_positions_it_takes_a_second_again():
    info = replace(INFO, sends=("gnss", "heading", "speed"))
    gap = [
        (channel, message)
        for channel, message in straight(0.0, heading=True, seconds=20.0)
        if channel != "gnss" or not 1.7 * S < message.stamp_ns < 12.0 * S  # type: ignore[attr-defined]
    ]
    watch = FirstPose(info, ROAD, scale=1.0)
    settled_ns = next(
        message.stamp_ns  # type: ignore[attr-defined]
        for channel, message in gap
        if watch.take(channel, message) is not None
    )
    assert settled_ns >= 13.0 * S
