"""Courses of other road users from logs: drawn ones, and those of Mcity's junction."""

from __future__ import annotations

import json
import math
from pathlib import Path

import msgspec
import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import RoadUser, RoadUsers, VehicleInfo
from foretwin.contracts.frames import (
    GeoPoint,
    LocalFrame,
    geo_from_local,
    local_from_geo,
    wrap_angle,
)
from foretwin.telemetry.logs import LogError, open_road_users
from foretwin.telemetry.logs.road_users import RoadUserTrack, detections_of
from foretwin.telemetry.logs.write_mcap import create

COVERS = (
    "foretwin.telemetry.logs.road_users",
    "foretwin.telemetry.logs.mcity",
)

HERE = LocalFrame(GeoPoint(42.300947, -83.698649))
START_S = 1_688_680_000.0


def _object(name: str, x: float, y: float, **said: object) -> dict[str, object]:
    lat, lon = geo_from_local(HERE, np.array([x, y]))
    return {"id": name, "lat": float(lat), "lon": float(lon), "classType": "2", **said}


def _written(folder: Path, instants: list[tuple[float, list[dict[str, object]]]]) -> Path:
    path = folder / "seen.json"
    path.write_text(
        json.dumps([{"timestamp": START_S + after, "objs": objs} for after, objs in instants])
    )
    return path


def _xy(track: RoadUserTrack) -> Array:
    return np.asarray(local_from_geo(HERE, track.lat_deg, track.lon_deg))


def _seconds(track: RoadUserTrack) -> Array:
    return np.asarray(track.stamps_ns * 1e-9 - START_S)


def test_positions_alone_give_heading_and_speed(tmp_path: Path) -> None:
    instants = [
        (k / 10.0, [_object("a", -0.6 * k, 0.8 * k), _object("still", 5.0, 5.0)]) for k in range(30)
    ]
    moves, stands = open_road_users(_written(tmp_path, instants)).tracks
    assert (moves.user_id, moves.kind, moves.size_m) == ("a", "car", None)
    assert _seconds(moves) == pytest.approx(np.arange(30) / 10.0, abs=1e-6)
    assert moves.speed_mps == pytest.approx(np.full(30, 10.0), rel=1e-4)
    assert moves.yaw_rad == pytest.approx(np.full(30, math.atan2(0.8, -0.6)), abs=1e-4)
    assert stands.speed_mps == pytest.approx(np.zeros(30), abs=1e-3)
    assert moves.gone_after.tolist() == [False] * 29 + [True]


def test_what_is_recorded_counts_and_a_box_is_turned_the_way_it_moves(tmp_path: Path) -> None:
    said = {"speed": "36.0", "length": "5.0", "width": "2.0"}
    instants = [
        # Its box points back, and once forward.
        (k / 10.0, [_object("a", -k, 0.0, rotation=str(math.pi if k == 7 else 0.02), **said)])
        for k in range(20)
    ]
    (track,) = open_road_users(_written(tmp_path, instants)).tracks
    assert track.speed_mps == pytest.approx(np.full(20, 10.0))
    assert track.size_m == (5.0, 2.0)
    expected = np.where(np.arange(20) == 7, math.pi, math.pi + 0.02)
    assert wrap_angle(track.yaw_rad - expected) == pytest.approx(np.zeros(20), abs=1e-6)


def test_who_is_not_seen_for_long_or_jumps_is_away(tmp_path: Path) -> None:
    times = [0.0, 0.1, 0.2, 1.1, 2.2, 2.3, 2.4, 2.5, 2.6]
    # Away from 1.1 to 2.2, then 20 m aside, one sample elsewhere, and back.
    aside = [0.0, 0.0, 0.0, 0.0, 20.0, 20.0, 90.0, 20.0, 20.0]
    instants = [(t, [_object("a", 5.0 * t, y)]) for t, y in zip(times, aside, strict=True)]
    log = open_road_users(_written(tmp_path, list(reversed(instants))))
    (track,) = log.tracks
    assert log.skipped["seen once"] == 1
    assert _seconds(track) == pytest.approx([*times[:6], *times[7:]], abs=1e-6)
    assert np.flatnonzero(track.gone_after).tolist() == [3, 5, 7]
    assert track.speed_mps == pytest.approx(np.full(8, 5.0), rel=1e-3)
    patient = open_road_users(tmp_path / "seen.json", longest_gap_s=2.0)
    assert np.flatnonzero(patient.tracks[0].gone_after).tolist() == [5, 7]


def test_noise_between_samples_of_almost_one_time_is_no_jump(tmp_path: Path) -> None:
    instants = [(k / 10.0, [_object("a", float(k), 0.0)]) for k in range(10)]
    instants.append((0.5001, [_object("a", 5.0, 0.4)]))
    (track,) = open_road_users(_written(tmp_path, instants)).tracks
    assert np.flatnonzero(track.gone_after).tolist() == [10]
    assert track.speed_mps == pytest.approx(np.full(11, 10.0), abs=1.0)


