"""What a stage compiles: a World, one vehicle, one kinematic road user, sensors of contact."""

from __future__ import annotations

import mujoco

from contracts.vehicle import VehicleParameters
from contracts.world import World
from sim_worker.vehicle.planar import set_physics_options, vehicle_spec
from world_gen.export.mjcf import ROAD_USER, VEHICLE
from world_gen.export.mjcf import world_spec as spec_of_world

ROAD_USER_LENGTH_M, ROAD_USER_WIDTH_M, ROAD_USER_HEIGHT_M = 4.5, 1.8, 1.5
PREFIX = "ego_"
STATIC_CONTACT = "static_contact"
ROAD_USER_CONTACT = "road_user_contact"
_ROAD_USER = "road_user"
FAR_M = 1.0e4
"""Where the road user of a future without one is kept."""


def world_spec(world: World | None) -> mujoco.MjSpec:
    """Return the spec of `world`, or of open ground, with the physics options set."""
    if world is None:
        spec = mujoco.MjSpec()
        spec.modelname = "open ground"
    else:
        spec = spec_of_world(world, visual=False)
    set_physics_options(spec)
    for geom in spec.geoms:
        # The planar vehicle never touches the ground: its plane would be tested in vain.
        if geom.type == mujoco.mjtGeom.mjGEOM_PLANE:
            geom.contype, geom.conaffinity = 0, 0
    return spec


def compile_stage(spec: mujoco.MjSpec, vehicle: VehicleParameters) -> mujoco.MjModel:
    """Return `spec` with the vehicle, a road user, and a sensor of contacts with either."""
    spec.attach(vehicle_spec(vehicle), prefix=PREFIX, frame=spec.worldbody.add_frame())
    add_road_user(spec, name=_ROAD_USER)
    body = mujoco.mjtObj.mjOBJ_BODY
    for name, other in ((STATIC_CONTACT, "world"), (ROAD_USER_CONTACT, _ROAD_USER)):
        sensor = spec.add_sensor(
            name=name,
            type=mujoco.mjtSensor.mjSENS_CONTACT,
            objtype=body,
            objname=PREFIX + "chassis",
            reftype=body,
            refname=other,
        )
        sensor.intprm = [1 << int(mujoco.mjtConDataField.mjCONDATA_FOUND), 0, 1]
    return spec.compile()


def add_road_user(spec: mujoco.MjSpec, *, name: str, collides: bool = True) -> None:
    """Add a kinematic car-sized box whose body origin is its centre on the ground."""
    body = spec.worldbody.add_body(name=name, mocap=True, pos=[FAR_M, FAR_M, 0.0])
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[ROAD_USER_LENGTH_M / 2, ROAD_USER_WIDTH_M / 2, ROAD_USER_HEIGHT_M / 2],
        pos=[0.0, 0.0, ROAD_USER_HEIGHT_M / 2],
        contype=ROAD_USER if collides else 0,
        conaffinity=VEHICLE if collides else 0,
        rgba=[0.9, 0.4, 0.2, 1.0],
    )
