from __future__ import annotations

import itertools
import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.codec import content_bytes
from foretwin.contracts.drive import GnssFix, PlannedTrajectory, RoadUser, VehicleState
from foretwin.contracts.frames import geo_pose, local_from_geo, local_from_geo_yaw, wrap_angle
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.path import DrivenPath, read_path
from tests.telemetry.standin_drive import FRAME, STOP_AT_M, new_source, whole_drive, wished_path

COVERS = (
    "foretwin.telemetry.standin.parameters",
    "foretwin.telemetry.standin.sensors",
    "foretwin.telemetry.standin.source",
)


def xy_of(state: VehicleState) -> np.ndarray:
    return local_from_geo(FRAME, state.position.lat_deg, state.position.lon_deg)


def test_it_publishes_at_the_rates_of_a_real_car() -> None:
    source, samples = whole_drive()
    counts = Counter(channel for channel, _ in samples)
    duration_s = (samples[-1][1].stamp_ns - source.first_stamp_ns) * 1e-9
    rates = {channel: count / duration_s for channel, count in counts.items()}
    expected = {"imu": 100, "speed": 50, "steering": 50, "control": 50, "gnss": 10, "plan": 10}
    expected["status"] = 10
    assert set(rates) == set(expected) == set(source.info.sends)
    for channel, rate_hz in expected.items():
        assert rates[channel] == pytest.approx(rate_hz, rel=0.02)


def test_stamps_never_run_backwards() -> None:
    stamps = [message.stamp_ns for _, message in whole_drive().samples]
    assert all(b >= a for a, b in itertools.pairwise(stamps))


def test_it_stays_on_its_path_and_within_comfortable_limits() -> None:
    source, samples = whole_drive()
    path = DrivenPath(*wished_path(), driver=read_parameters().driver)
    near_s = 0.0
    for _, message in samples[::50]:
        truth = source.truth(message.stamp_ns)
        x, y = xy_of(truth)
        near_s = path.locate(x, y, near_s_m=near_s)
        point = path.at(near_s)
        assert math.hypot(x - point.x_m, y - point.y_m) < 0.25
        assert abs(truth.speed_mps * truth.yaw_rate_radps) < 3.0
    assert path.length_m - near_s < 4.0
    assert source.ended


def test_it_waits_at_the_stop_and_goes_on() -> None:
    source, samples = whole_drive()
    stamps = [m.stamp_ns for c, m in samples if c == "speed"]
    truths = [source.truth(stamp) for stamp in stamps]
    path = DrivenPath(*wished_path(), driver=read_parameters().driver)
    standing = []
    for truth in truths:
        x, y = xy_of(truth)
        if truth.speed_mps < 0.02 and abs(path.locate(x, y, near_s_m=STOP_AT_M) - STOP_AT_M) < 1.0:
            standing.append(truth.stamp_ns)
    dwell_s = read_parameters().driver.dwell_s
    assert (standing[-1] - standing[0]) * 1e-9 == pytest.approx(dwell_s, abs=0.5)


def test_the_same_seed_gives_the_same_bytes_however_it_is_asked() -> None:
    def first_seconds(step_ns: int, seed: int) -> list[bytes]:
        source = new_source(seed=seed)
        result: list[bytes] = []
        for until in range(0, 1_200_000_001, step_ns):
            portion = source.advance(source.first_stamp_ns + until)
            result += [content_bytes(message) for _, message in portion]
        return result

    assert first_seconds(400_000_000, 7) == first_seconds(60_000_000, 7)
    assert first_seconds(400_000_000, 7) != first_seconds(400_000_000, 8)


def test_it_says_when_its_next_sample_is_due() -> None:
    source = new_source()
    for _ in range(30):
        due_ns = source.next_stamp_ns
        assert list(source.advance(due_ns - 1)) == []
        assert {message.stamp_ns for _, message in source.advance(due_ns)} == {due_ns}


def test_gnss_is_the_antenna_with_the_stated_noise() -> None:
    source, samples = whole_drive()
    lever = read_parameters().sensors.body_from_antenna_m
    errors = []
    for channel, fix in samples:
        if channel != "gnss":
            continue
        assert isinstance(fix, GnssFix)
        truth = source.truth(fix.stamp_ns)
        yaw = float(
            local_from_geo_yaw(FRAME, truth.yaw_rad, truth.position.lat_deg, truth.position.lon_deg)
        )
        ahead = lever[0] * np.array([math.cos(yaw), math.sin(yaw)])
        seen = local_from_geo(FRAME, fix.position.lat_deg, fix.position.lon_deg)
        errors.append(seen - xy_of(truth) - ahead)
    assert np.std(errors) == pytest.approx(read_parameters().sensors.gnss_std_m, rel=0.15)
    assert np.abs(np.mean(errors, axis=0)).max() < 0.01


