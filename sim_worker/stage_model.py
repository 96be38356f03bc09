"""What a stage compiles: a World, one vehicle, and a sensor of contact between them."""

from __future__ import annotations

import mujoco

from contracts.vehicle import VehicleParameters
from contracts.world import World
from sim_worker.vehicle.planar import set_physics_options, vehicle_spec
from world_gen.export.mjcf import world_spec as spec_of_world

PREFIX = "ego_"
STATIC_CONTACT = "static_contact"


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


def compile_open(vehicle: VehicleParameters) -> mujoco.MjModel:
    """Return the vehicle where it can touch nothing: the state of `compile_stage`, nothing else."""
    spec = mujoco.MjSpec()
    set_physics_options(spec)
    spec.attach(vehicle_spec(vehicle), prefix=PREFIX, frame=spec.worldbody.add_frame())
    for geom in spec.geoms:
        # Its mass is the chassis's own: only its place would be worked out at each step.
        spec.delete(geom)
    disable = mujoco.mjtDisableBit
    # The planar vehicle has no other constraint than contacts.
    spec.option.disableflags |= int(disable.mjDSBL_CONSTRAINT | disable.mjDSBL_CONTACT)
    spec.option.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    return spec.compile()


def compile_stage(spec: mujoco.MjSpec, vehicle: VehicleParameters) -> mujoco.MjModel:
    """Return `spec` with the vehicle and a sensor of contacts between both."""
    spec.attach(vehicle_spec(vehicle), prefix=PREFIX, frame=spec.worldbody.add_frame())
    body = mujoco.mjtObj.mjOBJ_BODY
    sensor = spec.add_sensor(
        name=STATIC_CONTACT,
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=body,
        objname=PREFIX + "chassis",
        reftype=body,
        refname="world",
    )
    sensor.intprm = [1 << int(mujoco.mjtConDataField.mjCONDATA_FOUND), 0, 1]
    return spec.compile()
