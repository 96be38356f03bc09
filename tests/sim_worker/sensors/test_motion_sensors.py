"""What receivers and inertial sensors measure: places and motions of the mount, and errors."""

from __future__ import annotations

import math

import numpy as np
import pytest
from msgspec.structs import replace

from foretwin.contracts.arrays import Array
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import local_from_geo
from foretwin.contracts.point_cloud import Mount
from foretwin.contracts.sensed_motion import SensedFix, SensedImu
from foretwin.contracts.sensor_drift import Drift
from foretwin.sim_worker.sensors.kinds import Gnss, Imu
from foretwin.sim_worker.sensors.motion_sensors import GRAVITY_MPS2, MotionSensor
from foretwin.sim_worker.sensors.sensor_file import SensorFile, load_sensor
from foretwin.sim_worker.sensors.virtual_sensors import VirtualSensors
from tests.sim_worker.places import FRAME, state_at

COVERS = ("foretwin.contracts.sensed_motion",)
MS = 1_000_000


def gnss(mount: Mount | None = None, **changes: object) -> SensorFile:
    exact = replace(Gnss(rate_hz=10.0, std_m=0.0), **changes)
    return SensorFile(name="g", source="drawn", mount=mount or Mount(), gnss=exact)


def imu(mount: Mount | None = None, **changes: object) -> SensorFile:
    exact = replace(Imu(rate_hz=50.0, gyro_std_radps=0.0, accel_std_mps2=0.0), **changes)
    return SensorFile(name="i", source="drawn", mount=mount or Mount(), imu=exact)


def place(fix: SensedFix | SensedImu) -> Array:
    assert isinstance(fix, SensedFix)
    return local_from_geo(FRAME, fix.position.lat_deg, fix.position.lon_deg)


def inertial(sensor: SensorFile, **state: float) -> SensedImu:
    found = MotionSensor(sensor).sample(replace(state_at(0.0, 0.0), **state))
    assert isinstance(found, SensedImu)
    return found


def test_a_receiver_says_where_its_antenna_is() -> None:
    sensor = MotionSensor(gnss(Mount(forward_m=2.0, left_m=0.5, up_m=1.5)))
    state = state_at(10.0, 5.0, speed=8.0, stamp_ns=100 * MS)
    now, later = sensor.sample(state), sensor.sample(state, at_ns=350 * MS)

    assert place(now) == pytest.approx([12.0, 5.5], abs=1e-6)
    assert place(later) == pytest.approx([14.0, 5.5], abs=1e-6)
    assert isinstance(now, SensedFix)
    assert now.position.alt_m == pytest.approx(state.position.alt_m + 1.5)
    assert (now.stamp_ns, later.stamp_ns, now.sensor) == (100 * MS, 350 * MS, "g")


def test_a_receivers_error_is_white_and_wanders() -> None:
    """Over many receivers: variances add; over a short time the drift is the same."""
    wandering = gnss(std_m=0.3, up_std_m=0.7, drift=Drift(std=1.2, time_s=100.0))
    state = state_at(0.0, 0.0, speed=0.0)
    antenna = np.array([1.4, 0.0])
    first, second, heights = [], [], []
    for seed in range(800):
        one = MotionSensor(wandering, seed=seed)
        fixes = [one.sample(replace(state, stamp_ns=k * 100 * MS)) for k in range(2)]
        first.append(place(fixes[0]) - antenna)
        second.append(place(fixes[1]) - antenna)
        heights.append(fixes[0].position.alt_m if isinstance(fixes[0], SensedFix) else math.nan)
    begin, after = np.array(first), np.array(second)

    assert begin.std() == pytest.approx(math.hypot(0.3, 1.2), rel=0.06)
    assert (after - begin).std() == pytest.approx(0.3 * math.sqrt(2.0), rel=0.08)
    assert np.std(heights) == pytest.approx(0.7, rel=0.08)


def test_a_receiver_tells_how_large_its_whole_error_is() -> None:
    """What is spread over many of them, white, wandering and walking, as each of them says."""
    drift = Drift(std=1.2, time_s=100.0, walk_per_sqrt_s=0.4)
    errs = gnss(std_m=0.3, up_std_m=0.7, drift=drift)
    state, antenna = state_at(0.0, 0.0, speed=0.0), np.array([1.4, 0.0])
    for stamp_ns in (0, 9 * 10**9):
        off = []
        for seed in range(800):
            one = MotionSensor(errs, seed=seed)
            one.sample(replace(state, stamp_ns=0))
            fix = one.sample(replace(state, stamp_ns=stamp_ns))
            off.append(place(fix) - antenna)
        assert isinstance(fix, SensedFix)
        assert fix.std_m == pytest.approx(np.std(off), rel=0.06)
        assert fix.up_std_m == 0.7


