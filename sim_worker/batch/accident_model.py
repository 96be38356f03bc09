"""Two planar boxes that collide, as a MuJoCo Batch with bodies of their own per simulation.

The boxes are far taller than wide, so that no overlap looks vertical to the collision of boxes.
A contact is a spring and damper along the normal, which MuJoCo norms by the masses: its frequency
and its coefficient of restitution are those given, whatever collides.
"""

from __future__ import annotations

import math
from functools import cache, lru_cache
from typing import NamedTuple

import mujoco
import numpy as np
from mujoco import batch as mujoco_batch

from foretwin.contracts.arrays import Array, Flags
from foretwin.sim_worker.batch.accident_bodies import Bodies, GroundForces
from foretwin.sim_worker.vehicle.planar import set_physics_options

_BODIES = ("ego", "other")
_HALF_HEIGHT_M = 100.0
_ACTUATORS = ("front", "rear", "along")
_TINY_N = 1e-9
_SOLIMP = (0.9999, 0.9999, 0.001, 0.5, 2.0)
_OFF_CENTRE = 0.1
"""Where the compiled model has a position of 0, it would never look at those of a simulation."""


class ContactLaw(NamedTuple):
    """How two road users bounce off and rub each other.

    `restitution`: separating over closing speed along the normal. Brach and Brach, Vehicle
    Accident Analysis and Reconstruction Methods (2nd ed. 2011), chapters 6 and 7: near 0.3 below
    5 m/s and falling towards 0 to 0.1 at the speeds that injure. `friction`: tangential over normal
    impulse while they slide along each other, same source: 0.3 to 0.6.
    """

    restitution: float = 0.1
    friction: float = 0.5


class Crush(NamedTuple):
    """The contact as a spring: its angular frequency and the step that resolves it."""

    frequency_radps: float
    timestep_s: float


@lru_cache(maxsize=256)
def contact_damping(restitution: float, crush: Crush) -> float:
    """Return the damping in 1/s that gives a contact its `restitution` at the step of `crush`.

    A spring that pushes and never pulls, with a damper beside it, is run as the physics runs it
    and its damping halved upon, since steps change what closed forms foretell (Schwager and
    Pöschel 2007, Granular Matter 9:465). Raises ValueError for a restitution outside 0.05 to 1:
    damping within a step cannot take more.
    """
    if not 0.05 <= restitution <= 1.0:
        raise ValueError(f"restitution {restitution} must be within 0.05 and 1")
    low, high = 0.0, 1.0 / crush.timestep_s
    for _ in range(40):
        middle = (low + high) / 2.0
        more = _rebound(middle, crush) > restitution
        low, high = (middle, high) if more else (low, middle)
    return high


def _rebound(damping: float, crush: Crush) -> float:
    step, stiffness = crush.timestep_s, crush.frequency_radps**2
    speed = -1.0
    # Accidents begin the moment before the touch: the first step finds it, the second feels it.
    gap = speed * step
    while gap < 0.0:
        speed += max(-damping * speed - stiffness * gap, 0.0) * step
        gap += speed * step
    return speed


