"""The traffic model goes on: nobody jumps, comes or goes in sight, and everybody sees the car."""

from __future__ import annotations

import itertools

import msgspec
import numpy as np
import pytest

from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local, target_from_source_m
from foretwin.contracts.world import World
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.virtual_traffic.model import GONE_M, ModelTraffic
from foretwin.sim_worker.virtual_traffic.source import FIRST_M, STEP_S, UNSEEN_M
from tests.sim_worker.places import FRAME, crossroads
from tests.sim_worker.virtual_traffic.motions import G_MPS2, Scene, played, still, tracks

COVERS = ("foretwin.sim_worker.virtual_traffic.source",)

CAR = load_vehicle()


def model(count: int = 8, seed: int = 3) -> ModelTraffic:
    found = ModelTraffic(CAR, count=count, seed=seed)
    found.use_world(crossroads())
    return found


@pytest.fixture(scope="module")
def minute() -> list[Scene]:
    """A minute beside a car that waits where nobody else drives."""
    return list(played(model(), still(20.0, 20.0), from_s=0.0, to_s=60.0))


def away_m(user: object, x: float, y: float) -> float:
    return float(np.hypot(user.x_m - x, user.y_m - y))  # type: ignore[attr-defined]


def test_so_many_are_there_and_move(minute: list[Scene]) -> None:
    assert len(minute[0]) == 8
    assert len(minute[-1]) >= 6
    driven = sum(float(track.rows[:, 3].sum()) * STEP_S for track in tracks(minute).values())
    assert driven > 8 * 60.0 * 2.0


def test_nobody_jumps_or_does_what_tyres_cannot(minute: list[Scene]) -> None:
    for track in tracks(minute).values():
        assert track.worst_jump_m() < 0.03
        assert track.worst_mps2() < 0.8 * G_MPS2


def test_nobody_comes_or_goes_in_sight(minute: list[Scene]) -> None:
    for user in minute[0]:
        assert away_m(user, 20.0, 20.0) > FIRST_M - 5.0
    for before, after in itertools.pairwise(minute):
        names = {user.user_id for user in before}, {user.user_id for user in after}
        for user in (*before, *after):
            if not all(user.user_id in one for one in names):
                assert UNSEEN_M - 5.0 < away_m(user, 20.0, 20.0) < GONE_M + 5.0
    assert len(tracks(minute)) > 8


def test_the_same_seed_and_motion_give_the_same_bits(minute: list[Scene]) -> None:
    again = list(played(model(), still(20.0, 20.0), from_s=0.0, to_s=10.0))
    assert again == minute[:200]
    other = list(played(model(seed=4), still(20.0, 20.0), from_s=0.0, to_s=1.0))
    assert other[0] != minute[0]


def test_who_meets_the_car_stops_behind_it() -> None:
    """The car stands in the lane that leads east, 30 m before the crossing."""
    scenes = list(played(model(12), still(-30.0, -1.5), from_s=0.0, to_s=40.0))
    rear_m = -30.0 - 1.0
    behind = [
        user
        for user in scenes[-1]
        if -90.0 < user.x_m < -30.0 and abs(user.y_m + 1.5) < 0.5 and abs(user.yaw_rad) < 0.1
    ]
    assert behind
    for user in behind:
        assert user.speed_mps < 0.5
        assert user.x_m + user.length_m / 2.0 < rear_m


def moved_world(east_m: float) -> World:
    """The same streets again, with their middle so far in the east of the first ones', in a frame
    of their own."""
    lat, lon = geo_from_local(FRAME, np.array([east_m, 0.0])).tolist()
    return msgspec.structs.replace(crossroads(), id="east", frame=LocalFrame(GeoPoint(lat, lon)))


def test_they_go_on_into_the_next_world_without_a_step() -> None:
    """Places in the frame of the first World all along, across a change after ten seconds."""
    traffic, east = model(14, seed=6), moved_world(200.0)
    scenes = list(played(traffic, still(60.0, 20.0), from_s=0.0, to_s=10.0))
    traffic.use_world(east)
    for scene in played(traffic, still(-140.0, 20.0), from_s=10.0, to_s=30.0):
        xy = np.array([(user.x_m, user.y_m) for user in scene])
        back = target_from_source_m(FRAME, east.frame, xy).tolist()
        scenes.append(
            tuple(user._replace(x_m=x, y_m=y) for user, (x, y) in zip(scene, back, strict=True))
        )
    assert {user.user_id for user in scenes[199]} <= {user.user_id for user in scenes[200]}
    found = tracks(scenes)
    for track in found.values():
        assert track.worst_jump_m() < 0.05
    # Somebody has driven from the one into the other, and onto its lanes beyond where it began.
    assert any(track.rows[0, 0] < 100.0 < 160.0 < track.rows[-1, 0] for track in found.values())


def test_at_red_they_wait() -> None:
    world = crossroads()
    lit = msgspec.structs.replace(
        world,
        connections=tuple(
            msgspec.structs.replace(one, signal_group_id="all") for one in world.connections
        ),
    )
    traffic = ModelTraffic(CAR, count=10, seed=2)
    traffic.use_world(lit)
    row = np.zeros(8)
    row[:2] = 20.0
    stands: dict[str, tuple[float, float]] = {}
    for k in range(800):
        scene = traffic.step(row, time_s=k * STEP_S, colours={"all": "red"})
        for user in scene:
            if user.speed_mps < 0.01:
                stands.setdefault(user.user_id, (user.x_m, user.y_m))
            if user.user_id in stands:
                assert (user.x_m, user.y_m) == pytest.approx(stands[user.user_id], abs=0.01)
    assert len(stands) > 3
    inside = [u for u in scene if max(abs(u.x_m), abs(u.y_m)) < 6.0]
    assert not inside


def test_without_a_world_or_lanes_nobody_is_there() -> None:
    nowhere = ModelTraffic(CAR, count=3, seed=0)
    assert nowhere.step(np.zeros(8), time_s=0.0, colours={}) == ()
    nowhere.use_world(msgspec.structs.replace(crossroads(connections=False), lanes=()))
    assert nowhere.step(np.zeros(8), time_s=0.0, colours={}) == ()
