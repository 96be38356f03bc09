"""Strategies for messages of a drive, and one drive that holds every channel."""

from __future__ import annotations

import math

import msgspec
import numpy as np
from hypothesis import strategies as st

from foretwin.contracts import drive
from foretwin.contracts.frames import GeoPoint

START_NS = 1_772_359_200_000_000_123
INFO = drive.VehicleInfo(
    vehicle_id="car",
    time_base="utc",
    start_stamp_ns=START_NS,
    end_stamp_ns=START_NS + 10**9,
    source="a test",
    reference_point="antenna",
    body_from_antenna_m=(1.25, 0.0, 1.5),
    sends=("gnss", "imu"),
)

stamps = st.integers(0, 2_000_000_000 * 10**9)
numbers = st.floats(-1e6, 1e6)
angles = st.floats(-3.1415, 3.1415)
vectors = st.tuples(numbers, numbers, numbers)
# Around one place, as a drive is: a plan is held in a local frame.
positions = st.builds(
    GeoPoint, st.floats(52.4, 52.6), st.floats(13.2, 13.6), st.floats(-100.0, 5000.0)
)


@st.composite
def plans(draw: st.DrawFn) -> drive.PlannedTrajectory:
    """Plans of 1 to 5 points."""
    size = draw(st.integers(1, 5))

    def array(values: st.SearchStrategy[float]) -> np.ndarray:
        return np.array(draw(st.lists(values, min_size=size, max_size=size)))

    return drive.PlannedTrajectory(
        stamp_ns=draw(stamps),
        time_from_stamp_s=array(st.floats(0.0, 20.0)),
        lat_deg=array(st.floats(52.4, 52.6)),
        lon_deg=array(st.floats(13.2, 13.6)),
        yaw_rad=array(angles),
        speed_mps=array(st.floats(-10.0, 70.0)),
    )


users = st.builds(
    drive.RoadUser,
    user_id=st.text(max_size=5),
    kind=st.sampled_from(["car", "bicycle"]),
    position=positions,
    yaw_rad=angles,
    speed_mps=numbers,
    length_m=numbers,
    width_m=numbers,
    virtual=st.booleans(),
)
samples: st.SearchStrategy[tuple[str, msgspec.Struct]] = st.one_of(
    st.tuples(
        st.just("gnss"),
        st.builds(
            drive.GnssFix,
            stamp_ns=stamps,
            position=positions,
            std_m=st.none() | st.floats(1e-3, 100.0),
        ),
    ),
    st.tuples(
        st.just("imu"),
        st.builds(drive.ImuSample, stamp_ns=stamps, accel_mps2=vectors, rate_radps=vectors),
    ),
    st.tuples(st.just("speed"), st.builds(drive.SpeedSample, stamp_ns=stamps, speed_mps=numbers)),
    st.tuples(
        st.just("heading"),
        st.builds(
            drive.HeadingSample,
            stamp_ns=stamps,
            yaw_rad=angles,
            yaw_rate_radps=st.none() | numbers,
        ),
    ),
    st.tuples(
        st.just("steering"),
        st.builds(
            drive.SteeringSample,
            stamp_ns=stamps,
            steering_wheel_rad=st.none() | numbers,
            tire_angle_rad=st.none() | numbers,
        ),
    ),
    st.tuples(
        st.just("control"),
        st.builds(
            drive.ControlCommand,
            stamp_ns=stamps,
            accel_mps2=numbers,
            steering_wheel_rad=st.none() | numbers,
            tire_angle_rad=st.none() | numbers,
            estimated=st.booleans(),
        ),
    ),
    st.tuples(st.just("plan"), plans()),
    st.tuples(
        st.just("status"),
        st.builds(
            drive.VehicleStatus,
            stamp_ns=stamps,
            control_mode=st.sampled_from(["manual", "autonomous"]),
            gear=st.sampled_from(["drive", "reverse"]),
            indicator=st.sampled_from(["off", "left"]),
        ),
    ),
    st.tuples(
        st.just("objects"),
        st.builds(drive.RoadUsers, stamp_ns=stamps, users=st.lists(users, max_size=2).map(tuple)),
    ),
    st.tuples(
        st.just("signals"),
        st.builds(
            drive.SignalState,
            stamp_ns=stamps,
            group_id=st.text(max_size=5),
            colour=st.sampled_from(["red", "green"]),
        ),
    ),
)


def state(stamp_ns: int) -> drive.VehicleState:
    """A state in Berlin."""
    return drive.VehicleState(
        vehicle_id="car",
        stamp_ns=stamp_ns,
        position=GeoPoint(52.5121, 13.3925, 75.0),
        yaw_rad=0.5,
        speed_mps=8.25,
        yaw_rate_radps=0.1,
        accel_mps2=-0.3,
        tire_angle_rad=0.05,
        position_std_m=0.2,
        estimated=("yaw_rad",),
    )


def every_channel() -> list[tuple[str, msgspec.Struct]]:
    """Return one message of each channel that a recording holds, in stamp order."""
    at = START_NS
    user = drive.RoadUser(
        user_id="u1",
        kind="car",
        position=GeoPoint(52.512, 13.392),
        yaw_rad=1.0,
        speed_mps=5.0,
        length_m=4.5,
        width_m=1.8,
    )
    plan = drive.PlannedTrajectory(
        stamp_ns=at + 6,
        time_from_stamp_s=np.arange(0.0, 8.0, 0.1),
        lat_deg=np.linspace(52.512, 52.5125, 80),
        lon_deg=np.linspace(13.392, 13.3927, 80),
        yaw_rad=np.full(80, math.pi / 4),
        speed_mps=np.full(80, 8.3),
    )
    return [
        ("gnss", drive.GnssFix(stamp_ns=at, position=GeoPoint(52.512, 13.392, 75.0), std_m=0.02)),
        (
            "imu",
            drive.ImuSample(
                stamp_ns=at + 1, accel_mps2=(0.1, 0.2, 9.8), rate_radps=(0.0, 0.0, 0.1)
            ),
        ),
        ("speed", drive.SpeedSample(stamp_ns=at + 2, speed_mps=8.3)),
        ("heading", drive.HeadingSample(stamp_ns=at + 3, yaw_rad=0.5)),
        (
            "steering",
            drive.SteeringSample(stamp_ns=at + 4, steering_wheel_rad=0.8, tire_angle_rad=0.05),
        ),
        ("control", drive.ControlCommand(stamp_ns=at + 5, accel_mps2=0.5, steering_wheel_rad=0.8)),
        ("plan", plan),
        ("status", drive.VehicleStatus(stamp_ns=at + 7, control_mode="autonomous", gear="drive")),
        ("objects", drive.RoadUsers(stamp_ns=at + 8, users=(user,))),
        ("signals", drive.SignalState(stamp_ns=at + 9, group_id="g1", colour="red")),
        ("state", state(at + 10)),
        ("end", drive.DriveEnd(stamp_ns=at + 11, published={"gnss": 1})),
    ]
