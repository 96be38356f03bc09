"""Sweeps among those who were around a recorded car: a drawn drive, and Mcity's junction."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from foretwin.contracts.drive import RoadUser, RoadUsers
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local, local_from_geo
from foretwin.orchestrator.commands.sweep import run_sweep
from foretwin.orchestrator.sweep.folder import fingerprint_of
from foretwin.orchestrator.sweep.plan import SweepPlan
from foretwin.orchestrator.sweep.recorded import Recorded
from foretwin.orchestrator.sweep.road_users import others_at
from foretwin.orchestrator.sweep.spec import Loaded, SweepSpec, check_spec
from foretwin.sim_worker.futures.future_rows import Row
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m
from foretwin.telemetry.logs import open_road_users
from tests.orchestrator.recorded_runs import write_run
from tests.orchestrator.sweeps import alone, places_of, rows_of
from tests.sim_worker.scenarios.worlds import cross
from tests.world_gen.drawn_maps import crossing, world_of

SPEED_MPS, START_X_M = 8.0, -70.0
START_NS = 1_688_680_000_000_000_000
CAR = load_vehicle()
FRONT_M = box_centre_from_base_m(CAR) + CAR.length_m.value / 2.0
STANDS_X_M, APPEARS_S = 0.0, 3.0


def _user(name: str, x: float, y: float, yaw: float, speed: float) -> RoadUser:
    lat, lon = geo_from_local(cross().frame, np.array([x, y]))
    return RoadUser(
        user_id=name, kind="car", position=GeoPoint(float(lat), float(lon)), yaw_rad=yaw,
        speed_mps=speed, length_m=4.0, width_m=1.8,
    )  # fmt: skip


def _detected(tenth: int) -> RoadUsers:
    """One drives far aside and away; from 3 s on one stands on the car's way."""
    users = [_user("far", -60.0 + tenth, 30.0, 0.0, 10.0)]
    if tenth >= 10 * APPEARS_S:
        users.append(_user("9", STANDS_X_M, -1.5, 0.0, 0.0))
    return RoadUsers(stamp_ns=START_NS + tenth * 100_000_000, users=tuple(users))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive to the east over a drawn crossing, past which nobody could have driven like that."""
    tenths = np.arange(180)
    xy = np.column_stack([START_X_M + SPEED_MPS * tenths / 10.0, np.full(180, -1.5)])
    return write_run(
        tmp_path_factory.mktemp("run"), cross(), rounds_s=range(1, 18), speed_mps=SPEED_MPS,
        stamps_ns=(START_NS + tenths * 100_000_000).tolist(),
        lat_lon_deg=geo_from_local(cross().frame, xy),
        objects=[_detected(tenth) for tenth in range(180)],
    )  # fmt: skip


def _spec(run: Path, *, every_s: float = 3.0, horizon_s: float = 8.0, **said: Any) -> SweepSpec:
    return SweepSpec(
        recorded=Recorded(run=str(run), every_s=every_s, **said), scenarios=("as_recorded",),
        planners=("constant_speed",), metrics=("ttc",), horizon_s=horizon_s,
    )  # fmt: skip


def _rows(loaded: Loaded, *, backwards: bool = False) -> list[Row]:
    runner = alone(loaded)
    (world,) = {start.world_id for start in loaded.starts}
    places = places_of(runner, loaded, world)
    rows = rows_of(runner, SweepPlan(loaded, [places]), loaded, step=-1 if backwards else 1)
    assert not any(row["failure"] for row in rows)
    return sorted(rows, key=lambda row: row["stamp_ns"])


def test_others_are_where_they_were(run: Path) -> None:
    loaded = check_spec(_spec(run))
    assert loaded.road_users is not None
    first = loaded.starts[0]
    others = others_at(
        loaded.road_users, "replayed", first.state, cross().frame, horizon_s=4.0,
        way_xy_m=first.path(cross().frame).xy_m,
    )  # fmt: skip
    far, stands = others.replayed
    assert [user.user_id for user in others.replayed] == ["far", "9"]
    # The first round is at 1 s, and its state up to 0.1 s before.
    began_s = (first.state.stamp_ns - START_NS) * 1e-9
    assert far.time_s[0] == pytest.approx(0.0, abs=0.1)
    assert far.time_s[-1] == pytest.approx(4.0, abs=0.1)
    assert far.poses[:, 0] == pytest.approx(-60.0 + 10.0 * (began_s + far.time_s), abs=1e-5)
    assert far.poses[:, 1] == pytest.approx(np.full(len(far.time_s), 30.0), abs=1e-5)
    assert far.poses[:, 2] == pytest.approx(np.zeros(len(far.time_s)), abs=1e-4)
    assert far.size_m == (4.0, 1.8)
    assert stands.time_s[0] == pytest.approx(APPEARS_S - began_s)


def test_who_comes_later_is_met_as_recorded_but_not_foreseen(run: Path) -> None:
    replayed = _rows(check_spec(_spec(run)))
    predicted = _rows(check_spec(_spec(run, road_users="predicted")))
    alone = _rows(check_spec(_spec(run, road_users="none")))
    assert [row["place"] for row in replayed[:3]] == ["round 1", "round 4", "round 7"]
    for rows, recorded, seen in (
        (replayed, [2, 2, 2], [0, 0, 0]), (predicted, [0, 0, 0], [1, 2, 2]),
        (alone, [0, 0, 0], [0, 0, 0]),
    ):  # fmt: skip
        assert [row["replayed_road_users"] for row in rows[:3]] == recorded
        assert [row["seen_road_users"] for row in rows[:3]] == seen
    # From 1 s, nobody is seen yet who stands there from 3 s on.
    assert [row["collided"] for row in replayed[:3]] == [True, True, True]
    assert [row["collided"] for row in predicted[:3]] == [False, True, True]
    assert not any(row["collided"] for row in alone)
    assert {row["accident_with"] for row in replayed[:3]} == {"recorded 9"}
    assert {row["accident_with"] for row in predicted[1:3]} == {"seen 9"}
    for row, after_s in zip(replayed[:3], (1.0, 4.0, 7.0), strict=True):
        gap_m = STANDS_X_M - 2.0 - FRONT_M - (START_X_M + SPEED_MPS * after_s)
        assert row["collision_time_s"] == pytest.approx(gap_m / SPEED_MPS, abs=0.15)


def test_rows_do_not_depend_on_who_plays_them_in_which_order(run: Path, tmp_path: Path) -> None:
    spec = _spec(run, every_s=6.0, horizon_s=2.0)
    loaded = check_spec(spec)
    assert _rows(loaded) == _rows(check_spec(spec), backwards=True)
    # And a sweep goes on where it stopped.
    runner = alone(loaded)
    whole = run_sweep(loaded, tmp_path / "out", runner)
    (tmp_path / "out" / "rows" / "job-000001.parquet").unlink()
    again = run_sweep(loaded, tmp_path / "out", runner)
    assert again["jobs_played"] == 1
    assert again["rows_sha256"] == whole["rows_sha256"]
    others = check_spec(_spec(run, every_s=6.0, horizon_s=2.0, leave_out=("9",)))
    assert fingerprint_of(others, "") != fingerprint_of(loaded, "")


def _log(folder: Path, *users: tuple[str, float], after_s: float = 0.0) -> Path:
    """Road users in a log of somebody else, each going along beside the car as far as said."""
    instants = []
    for tenth in range(100):
        objs = []
        for name, aside_m in users:
            x = START_X_M + box_centre_from_base_m(CAR) + SPEED_MPS * tenth / 10.0
            lat, lon = geo_from_local(cross().frame, np.array([x, -1.5 + aside_m]))
            objs.append({"id": name, "lat": float(lat), "lon": float(lon), "classType": "2"})
        instants.append({"timestamp": START_NS * 1e-9 + after_s + tenth / 10.0, "objs": objs})
    path = folder / "roadside.json"
    path.write_text(json.dumps(instants))
    return path


def test_a_log_of_others_replaces_what_the_car_saw(run: Path, tmp_path: Path) -> None:
    path = _log(tmp_path, ("the car", 0.0), ("beside", 4.0))
    log = str(path)
    with pytest.raises(UserError, match=r'leave_out = \["the car"\] leaves'):
        check_spec(_spec(run, road_user_log=log))
    loaded = check_spec(_spec(run, every_s=9.0, road_user_log=log, leave_out=("the car",)))
    assert loaded.road_users is not None
    assert [track.user_id for track in loaded.road_users.tracks] == ["beside"]
    rows = _rows(loaded)
    assert not any(row["collided"] for row in rows)
    assert rows[0]["min_clearance_m"] == pytest.approx(4.0 - 0.9 - CAR.width_m.value / 2.0, abs=0.1)
    with pytest.raises(UserError, match=r"leave_out 'x': no such road user .* there are the car"):
        check_spec(_spec(run, road_user_log=log, leave_out=("x",)))
    late = _log(tmp_path, ("beside", 4.0), after_s=1000.0)
    with pytest.raises(
        UserError, match=r"from 1688681000\.0 to 1688681009\.9 s, .* they need one clock"
    ):
        check_spec(_spec(run, road_user_log=str(late)))


def test_as_recorded_needs_a_recording() -> None:
    with pytest.raises(UserError, match="as_recorded needs `recorded`"):
        check_spec(SweepSpec(map="town.osm", scenarios=("as_recorded",)))


@pytest.mark.real_data
def test_mcitys_car_among_those_the_roadside_saw(data_dir: Path, tmp_path: Path) -> None:
    folder = data_dir / "traffic-mcity-rtk"
    (driven,) = open_road_users(folder / "gts/gps_data_3.json").tracks
    # No map of the place is there: a drawn crossing stands for it, and the way is the driven one.
    world = world_of(crossing(origin=GeoPoint(42.300932, -83.698634)))
    run = write_run(
        tmp_path, world, rounds_s=range(8, 20), speed_mps=8.0,
        stamps_ns=driven.stamps_ns[::5].tolist(),
        lat_lon_deg=np.column_stack([driven.lat_deg, driven.lon_deg])[::5],
    )  # fmt: skip
    log = str(folder / "dets/detection_3.json")
    with pytest.raises(UserError, match='leave_out = \\["638755443"\\] leaves'):
        check_spec(_spec(run, road_user_log=log))
    loaded = check_spec(_spec(run, every_s=5.0, road_user_log=log, leave_out=("638755443",)))
    rows = _rows(loaded)
    assert len(rows) == len(loaded.starts) > 1
    assert all(row["valid"] for row in rows)
    assert max(row["replayed_road_users"] for row in rows) > 3
    assert loaded.road_users is not None
    first = loaded.starts[0]
    others = others_at(
        loaded.road_users, "replayed", first.state, world.frame, horizon_s=8.0,
        way_xy_m=first.path(world.frame).xy_m,
    )  # fmt: skip
    # At its samples everybody is where the file says.
    track = next(t for t in loaded.road_users.tracks if t.user_id == "713935263")
    user = next(u for u in others.replayed if u.user_id == "713935263")
    at = np.searchsorted(track.stamps_ns, first.state.stamp_ns + np.round(user.time_s * 1e9))
    expected = local_from_geo(LocalFrame(world.frame.origin), track.lat_deg[at], track.lon_deg[at])
    assert np.abs(user.poses[:, :2] - expected).max() < 1e-9
