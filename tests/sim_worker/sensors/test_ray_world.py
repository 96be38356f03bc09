"""Worlds and road users as rays meet them."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from foretwin.contracts.beside_road import Roof
from foretwin.contracts.drive import RoadUser
from foretwin.contracts.frames import GeoPoint, geo_from_local, geo_from_local_yaw
from foretwin.contracts.provenance import Quantity
from foretwin.contracts.world import Area
from foretwin.sim_worker.sensors.moving_boxes import NO_BODIES, boxes_of
from foretwin.sim_worker.sensors.ray_world import RayWorld
from foretwin.world_gen.ground.islands import RING_ISLAND
from tests.sim_worker.places import FRAME, box, crossroads

COVERS = ("foretwin.sim_worker.sensors.moving_boxes",)


def user(x: float, y: float, yaw: float, **changes: object) -> RoadUser:
    lat, lon = geo_from_local(FRAME, np.array([x, y])).tolist()
    values = {
        "user_id": "u", "kind": "van", "position": GeoPoint(lat, lon),
        "yaw_rad": float(geo_from_local_yaw(FRAME, yaw, np.array([x, y]))), "speed_mps": 3.0,
        "length_m": 6.0, "width_m": 2.0,
    }  # fmt: skip
    return RoadUser(**{**values, **changes})


def test_road_users_are_boxes_in_the_worlds_frame_as_high_as_their_kind() -> None:
    found = boxes_of(FRAME, [user(12.0, -4.0, 1.0), user(0.0, 9.0, -2.0, kind="bus")])

    assert found.xy_m == pytest.approx(np.array([[12.0, -4.0], [0.0, 9.0]]), abs=1e-6)
    assert found.yaw_rad == pytest.approx([1.0, -2.0], abs=1e-9)
    assert found.size_m.tolist() == [[6.0, 2.0, 2.6], [6.0, 2.0, 3.4]]
    assert found.speed_mps.tolist() == [3.0, 3.0]


def test_nobody_is_no_body() -> None:
    found = boxes_of(FRAME, [])

    assert [part.shape for part in found] == [part.shape for part in NO_BODIES]


def test_a_ray_tells_how_far_how_slanting_how_bright_and_whom() -> None:
    world = RayWorld(crossroads(buildings=(box(20.0, 0.0, 2.0, 5.0),)))
    world.set_bodies(boxes_of(FRAME, [user(-10.0, 0.0, 0.0)]))
    slanting = np.array([1.0, 0.1, 0.0]) / math.hypot(1.0, 0.1)
    ways = np.array([[1.0, 0, 0], slanting, [-1.0, 0, 0], [0, 1.0, 0], [0, 0, -1.0], [0, 0, 1.0]])
    found = world.look(np.array([0.0, 0.0, 1.0]), ways, time_s=1.0, range_m=50.0)

    along = 18.0 * math.hypot(1.0, 0.1)
    assert found.distance_m == pytest.approx([18.0, along, 4.0, np.inf, 1.0, np.inf])
    assert found.cos_incidence[:3] == pytest.approx([1.0, slanting[0], 1.0])
    assert found.reflectivity == pytest.approx([0.24, 0.24, 0.4, 0.0, 0.17, 0.0])
    assert found.body.tolist() == [-1, -1, 0, -1, -1, -1]
    assert world.parts == 2


def test_farther_than_the_range_nothing_is_met() -> None:
    world = RayWorld(crossroads(buildings=(box(20.0, 0.0, 2.0, 5.0),)))
    found = world.look(np.array([0.0, 0.0, 1.0]), np.array([[1.0, 0, 0]]), time_s=0, range_m=17.9)

    assert found.distance_m.tolist() == [np.inf]
    assert found.cos_incidence.tolist() == [0.0]


def test_roofs_and_islands_are_met_as_well() -> None:
    roof = Roof(form="gabled", height_m=Quantity(3.0, "default"), ridge_rad=0.0)
    house = msgspec.structs.replace(box(20.0, 0.0, 5.0, 5.0), roof=roof)
    island = Area(id="island:1", outline=box(0.0, 20.0, 2.0, 2.0).outline)
    mound = Area(id=f"{RING_ISLAND}1", outline=box(0.0, -20.0, 2.0, 2.0).outline)
    town = msgspec.structs.replace(crossroads(buildings=(house,)), islands=(island, mound))
    tops = np.array([[20.0, 0.0, 50.0], [20.0, 4.99, 50.0], [0.0, 20.0, 50.0], [0.0, -20.0, 50.0]])
    rays, down = RayWorld(town), np.array([[0.0, 0.0, -1.0]])
    met = [rays.look(top, down, time_s=0.0, range_m=100.0).distance_m[0] for top in tops]

    assert [50.0 - m for m in met] == pytest.approx([8.0, 5.0, 0.12, 1.0], abs=0.02)


def test_the_ground_is_met_from_above_alone_and_within_the_world() -> None:
    world = RayWorld(crossroads())
    down, up = np.array([[0.0, 0.0, -1.0]]), np.array([[0.0, 0.0, 1.0]])

    def met_m(z: float, way: np.ndarray, x: float = 0.0) -> float:
        found = world.look(np.array([x, 0.0, z]), way, time_s=0.0, range_m=50.0)
        return float(found.distance_m[0])

    assert (met_m(1.0, down), met_m(0.0, down)) == (pytest.approx(1.0), 0.0)
    assert met_m(-1.0, up) == met_m(-1.0, down) == met_m(1.0, down, x=1e4) == np.inf