class AccidentBatch:
    """A simulations of two bodies each; belongs to one thread."""

    def __init__(self, bodies: Bodies, impact: ContactLaw) -> None:
        self.count = bodies.mass_kg.shape[1]
        self._impact = impact
        self._batch = mujoco_batch.Batch(_model(), self.count, nthread=1, persistent=True)
        self._fill(bodies)
        self._qpos = self._batch.bind("qpos").reshape(self.count, 2, 3)
        self._qvel = self._batch.bind("qvel").reshape(self.count, 2, 3)
        self._timestep = self._batch.expand("opt.timestep")
        self._solref = self._batch.expand("pair_solref")
        self._slip = self._batch.expand("pair_solreffriction")
        self._bias = self._batch.expand("actuator_biasprm").reshape(self.count, 2, 3, -1)
        self._range = self._batch.expand("actuator_forcerange").reshape(self.count, 2, 3, 2)

    def _fill(self, bodies: Bodies) -> None:
        batch, model = self._batch, _model()
        ids = [model.body(name).id for name in _BODIES]
        batch.expand("body_mass")[:, ids] = bodies.mass_kg.T
        batch.expand("body_inertia")[:, ids] = bodies.yaw_inertia_kgm2.T[..., None]
        half = np.stack(
            [
                bodies.length_m.T / 2.0,
                bodies.width_m.T / 2.0,
                np.full((self.count, 2), _HALF_HEIGHT_M),
            ],
            axis=-1,
        )
        batch.expand("geom_size")[:] = half
        batch.expand("geom_pos")[:, :, 0] = bodies.box_ahead_m.T
        batch.expand("geom_rbound")[:] = np.linalg.norm(half, axis=-1)
        batch.expand("geom_aabb").reshape(self.count, 2, 6)[:, :, 3:] = half
        place = batch.expand("site_pos").reshape(self.count, 2, 3, 3)
        place[:, :, 0, 0], place[:, :, 1, 0] = bodies.front_m.T, -bodies.rear_m.T
        turned = batch.expand("site_quat").reshape(self.count, 2, 3, 4)
        turned[:, :, 0, 0] = np.cos(bodies.tire_angle_rad.T / 2.0)
        turned[:, :, 0, 3] = np.sin(bodies.tire_angle_rad.T / 2.0)
        batch.expand("pair_friction")[:] = self._impact.friction
        batch.set_const()

    def place(self, poses: Array, velocities: Array) -> None:
        """Set centres of gravity and their velocities, each (2, A, 3) with the yaw last."""
        self._batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE)
        self._qpos[:] = poses.transpose(1, 0, 2)
        self._qvel[:] = velocities.transpose(1, 0, 2)

    @property
    def poses(self) -> Array:
        """Centres of gravity (2, A, 3) now: x, y, yaw."""
        return np.asarray(self._qpos.transpose(1, 0, 2))

    @property
    def velocities(self) -> Array:
        """Velocities (2, A, 3) now, in the frame of the poses."""
        return np.asarray(self._qvel.transpose(1, 0, 2))

    def set_crush(self, crush: Crush) -> None:
        """Choose how stiff contacts are from now on."""
        self._solref[..., 0] = -(crush.frequency_radps**2)
        self._solref[..., 1] = -contact_damping(self._impact.restitution, crush)
        # Sliding is ended by friction as fast as the step allows.
        self._slip[..., 0] = 0.0
        self._slip[..., 1] = -0.5 / crush.timestep_s

    def set_ground(self, forces: GroundForces) -> None:
        """Choose what the ground may exert from now on."""
        self._bias[..., 2] = -forces.damping.transpose(2, 1, 0)
        limits = np.maximum(forces.limit_n.transpose(2, 1, 0), _TINY_N)
        self._range[..., 0], self._range[..., 1] = -limits, limits

    def advance(self, which: Flags, duration_s: float, longest_step_s: float) -> Array:
        """Step the simulations `which` (A,); return (2, N, 3) impulses of their contact.

        Force times time on either body in the frame of the poses, and its moment about the centre
        of gravity.
        """
        ids = np.flatnonzero(which)
        if not len(ids):
            return np.zeros((2, 0, 3))
        steps = math.ceil(duration_s / longest_step_s - 1e-9)
        self._timestep[ids] = duration_s / steps
        record = self._batch.rollout(steps, record=("qfrc_constraint",), ids=ids)
        impulse = record["qfrc_constraint"].sum(axis=1) * (duration_s / steps)
        return np.asarray(impulse.reshape(len(ids), 2, 3).transpose(1, 0, 2))


@cache
def _model() -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.modelname = "accident"
    set_physics_options(spec)
    # Both bodies move all the time.
    spec.option.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    for name in _BODIES:
        body = spec.worldbody.add_body(name=name)
        body.add_joint(name=f"{name}_x", type=slide, axis=[1, 0, 0])
        body.add_joint(name=f"{name}_y", type=slide, axis=[0, 1, 0])
        body.add_joint(name=f"{name}_yaw", type=hinge, axis=[0, 0, 1])
        body.explicitinertial = True
        body.mass, body.inertia = 1000.0, [1000.0, 1000.0, 1000.0]
        body.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[2.0, 1.0, _HALF_HEIGHT_M],
            pos=[_OFF_CENTRE, 0.0, 0.0],
            contype=0,
            conaffinity=0,
            mass=0.0,
        )
        turned = [math.cos(_OFF_CENTRE), 0.0, 0.0, math.sin(_OFF_CENTRE)]
        body.add_site(name=f"{name}_front", pos=[1.0, 0.0, 0.0], quat=turned)
        body.add_site(name=f"{name}_rear", pos=[-1.0, 0.0, 0.0])
        body.add_site(name=f"{name}_along")
        for part in _ACTUATORS:
            actuator = spec.add_actuator(
                name=f"{name}_{part}",
                trntype=mujoco.mjtTrn.mjTRN_SITE,
                target=f"{name}_{part}",
                gear=[1, 0, 0, 0, 0, 0] if part == "along" else [0, 1, 0, 0, 0, 0],
            )
            actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
            actuator.forcelimited = True
            actuator.forcerange = [-_TINY_N, _TINY_N]
    pair = spec.add_pair(name="impact", geomname1=_BODIES[0], geomname2=_BODIES[1], condim=3)
    pair.solimp = list(_SOLIMP)
    return spec.compile()
