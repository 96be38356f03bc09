"""Episodes that begin with states a real car was in."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
import pytest

from foretwin.contracts.codec import encode
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import local_from_geo
from foretwin.contracts.futures import Future, PathAhead, SeenRoadUser
from foretwin.contracts.world import World
from foretwin.sim_worker.gym import JunctionEnv, JunctionVectorEnv
from foretwin.telemetry.estimator.estimator import StateEstimator
from foretwin.telemetry.logs.opening import open_log
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.sim_worker.places import box, crossroads, happening, job, state_at, straight_path

COVERS = ("foretwin.sim_worker.gym.episodes",)

KEEP = np.zeros(1, np.float32)
STATES = (state_at(-50.0, -1.5, speed=8.0), state_at(-40.0, -1.3, speed=7.0, yaw=0.02))


def feature(env: JunctionEnv, name: str, seen: np.ndarray) -> float:
    return float(seen[env.course.features.index(name)])


def test_an_episode_begins_as_the_recorded_state_was() -> None:
    env = JunctionEnv(crossroads(), states=STATES, path=straight_path(), control="along_path")

    seen, info = env.reset(seed=0, options={"case": 1})

    assert info["case"] == 1
    assert feature(env, "speed", seen) == pytest.approx(7.0 / 20.0)
    assert feature(env, "heading", seen) == pytest.approx(0.02 / np.pi, abs=1e-4)
    assert env.course.rows.stage.states[0, :2] == pytest.approx((-40.0, -1.3), abs=1e-3)
    assert feature(env, "user0_present", seen) == 0.0


def test_a_scenario_meets_the_recorded_car() -> None:
    env = JunctionEnv(
        crossroads(),
        states=STATES,
        path=straight_path(),
        scenario="scp",
        control="along_path",
        cases=4,
        early_or_late_s=0.0,
    )
    assert len(env.course.rows.playable) == 8
    for case in range(8):
        seen, _ = env.reset(options={"case": case})
        assert feature(env, "user0_present", seen) == 1.0
        terminated = False
        while not terminated:
            _, _, terminated, truncated, info = env.step(KEEP)
            assert not truncated
        assert info["collided"]


def test_a_job_is_read_from_its_file_with_all_that_was_seen(tmp_path: Path) -> None:
    parked = SeenRoadUser(
        kind="car", x_m=-20.0, y_m=-1.5, yaw_rad=0.0, speed_mps=0.0, length_m=4.5, width_m=1.8
    )
    question = msgspec.structs.replace(
        job((Future(index=0, name="nominal"), happening(1, "scp"))), road_users=(parked,)
    )
    (tmp_path / "job").write_bytes(encode(question))
    (tmp_path / "world").write_bytes(encode(crossroads()))

    env = JunctionEnv(tmp_path / "world", job=tmp_path / "job", control="along_path")

    seen, _ = env.reset(seed=1, options={"case": 0})
    # From the front bumper of a car that starts with its rear axle at -50 to the rear of 4.5 m.
    front = env.course.rows.scene.start_arc_m[0] + 0.0
    assert front == pytest.approx(10.0, abs=0.1)
    assert 20.0 < 60.0 * feature(env, "lead_gap", seen) < 28.0
    while True:
        _, _, terminated, _, info = env.step(KEEP)
        if terminated:
            break
    assert info["collided"]
    assert len(env.course.rows.playable) == 2


def test_a_building_in_the_way_ends_an_episode() -> None:
    world = crossroads(buildings=(box(0.0, -1.5, 2.0, 2.0),))
    env = JunctionEnv(world, states=STATES, path=straight_path(), control="along_path")
    env.reset(seed=0, options={"case": 0})
    terminated = False
    while not terminated:
        _, reward, terminated, _, info = env.step(KEEP)

    assert info["collided"]
    assert env.course.rows.stage.states[0, 0] < 0.0
    assert reward < -0.5


def test_faults_of_a_future_act_in_its_row_alone() -> None:
    futures = (
        Future(index=0, name="sound"),
        Future(index=1, name="weak brakes", numbers={"brake_gain": 0.3}),
    )
    envs = JunctionVectorEnv(2, crossroads(), job=job(futures), control="along_path")
    speeds = []
    for seed in range(8):
        _, infos = envs.reset(seed=seed)
        for _ in range(12):
            envs.step(np.full((2, 1), -0.5, np.float32))
        speeds += list(zip(infos["case"], envs.course.rows.stage.states[:, 3], strict=True))
    by_case = {case: {speed for c, speed in speeds if c == case} for case in (0, 1)}

    assert all(len(values) == 1 for values in by_case.values())
    assert min(by_case[1]) > max(by_case[0]) + 1.0


def test_cars_that_began_at_different_times_aim_at_the_speeds_ahead_of_their_own() -> None:
    nodes = np.array([8.0, 9.0, 7.0, 6.0])
    question = msgspec.structs.replace(
        job((Future(index=0, name="nominal"),)), speed_ahead_mps=nodes
    )
    envs = JunctionVectorEnv(
        2, crossroads(), job=question, control="along_path", autoreset_mode="Disabled"
    )
    aimed = envs.course.features.index("target_speed")

    envs.reset(seed=1)
    for _ in range(7):
        envs.step(np.zeros((2, 1), np.float32))
    told = [envs.reset(options={"reset_mask": np.array([False, True])})[0]]
    told += [envs.step(np.zeros((2, 1), np.float32))[0] for _ in range(13)]

    at_s, knots_s = 0.1 * np.arange(14), 0.5 * np.arange(4)
    first, second = 20.0 * np.stack(told)[:, :, aimed].T
    assert first == pytest.approx(np.interp(at_s + 0.7, knots_s, nodes), abs=1e-5)
    assert second == pytest.approx(np.interp(at_s, knots_s, nodes), abs=1e-5)


def test_the_case_that_is_told_begins_the_same_episode_again() -> None:
    nowhere, fast = happening(0, "roundabout_entry"), {"brake_gain": 0.5}
    futures = (nowhere, Future(index=1, name="nominal"), Future(index=2, name="weak", numbers=fast))
    env = JunctionEnv(crossroads(), job=job(futures), control="along_path")
    assert env.course.rows.playable.tolist() == [1, 2]
    told = set()
    for seed in range(8):
        speeds = []
        _, info = env.reset(seed=seed)
        for options in (None, {"case": info["case"]}):
            env.reset(seed=seed, options=options)
            for _ in range(10):
                env.step(-0.5 * np.ones(1, np.float32))
            speeds.append(env.course.rows.stage.states[0, 3])
        assert speeds[0] == speeds[1]
        told.add(info["case"])
    assert told == {0, 1}


def test_a_row_among_law_abiding_road_users_is_an_environment_alone() -> None:
    seen = tuple(
        SeenRoadUser(
            kind="car", x_m=x, y_m=y, yaw_rad=yaw, speed_mps=6.0, length_m=4.5, width_m=1.8
        )
        for x, y, yaw in ((1.5, -40.0, np.pi / 2), (-1.5, 35.0, -np.pi / 2), (-25.0, -1.5, 0.0))
    )
    late = Future(index=0, name="late", numbers={"perception_delay_s": 0.4})
    question = msgspec.structs.replace(job((late, happening(1, "scp"))), road_users=seen)
    settings: dict[str, Any] = {"job": question, "control": "along_path", "horizon_s": 3.0}
    envs = JunctionVectorEnv(3, crossroads(), autoreset_mode="SameStep", **settings)
    env = JunctionEnv(crossroads(), **settings)
    among, _ = envs.reset(seed=4)
    alone, _ = env.reset(seed=6)
    cases = set()
    for step in range(70):
        action = np.full(1, 0.1 * np.sin(step), np.float32)
        # The others drive differently, so that they begin anew at other times.
        actions = np.stack([action + 0.5, action - 0.2, action])
        among, rewards, _, _, infos = envs.step(actions)
        alone, reward, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            alone, info = env.reset()
            cases.add(info["case"])
            assert infos["case"][2] == info["case"]
        assert (reward, alone.tobytes()) == (rewards[2], among[2].tobytes())

    assert env.course.rows.scene.traffic is not None
    assert env.course.rows.scene.traffic.reacts
    assert cases


def test_what_does_not_fit_says_so() -> None:
    with pytest.raises(UserError, match="the job is for World crossroads; given is elsewhere"):
        JunctionEnv(
            msgspec.structs.replace(crossroads(), id="elsewhere"),
            job=job((Future(index=0, name="nominal"),)),
        )
    with pytest.raises(UserError, match="recorded states need the path that lay ahead"):
        JunctionEnv(crossroads(), states=STATES)
    with pytest.raises(UserError, match="none of 2 episodes can be played: they begin 3"):
        JunctionEnv(crossroads(), states=STATES, path=straight_path(y=30.0))


class Approach(NamedTuple):
    world: World
    states: tuple[VehicleState, ...]
    path: PathAhead


def berlin_approach(data_dir: Path) -> Approach:
    """States of the real drive before a junction that it passes at speed, and the way it took."""
    osm = read_map(data_dir / "osm-berlin-mitte" / "berlin-mitte.osm")
    graph = build_road_graph(osm)
    log = open_log(data_dir / "drive-berlin-gendarmenmarkt" / "Berlin_Gendarmenmarkt_GT.txt")
    estimator = StateEstimator(log.info)
    states = []
    for channel, message in log.samples():
        if message.stamp_ns - log.info.start_stamp_ns > 260e9:
            break
        state = estimator.handle(channel, message)
        if state is not None and state.yaw_valid:
            states.append(state)
    geo = np.array([(s.position.lat_deg, s.position.lon_deg) for s in states])
    xy = local_from_geo(graph.frame, geo[:, 0], geo[:, 1])
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))])
    for junction in find_intersections(osm, graph):
        at = local_from_geo(graph.frame, junction.summary.lat, junction.summary.lon)
        away = np.hypot(*(xy - at).T)
        passed = int(away.argmin())
        room = arc[passed] > 70.0 and arc[-1] > arc[passed] + 60.0
        if away[passed] > 10.0 or not room or states[passed].speed_mps < 5.0:
            continue
        world = build_world(osm, graph, junction)
        before = (arc > arc[passed] - 50.0) & (arc < arc[passed] - 30.0)
        chosen = [states[k] for k in np.flatnonzero(before) if states[k].speed_mps > 3.0]
        own = local_from_geo(world.frame, geo[:, 0], geo[:, 1])
        at_m = np.arange(arc[passed] - 65.0, arc[passed] + 50.0, 1.0)
        driven = np.column_stack([np.interp(at_m, arc, own[:, k]) for k in (0, 1)])
        if len(chosen) >= 3:
            path = PathAhead(xy_m=driven, speed_limit_mps=np.full(len(driven), 13.9))
            return Approach(world, tuple(chosen), path)
    raise AssertionError("the drive passes no junction at speed")


@pytest.mark.real_data
def test_the_real_drive_through_berlin_goes_on_from_any_of_its_states(data_dir: Path) -> None:
    world, states, path = berlin_approach(data_dir)
    count = len(states)
    envs = JunctionVectorEnv(
        count, world, states=states, path=path, control="along_path", autoreset_mode="Disabled"
    )
    envs.reset(seed=[0] * count)
    _, infos = envs.reset(options={"case": 0})
    frame_xy = local_from_geo(world.frame, states[0].position.lat_deg, states[0].position.lon_deg)
    assert envs.course.rows.stage.states[:, :2] == pytest.approx(
        np.tile(frame_xy, (count, 1)), abs=1e-6
    )
    assert envs.course.rows.stage.states[:, 3] == pytest.approx(states[0].speed_mps)
    assert infos["case"].tolist() == [0] * count

    env = JunctionEnv(world, states=states, path=path, control="along_path")
    for case in range(count):
        env.reset(options={"case": case})
        ends = False
        while not ends:
            _, _, terminated, truncated, info = env.step(KEEP)
            ends = terminated or truncated
        # Alone on the road and the way the real car took: nothing is hit.
        assert not info["collided"]
        assert info["arrived"] or truncated
