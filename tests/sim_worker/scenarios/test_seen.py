"""Detected road users go along the lane that they are on and head along, else straight on."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from foretwin.contracts.futures import SeenRoadUser
from foretwin.sim_worker.scenarios.roads import RoadNetwork
from foretwin.sim_worker.scenarios.seen import SeenActors
from tests.sim_worker.places import crossroads

SEEN = SeenActors(RoadNetwork(crossroads()))


def _at(x: float, y: float, yaw_deg: float, speed: float = 5.0) -> SeenRoadUser:
    return SeenRoadUser(
        kind="car", x_m=x, y_m=y, yaw_rad=math.radians(yaw_deg), speed_mps=speed, length_m=4.0,
        width_m=1.8,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("user", "lawful", "beside_m"),
    [
        (_at(-40.0, -1.5, 0.0), True, 0.0),
        (_at(-41.7, -0.9, 30.0), True, 0.6),
        # Not nearer to the lane that leads the other way, though that is as near.
        (_at(-40.0, 0.2, 170.0), True, 1.3),
        (_at(-40.0, -1.5, 60.0), False, 0.0),
        (_at(-40.0, -4.0, 0.0), False, 0.0),
        (_at(1.5, -30.0, 90.0), True, 0.0),
    ],
)
def test_the_lane_under_somebody_is_the_one_headed_along(
    user: SeenRoadUser, lawful: bool, beside_m: float
) -> None:
    (player,) = SEEN.actors([user])
    assert (player.conduct == "law_abiding") == lawful
    assert player.lateral_m == pytest.approx(beside_m, abs=1e-6)
    place = player.path.point_at(np.array([player.start_arc_m]), player.lateral_m)
    assert place[0] == pytest.approx([user.x_m, user.y_m], abs=1e-6)


def test_two_on_one_lane_share_its_path_and_who_stands_stays() -> None:
    first, second, stands = SEEN.actors([
        _at(-40.0, -1.5, 0.0), _at(-60.0, -1.5, 0.0), _at(-50.0, -1.5, 0.0, 0.0)
    ])  # fmt: skip
    assert first.path is second.path
    assert stands.conduct == "parked"


def test_where_there_are_no_lanes_one_goes_straight_on() -> None:
    bare = msgspec.structs.replace(crossroads(connections=False), lanes=())
    (player,) = SeenActors(RoadNetwork(bare)).actors([_at(-40.0, -1.5, 0.0)])
    assert player.conduct == "heedless"
