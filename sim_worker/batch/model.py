"""What a stage compiles: a World, one vehicle, and a sensor of contact between them."""

from __future__ import annotations

import mujoco

from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.sim_worker.vehicle.planar import set_physics_options, vehicle_spec
from foretwin.world_gen.export.mjcf import world_spec as spec_of_world

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


def _alone(vehicle: VehicleParameters) -> mujoco.MjSpec:
    spec = mujoco.MjSpec()
    set_physics_options(spec)
    spec.attach(vehicle_spec(vehicle), prefix=PREFIX, frame=spec.worldbody.add_frame())
    return spec


def compile_open(vehicle: VehicleParameters) -> mujoco.MjModel:
    """Return the vehicle where it can touch nothing: the state of `compile_stage`, nothing else."""
    spec = _alone(vehicle)
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


_OF_BODIES = ("body_mass", "body_inertia", "body_pos", "body_ipos", "body_iquat")
_OF_GEOMS = ("geom_size", "geom_pos", "geom_aabb", "geom_rbound")
_OF_ACTUATORS = tuple(
    f"actuator_{name}" for name in ("gainprm", "biasprm", "ctrlrange", "forcerange", "delay")
)


def change_vehicle(
    model: mujoco.MjModel, vehicle: VehicleParameters, *, prefix: str = PREFIX
) -> None:
    """Give the vehicle under `prefix` in a compiled model other parameters, in place.

    The same bits as compiling anew, at a tenth of the cost: the World stays as it is.
    """
    alone = _alone(vehicle).compile()
    for kind, count, fields in (
        (mujoco.mjtObj.mjOBJ_BODY, alone.nbody, _OF_BODIES),
        (mujoco.mjtObj.mjOBJ_GEOM, alone.ngeom, _OF_GEOMS),
        (mujoco.mjtObj.mjOBJ_SITE, alone.nsite, ("site_pos",)),
        (mujoco.mjtObj.mjOBJ_ACTUATOR, alone.nu, _OF_ACTUATORS),
    ):
        for here in range(count):
            name = mujoco.mj_id2name(alone, kind, here)
            if name is None or not name.startswith(PREFIX):
                continue
            there = mujoco.mj_name2id(model, kind, prefix + name.removeprefix(PREFIX))
            for field in fields:
                getattr(model, field)[there] = getattr(alone, field)[here]
            if kind == mujoco.mjtObj.mjOBJ_BODY and alone.body_bvhnum[here]:
                ours, theirs = alone.body_bvhadr[here], model.body_bvhadr[there]
                boxes = alone.bvh_aabb[ours : ours + alone.body_bvhnum[here]]
                model.bvh_aabb[theirs : theirs + len(boxes)] = boxes
    mujoco.mj_setConst(model, mujoco.MjData(model))
    # The solver's scale; nothing but the vehicle moves, so that it is the same in both.
    model.stat.meaninertia = alone.stat.meaninertia
