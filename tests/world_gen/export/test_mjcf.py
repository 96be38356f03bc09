"""The MuJoCo model of a World: what collides, what is only seen, and what a file holds."""

from __future__ import annotations

from itertools import product
from typing import Any

import msgspec
import mujoco
import numpy as np
import pytest
import shapely
from lxml import etree

from foretwin.contracts.world import ATTRIBUTION, World
from foretwin.world_gen.export.mjcf import ROAD_USER, STATIC, VEHICLE, world_spec, write_mjcf
from tests.world_gen.drawn_maps import crossing, roundabout, world_of

COVERS = ("foretwin.world_gen.export.solids",)
HOUSES = {
    20: "POLYGON ((20 20, 50 20, 50 30, 30 30, 30 50, 20 50, 20 20))",
    30: "POLYGON ((20 -40, 30 -40, 30 -30, 20 -30, 20 -40))",
    40: "POLYGON ((-80 60, -70 60, -70 70, -80 70, -80 60))",
}
"""Outlines by the number of their first node: an L, one that begins above a car, and a far one."""


def houses() -> dict[str, Any]:
    """Return what `crossing` takes to have the houses beside it."""
    nodes, ways = {}, []
    for first, outline in HOUSES.items():
        corners = shapely.get_coordinates(shapely.from_wkt(outline))[:-1].tolist()
        mine = dict(enumerate(map(tuple, corners), start=first))
        tags = {"building": "yes", "height": "12"} | ({"min_height": "5"} if first == 30 else {})
        nodes |= mine
        ways.append((first, [*mine, first], tags))
    return {"extra_nodes": nodes, "extra_ways": ways}


@pytest.fixture(scope="module")
def world() -> World:
    return world_of(crossing(**houses()))


def _contacts_at(spec: mujoco.MjSpec, x_m: float, y_m: float, *, bits: tuple[int, int]) -> int:
    """Return how many contacts a car-sized box has at a place."""
    body = spec.worldbody.add_body(name="car", pos=[x_m, y_m, 0.8])
    for axis in ([1, 0, 0], [0, 1, 0]):
        body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX, size=[2.2, 0.9, 0.7], contype=bits[0], conaffinity=bits[1]
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return int(data.ncon)


CAR = (VEHICLE, STATIC | ROAD_USER)


@pytest.mark.parametrize("visual", [True, False])
def test_a_car_hits_buildings_and_nothing_else(world, visual):
    assert _contacts_at(world_spec(world, visual=visual), 25.0, 25.0, bits=CAR) > 0
    assert _contacts_at(world_spec(world, visual=visual), 0.0, 0.0, bits=CAR) == 0


def test_the_notch_of_an_l_can_be_driven_into(world):
    assert _contacts_at(world_spec(world), 40.0, 40.0, bits=CAR) == 0


def test_a_car_drives_under_what_begins_above_it(world):
    assert _contacts_at(world_spec(world), 25.0, -35.0, bits=CAR) == 0


def test_mocap_road_users_and_ghosts_do_not_meet_buildings(world):
    for bits in ((ROAD_USER, VEHICLE), (0, 0)):
        assert _contacts_at(world_spec(world), 25.0, 25.0, bits=bits) == 0


def test_a_roundabouts_middle_stops_a_car():
    world = world_of(roundabout())
    assert _contacts_at(world_spec(world, visual=False), 0.0, 0.0, bits=CAR) > 0
    ring = next(lane for lane in world.lanes if lane.role == "ring").centerline
    assert _contacts_at(world_spec(world), *ring[len(ring) // 2], bits=CAR) == 0


def test_options_are_those_that_were_measured(world):
    model = world_spec(world).compile()
    assert model.opt.timestep == 0.01
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    assert model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    assert model.opt.jacobian == mujoco.mjtJacobian.mjJAC_DENSE
    assert model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_SLEEP


def test_static_geoms_stand_in_the_worlds_body_where_the_map_has_them(world):
    model = world_spec(world).compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert set(model.geom_bodyid) == {0}
    corners = []
    for geom in range(model.ngeom):
        if not mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, geom).startswith("building:w20"):
            continue
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX:
            points = np.array(list(product((-1, 1), repeat=3))) * model.geom_size[geom]
        else:
            mesh = model.geom_dataid[geom]
            first = model.mesh_vertadr[mesh]
            points = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
        corners.append(points @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])
    low, high = np.concatenate(corners).min(axis=0), np.concatenate(corners).max(axis=0)
    np.testing.assert_allclose(low, [20.0, 20.0, 0.0], atol=0.05)
    np.testing.assert_allclose(high, [50.0, 50.0, 12.0], atol=0.05)


def test_workers_do_without_the_road_and_far_buildings(world):
    full, worker = world_spec(world).compile(), world_spec(world, visual=False).compile()
    assert mujoco.mj_name2id(full, mujoco.mjtObj.mjOBJ_GEOM, "road") >= 0
    assert mujoco.mj_name2id(worker, mujoco.mjtObj.mjOBJ_GEOM, "road") == -1
    assert mujoco.mj_name2id(full, mujoco.mjtObj.mjOBJ_GEOM, "building:w40:0") >= 0
    assert mujoco.mj_name2id(worker, mujoco.mjtObj.mjOBJ_GEOM, "building:w40:0") == -1


def test_the_file_loads_and_carries_the_attribution(world, tmp_path):
    path = tmp_path / "world.xml"
    write_mjcf(world, path)
    assert ATTRIBUTION in path.read_text(encoding="utf-8")
    model = mujoco.MjModel.from_xml_path(str(path))
    assert model.ngeom == world_spec(world).compile().ngeom
    mujoco.mj_step(model, mujoco.MjData(model))


def test_a_name_that_xml_cannot_hold_leaves_the_file_whole(world, tmp_path):
    place = msgspec.structs.replace(world.intersection, name="Gate\x01 -- <Lane>")
    path = tmp_path / "world.xml"
    write_mjcf(msgspec.structs.replace(world, intersection=place), path)
    comment = etree.parse(str(path)).getroot().getprevious()
    assert "Gate -  <Lane>" in comment.text
