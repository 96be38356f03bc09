from __future__ import annotations

import numpy as np
import pytest

from contracts.simulation import ActorSpec
from sim_worker.actors.conflicts import CrossingPaths
from sim_worker.actors.motion import ActorMotion, actor_motion
from sim_worker.actors.perception import see_road_users
from sim_worker.planners.path import FrenetPath
from tests.sim_worker.places import crossroads, straight_path

PATH = FrenetPath(straight_path().xy_m)
TIME_S = np.arange(0.0, 8.01, 0.05)


def _move(*actors: ActorSpec | None, paths: CrossingPaths) -> ActorMotion:
    return actor_motion(
        actors, crossing_paths=paths, ego_path=PATH, ego_arc_m=10.0, ego_speed_mps=8.0,
        lead_offset_m=np.full(len(actors), 0.3), centre_ahead_m=1.4, half_lengths_m=4.5,
        time_s=TIME_S,
    )  # fmt: skip


def test_the_crossroads_offer_crossing_paths_and_an_oncoming_stand_in() -> None:
    found = CrossingPaths(crossroads()).conflicts(PATH, from_arc_m=10.0)
    assert len(found["crossing"]) == 2
    assert not any(conflict.invented for conflict in found["crossing"])
    # Straight oncoming traffic keeps to its own lane and never meets a straight ego path.
    assert [conflict.invented for conflict in found["oncoming"]] == [True]
    for conflict in (*found["crossing"], *found["oncoming"]):
        theirs = conflict.path.point_at(np.array([conflict.actor_arc_m]))
        ours = PATH.point_at(np.array([conflict.ego_arc_m]))
        assert theirs == pytest.approx(ours, abs=0.2)


def test_a_world_without_connections_gets_a_straight_crossing_at_its_centre() -> None:
    motion = _move(
        ActorSpec(kind="crossing", speed_mps=6.0),
        paths=CrossingPaths(crossroads(connections=False)),
    )
    assert motion.invented
    closest = np.abs(motion.poses[0, :, 0]).min()
    assert closest == pytest.approx(0.0, abs=0.01)


def test_a_crossing_actor_is_there_when_it_should_be() -> None:
    late = ActorSpec(kind="crossing", speed_mps=6.0, time_offset_s=1.0)
    paths = CrossingPaths(crossroads())
    conflict = paths.conflicts(PATH, from_arc_m=10.0)["crossing"][0]
    place = PATH.point_at(np.array([conflict.ego_arc_m]))[0]
    motion = _move(late, paths=paths)
    distance = np.hypot(*(motion.poses[0, :, :2] - place).T)
    ego_there_s = (conflict.ego_arc_m - 11.4) / 8.0
    assert TIME_S[distance.argmin()] == pytest.approx(ego_there_s + 1.0, abs=0.06)
    steps = np.hypot(*np.diff(motion.poses[0, :, :2], axis=0).T)
    assert steps == pytest.approx(np.full(len(steps), 0.3), abs=0.02)


def test_a_lead_drives_ahead_on_the_egos_own_line() -> None:
    lead = ActorSpec(kind="lead", speed_mps=4.0, gap_m=12.0)
    motion = _move(None, lead, paths=CrossingPaths(None))
    assert np.isnan(motion.poses[0]).all()
    assert motion.poses[1, 0] == pytest.approx([-60 + 10 + 1.4 + 4.5 + 12.0, -1.2, 0.0], abs=1e-6)
    assert motion.poses[1, -1, 0] - motion.poses[1, 0, 0] == pytest.approx(32.0)


def test_a_driver_sees_bumper_offset_and_speed_along_the_path() -> None:
    poses = np.full((3, 1, 3), np.nan)
    poses[0, 0] = (0.0, -1.5, 0.0)
    poses[1, 0] = (0.0, 4.5, -np.pi / 2)
    seen = see_road_users(PATH, poses, np.array([5.0, 5.0, 0.0]))
    assert seen.rear_arc_m[0].tolist() == pytest.approx([60 - 2.25, 60 - 0.9, np.inf])
    assert seen.offset_m[0, :2] == pytest.approx([0.0, 6.0])
    assert seen.speed_mps[0, :2] == pytest.approx([5.0, 0.0], abs=1e-9)