def test_it_does_what_it_plans() -> None:
    source, samples = whole_drive()
    plans = [message for channel, message in samples if channel == "plan"]
    end_ns = samples[-1][1].stamp_ns
    errors = []
    for plan in plans[::5]:
        assert isinstance(plan, PlannedTrajectory)
        at_2s = int(np.searchsorted(plan.time_from_stamp_s, 2.0 - 1e-9))
        stamp_ns = plan.stamp_ns + 2_000_000_000
        if stamp_ns > end_ns - 10_000_000:
            continue
        planned = local_from_geo(FRAME, plan.lat_deg[at_2s], plan.lon_deg[at_2s])
        errors.append(math.hypot(*(planned - xy_of(source.truth(stamp_ns)))))
    assert np.median(errors) < 0.4
    assert plans[0].time_from_stamp_s[-1] == pytest.approx(8.0)


def test_a_shifted_plan_lies_to_the_left_of_the_same_drive() -> None:
    def first_plan(shift_m: float) -> PlannedTrajectory:
        source = new_source(plan_shift_m=shift_m)
        samples = source.advance(source.first_stamp_ns)
        return next(message for channel, message in samples if channel == "plan")

    straight, shifted = first_plan(0.0), first_plan(1.0)
    moved = local_from_geo(FRAME, shifted.lat_deg, shifted.lon_deg) - local_from_geo(
        FRAME, straight.lat_deg, straight.lon_deg
    )
    left = np.stack([-np.sin(straight.yaw_rad), np.cos(straight.yaw_rad)], axis=1)
    assert np.einsum("ij,ij->i", moved, left) == pytest.approx(1.0, abs=1e-3)
    assert np.abs(wrap_angle(shifted.yaw_rad - straight.yaw_rad)).max() < 1e-6


def test_an_end_is_kept() -> None:
    source = new_source(end_s=0.5)
    samples = list(source.advance(source.first_stamp_ns + 10**10))
    assert source.ended
    assert samples[-1][1].stamp_ns == source.first_stamp_ns + 500_000_000


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("{}", "lat_deg"),
        ("[1, 2]", "path.json"),
        ('{"lat_deg": [1], "lon_deg": [1], "speed_mps": [1]}', "at least 2"),
        ('{"lat_deg": [1, 1], "lon_deg": [1, 1], "speed_mps": [1, 1]}', "5 m"),
        ('{"lat_deg": [1, 1.1], "lon_deg": [1, 1], "speed_mps": [1, -1]}', "negative"),
        ('{"lat_deg": [1, 1.1], "lon_deg": [1, 1], "speed_mps": [0, 0]}', "above 0"),
    ],
)
def test_a_broken_path_is_refused_in_one_line(tmp_path: Path, text: str, complaint: str) -> None:
    file = tmp_path / "path.json"
    file.write_text(text)
    with pytest.raises(ValueError, match=complaint) as refused:
        read_path(file, driver=read_parameters().driver)
    assert "path.json" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_parameter_file_with_an_unknown_name_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "car.toml"
    file.write_text("[car]\nwheels = 5\n")
    with pytest.raises(ValueError, match=r"car\.toml.*wheels"):
        read_parameters(file)


@pytest.mark.parametrize(("known_for_s", "seen"), [(math.inf, True), (1.5, True), (0.5, False)])
def test_it_forgets_whom_it_was_told_of_once_nobody_can_say_where_they_are(
    known_for_s: float, seen: bool
) -> None:
    source = new_source()
    path = DrivenPath(*wished_path(), driver=read_parameters().driver)
    at = path.at(20.0)
    place = geo_pose(path.frame, at.x_m, at.y_m, at.yaw_rad)
    car = RoadUser(
        user_id="second", kind="car", position=place.position, yaw_rad=place.yaw_rad,
        speed_mps=0.0, length_m=4.5, width_m=1.6,
    )  # fmt: skip
    source.see((car,), stamp_ns=source.first_stamp_ns, known_for_s=(known_for_s,))
    for _ in source.advance(source.first_stamp_ns + 1_000_000_000):
        pass
    assert (source.ahead is not None) == seen