def test_what_was_virtual_was_not_there() -> None:
    real = RoadUser(
        user_id="u", kind="car", position=GeoPoint(52.5, 13.4), yaw_rad=0.0, speed_mps=9.0,
        length_m=4.5, width_m=1.8,
    )  # fmt: skip
    virtual = msgspec.structs.replace(real, user_id="v", virtual=True)
    stamp_ns, said = detections_of(RoadUsers(stamp_ns=7, users=(virtual, real)))
    assert (stamp_ns, [one.user_id for one in said]) == (7, ["u"])


def test_what_a_car_detected_is_in_its_recording(tmp_path: Path) -> None:
    info = VehicleInfo(vehicle_id="car", time_base="utc", start_stamp_ns=0, sends=("objects",))
    with create(tmp_path / "drive.mcap", info=info) as writer:
        for k in range(10):
            lat, lon = geo_from_local(HERE, np.array([1.0, -k]))
            user = RoadUser(
                user_id="u",
                kind="bus",
                position=GeoPoint(float(lat), float(lon)),
                yaw_rad=-1.5,
                speed_mps=9.0,
                length_m=12.0,
                width_m=2.5,
            )
            message = RoadUsers(stamp_ns=k * 100_000_000, users=(user,) if k != 5 else ())
            writer.add("objects", message)
    log = open_road_users(tmp_path / "drive.mcap")
    (track,) = log.tracks
    assert (track.kind, track.size_m, len(track.stamps_ns)) == ("bus", (12.0, 2.5), 9)
    assert track.yaw_rad == pytest.approx(np.full(9, -1.5))
    assert len(log.stamps_ns) == 10


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[{"timestamp": 1.0, "objs": [{"id": 1}]}]', "missing required field `lat`"),
        ('[{"timestamp": -5, "objs": []}]', r"\[0\]\.timestamp -5\.0: no UTC seconds"),
        ('[{"timestamp": 1.0}]', "missing required field `objs`"),
        ('[{"timestamp": 1.0, "objs": []}', "expected a list of timestamp and objs"),
        ('[{"timestamp": 1.0, "objs": []}]', "no road users in it"),
    ],
)
def test_what_is_no_such_log_is_said(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "bad.json"
    path.write_text(text)
    with pytest.raises(LogError, match=said) as error:
        open_road_users(path)
    assert str(path) in str(error.value)


@pytest.mark.real_data
@pytest.mark.parametrize("trial", ["3", "13"])
def test_speeds_of_mcity_are_those_of_the_positions(data_dir: Path, trial: str) -> None:
    log = open_road_users(data_dir / f"traffic-mcity-rtk/dets/detection_{trial}.json")
    cars = [t for t in log.tracks if t.kind == "car" and len(t.stamps_ns) > 100]
    assert cars
    for track in cars:
        assert track.size_m == pytest.approx((5.0, 2.3), abs=0.3)
        gone_m = np.hypot(*np.diff(_xy(track), axis=0).T).sum()
        said_m = np.trapezoid(track.speed_mps, track.stamps_ns * 1e-9)
        assert said_m == pytest.approx(gone_m, rel=0.04)


@pytest.mark.real_data
def test_detected_cars_are_where_their_satellite_receivers_say(data_dir: Path) -> None:
    folder = data_dir / "traffic-mcity-rtk"
    (driven,) = open_road_users(folder / "gts/gps_data_3.json").tracks
    seen = max(
        open_road_users(folder / "dets/detection_3.json").tracks,
        key=lambda t: len(t.stamps_ns) if t.kind == "car" else 0,
    )
    at = np.searchsorted(driven.stamps_ns, seen.stamps_ns)
    away_m = np.hypot(*(_xy(driven)[at] - _xy(seen)).T)
    assert np.median(away_m) < 1.5
    moving = driven.speed_mps[at] > 2.0
    turned = np.abs(wrap_angle(driven.yaw_rad[at] - seen.yaw_rad))[moving]
    assert np.degrees(np.median(turned)) < 3.0
    assert np.median(np.abs(driven.speed_mps[at] - seen.speed_mps)) < 0.5
    assert driven.speed_mps.max() < 10.0


@pytest.mark.real_data
def test_jumps_of_a_satellite_position_are_no_motion(data_dir: Path) -> None:
    log = open_road_users(data_dir / "traffic-mcity-rtk/gts/gps_data_14_c.json")
    assert {track.user_id for track in log.tracks} == {"0", "1", "0-cut", "1-cut"}
    # One of them is 18 m elsewhere from one 20 ms to the next.
    assert sum(int(track.gone_after.sum()) for track in log.tracks) > 4
    assert max(float(track.speed_mps.max()) for track in log.tracks) < 15.0