def test_an_imu_feels_gravity_speeding_up_and_bends_where_it_sits() -> None:
    """In a bend of yaw rate w at v: v w across at the rear axle, w² r towards it beside."""
    still = inertial(imu(), speed_mps=0.0)
    bend = inertial(imu(Mount(forward_m=2.0, left_m=0.5)), speed_mps=10.0, yaw_rate_radps=0.3,
                    accel_mps2=1.5)  # fmt: skip

    assert still.accel_mps2 == pytest.approx((0.0, 0.0, GRAVITY_MPS2))
    assert still.rate_radps == (0.0, 0.0, 0.0)
    assert bend.accel_mps2 == pytest.approx((1.5 - 0.09 * 2.0, 3.0 - 0.09 * 0.5, GRAVITY_MPS2))
    assert bend.rate_radps == pytest.approx((0.0, 0.0, 0.3))


def test_an_imu_measures_in_its_own_axes() -> None:
    """Turned to the left by 90 degrees: what is ahead of the car is to its right."""
    left = Mount(forward_m=0.0, yaw_deg=90.0)
    found = inertial(imu(left), speed_mps=0.0, accel_mps2=2.0)
    assert found.accel_mps2 == pytest.approx((0.0, -2.0, GRAVITY_MPS2), abs=1e-12)
    nose_down = inertial(imu(Mount(forward_m=0.0, pitch_deg=30.0)), yaw_rate_radps=1.0,
                         speed_mps=0.0)  # fmt: skip
    assert nose_down.rate_radps == pytest.approx((-0.5, 0.0, math.sqrt(0.75)))


def test_an_imus_errors_are_as_large_as_the_file_says() -> None:
    sensor = imu(
        gyro_std_radps=0.02, accel_std_mps2=0.5, gyro_bias_radps=(0.1, 0.2, 0.3),
        accel_bias_mps2=(1.0, 2.0, 3.0), gyro_drift=Drift(walk_per_sqrt_s=0.01),
    )  # fmt: skip
    state, one = state_at(0.0, 0.0, speed=0.0), MotionSensor(sensor, seed=3)
    samples = [one.sample(replace(state, stamp_ns=k)) for k in range(2000)]
    accel, rate = (
        np.array([getattr(sample, name) for sample in samples])
        for name in ("accel_mps2", "rate_radps")
    )
    assert accel.mean(axis=0) == pytest.approx([1.0, 2.0, 3.0 + GRAVITY_MPS2], abs=0.05)
    assert rate.mean(axis=0) == pytest.approx([0.1, 0.2, 0.3], abs=0.002)
    assert rate.std(axis=0) == pytest.approx([0.02] * 3, rel=0.06)
    assert accel.std(axis=0) == pytest.approx([0.5] * 3, rel=0.06)
    walked = [MotionSensor(sensor, seed=k).sample(replace(state, stamp_ns=0)) for k in range(3)]
    assert len({one.accel_mps2 for one in walked if isinstance(one, SensedImu)}) == 3


def test_in_a_drive_all_samples_are_told_however_late_who_asks() -> None:
    sensors = VirtualSensors([(imu(), "world"), (gnss(), "world")], seed=5)
    for stamp_ms in range(0, 401, 20):
        sensors.take_state(state_at(0.0, 0.0, speed=0.0, stamp_ns=stamp_ms * MS))
    told = sensors.measured()
    inertial_ms, fixes_ms = (
        [one.stamp_ns // MS for one in told if isinstance(one, kind)]
        for kind in (SensedImu, SensedFix)
    )

    assert inertial_ms == list(range(0, 381, 20))
    assert fixes_ms == [0, 100, 200, 300]
    assert not sensors.passed_over.total()
    assert sensors.told == {"i": 20, "g": 4}


def test_the_same_seed_gives_the_same_errors_and_others_others() -> None:
    state = state_at(0.0, 0.0, speed=0.0)

    def error(seed: int) -> SensedFix | SensedImu:
        return MotionSensor(gnss(std_m=1.0, drift=Drift(std=1.0)), seed=seed).sample(state)

    assert error(1) == error(1) != error(2)


def test_other_kinds_are_refused_and_the_bundled_ones_are_of_theirs() -> None:
    with pytest.raises(UserError, match="vlp_16: of kind lidar, and imu is needed"):
        MotionSensor(load_sensor("vlp_16"))
    receiver = load_sensor("gnss_standard").measures(Gnss)
    # 1.5 m CEP is 1.177 standard deviations of an axis.
    whole = math.hypot(receiver.std_m, receiver.drift.std)
    assert 1.1774 * whole == pytest.approx(1.5, abs=0.01)
    small = load_sensor("imu_mems").measures(Imu)
    # Noise densities at 25 Hz of bandwidth; 10 degrees an hour.
    assert small.gyro_std_radps == pytest.approx(math.radians(0.01) * 5.0, rel=0.01)
    assert small.accel_std_mps2 == pytest.approx(150e-6 * GRAVITY_MPS2 * 5.0, rel=0.01)
    assert small.gyro_drift.std == pytest.approx(math.radians(10.0) / 3600.0, rel=0.02)
