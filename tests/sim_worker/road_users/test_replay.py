"""Recorded road users are where they were recorded, at their samples and between them."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.futures import RecordedRoadUser
from foretwin.geometry.frenet_path import FrenetPath, FrenetPoint
from foretwin.sim_worker.road_users.cast import Player, casting
from foretwin.sim_worker.road_users.path_table import PathTable
from foretwin.sim_worker.road_users.perception import PerceptionFaults, Sight
from foretwin.sim_worker.road_users.replay import Replay
from foretwin.sim_worker.road_users.right_of_way import JunctionRules
from foretwin.sim_worker.road_users.traffic import Traffic
from foretwin.sim_worker.vehicle.parameters import load_vehicle

SPEED_MPS, HEADING_RAD = 7.3, 0.4
SAMPLES_S = np.array([0.5, 0.613, 0.9, 1.05, 3.05, 3.2, 4.0])
GONE_AFTER = np.array([False, False, False, True, False, False, False])
"""Away from 1.05 s to 3.05 s."""
TICK_S = 0.05
EGO_PATH = FrenetPath(np.array([[-50.0, 0.0], [150.0, 0.0]]))


def _line(time_s: Array) -> Array:
    """Poses (N, 3) along a straight line at constant speed."""
    along = SPEED_MPS * time_s
    return np.column_stack([
        20.0 + along * math.cos(HEADING_RAD), 1.0 + along * math.sin(HEADING_RAD),
        np.full(len(time_s), HEADING_RAD),
    ])  # fmt: skip


def _on_line(time_s: Array = SAMPLES_S, gone_after: Array = GONE_AFTER) -> RecordedRoadUser:
    return RecordedRoadUser(
        user_id="7", kind="bicycle", time_s=time_s, poses=_line(time_s),
        speed_mps=np.full(len(time_s), SPEED_MPS), gone_after=gone_after,
    )  # fmt: skip


def _traffic(*users: RecordedRoadUser, futures: int = 2) -> Traffic:
    beside = Player("parked", "van", EGO_PATH, 60.0, 0.0, conduct="parked", lateral_m=-5.0)
    cast = casting([[beside]] + [[]] * (futures - 1), ego_path=EGO_PATH, replayed=users)
    assert cast.replay is not None
    table = PathTable(cast.paths, cast.replay.tracks)
    taken = [()] * (len(cast.paths) + len(users))
    return Traffic(cast.crowd, table, JunctionRules(None).between(taken), cast.paces, cast.replay)


def _there(time_s: float) -> bool:
    return 0.5 - 1e-9 <= time_s <= 1.05 + 1e-9 or 3.05 - 1e-9 <= time_s <= 4.0 + 1e-9


def test_at_control_ticks_it_is_on_its_line_or_away() -> None:
    traffic = _traffic(_on_line())
    seen = 0
    for tick in range(100):
        now_s = tick * TICK_S
        if _there(now_s):
            expected = np.tile(_line(np.array([now_s])), (2, 1))
            assert np.abs(traffic.poses[:, 0] - expected).max() < 1e-9
            assert np.abs(traffic.speed_mps[:, 0] - SPEED_MPS).max() < 1e-9
            seen += 1
        else:
            assert np.isnan(traffic.poses[:, 0]).all()
            assert np.isnan(traffic.speed_mps[:, 0]).all()
        # Others keep their columns, and their ways.
        assert traffic.poses[0, 1] == pytest.approx([10.0, -5.0, 0.0])
        assert np.isnan(traffic.poses[1, 1]).all()
        traffic.step(time_s=now_s, dt_s=TICK_S)
    # 0.5 to 1.05 and 3.05 to 4.0, both ends included.
    assert seen == 12 + 20


def test_at_its_samples_it_is_where_they_say() -> None:
    user = _on_line()
    replay = Replay([_on_line(SAMPLES_S - 0.3), user])
    table = PathTable([EGO_PATH], replay.tracks)
    begin = table.on(np.array([2])).begin
    for time_s, pose in zip(SAMPLES_S, user.poses, strict=True):
        now = replay.at(float(time_s))
        assert not now.gone[0, 1]
        place = table.place(table.on(np.array([2])), np.zeros(1))
        place.node[:] = begin + now.node[0, 1]
        place.share[:] = now.share[0, 1]
        assert np.abs(table.poses(place)[0] - pose).max() < 1e-9
    assert Replay([user]).at(np.array([[1.05], [1.06], [3.04], [3.05]])).gone.ravel().tolist() == [
        False, True, True, False,
    ]  # fmt: skip


def test_yaw_turns_the_short_way_round() -> None:
    user = RecordedRoadUser(
        user_id="u", kind="car", time_s=np.array([0.0, 1.0]),
        poses=np.array([[0.0, 0.0, 3.0], [0.0, 0.0, -3.0]]), speed_mps=np.array([2.0, 4.0]),
        gone_after=np.zeros(2, dtype=bool),
    )  # fmt: skip
    traffic = _traffic(user)
    traffic.step(time_s=0.2, dt_s=0.05)
    turned = 0.25 * (2.0 * math.pi - 6.0)
    assert traffic.poses[0, 0, 2] == pytest.approx(3.0 + turned, abs=1e-12)
    assert traffic.speed_mps[0, 0] == pytest.approx(2.5)


def test_it_is_seen_while_it_is_there_and_only_then() -> None:
    car = load_vehicle()
    ahead = RecordedRoadUser(
        user_id="a", kind="car", time_s=np.array([1.0, 2.0]),
        poses=np.array([[30.0, 0.2, 0.0], [34.0, 0.2, 0.0]]), speed_mps=np.array([4.0, 4.0]),
        gone_after=np.zeros(2, dtype=bool),
    )  # fmt: skip
    traffic = _traffic(ahead, futures=1)
    nothing = PerceptionFaults(np.zeros(1), np.zeros(1), np.zeros(1))
    sight = Sight(traffic, traffic.table.along(EGO_PATH), car, nothing, tick_s=TICK_S)
    ego = FrenetPoint(np.array([50.0]), np.array([0.0]))
    gaps = []
    for tick in range(60):
        seen = sight.look(tick, traffic, np.array([[0.0, 0.0]]))
        gaps.append(float(sight.lead(seen, ego).gap_m[0]))
        assert np.isfinite(seen.arc_m[0, 0]) == (20 <= tick <= 40)
        traffic.step(time_s=tick * TICK_S, dt_s=TICK_S)
    # The parked van is beside the way; nobody else is on it before and after.
    assert np.isinf(gaps[:20]).all()
    assert np.isinf(gaps[41:]).all()
    assert np.diff(gaps[20:41]) == pytest.approx(np.full(20, 0.2))


def test_futures_that_began_later_see_it_at_their_own_time() -> None:
    pool = _traffic(_on_line())
    again = pool.begun(np.array([0, 1]))
    for tick in range(13):
        pool.step(time_s=tick * TICK_S, dt_s=TICK_S)
    again.carry_on(pool, np.array([True, False]))
    assert again.poses[0, 0] == pytest.approx(_line(np.array([0.65]))[0], abs=1e-9)
    assert np.isnan(again.poses[1, 0]).all()
    again.step(time_s=np.array([[0.65], [0.5]]), dt_s=TICK_S)
    assert again.poses[:, 0] == pytest.approx(_line(np.array([0.7, 0.55])), abs=1e-9)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"time_s": SAMPLES_S[::-1]}, "'7': times do not rise"),
        ({"time_s": SAMPLES_S[1:]}, "6 times do not go with"),
        ({"speed_mps": np.full(7, np.nan)}, "not finite"),
    ],
)
def test_samples_that_make_no_sense_are_said(change: dict[str, Array], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        Replay([msgspec.structs.replace(_on_line(), **change)])
