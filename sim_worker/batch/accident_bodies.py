"""The two bodies of an accident: masses, inertias, axles and friction, as arrays.

Row 0 of every (2, A) array is the ego, row 1 the road user it meets.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.drive import RoadUserKind
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.batch.collision_detection import Touches
from foretwin.sim_worker.vehicle.parameters import GRAVITY_MPS2
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m
from foretwin.sim_worker.vehicle.road_user_kinds import KINDS

_TYRE_FRICTION = 0.75
"""Of tyres that slide, dry asphalt: Warner et al. (1983), Friction applications in accident
reconstruction, SAE 830612, give 0.55 to 0.9 for travelled asphalt."""
_SLIDING_FRICTION: dict[RoadUserKind, float] = {
    "pedestrian": 0.66,
    "bicycle": 0.5,
    "motorcycle": 0.5,
}
"""Of those who fall and slide on the road, however they are turned. Pedestrians: Searle and
Searle (1983), SAE 831622, 0.66 on dry asphalt; two-wheelers on their side: assumed, in the middle
of the 0.3 to 0.75 that sliding tests report."""
_RAIL_FRICTION = 5.0
"""Of a tram sideways, as a share of its weight: its rails hold it well beyond any car's push."""
_STIFFNESS_PRAD = 20.0
"""Cornering stiffness over axle load: that of CommonRoad's tyre is 21.92."""
_AXLE_SHARE = 0.3
"""From the middle of another road user's box to either axle, over its length."""
_BRAKED_SHARE = 0.98
"""Of the friction that braking may use: a little is left sideways, as the limit must not be 0."""
_MIN_SPEED_MPS = 10.0
_BRAKE_DAMPING_PS = 20.0
"""Tyres and brakes are dampers up to their limits, and no stiffer than this over the mass: what
integrates them implicitly would let a standing car take the first hit as if it were heavier."""


class Bodies(NamedTuple):
    """What moves in A accidents, each (2, A) unless it says otherwise.

    `box_ahead_m` is from the centre of gravity to the centre of the box; `front_m` and `rear_m`
    are the distances of the axles from the centre of gravity; `stiffness_npr` and `load_n`
    (2 axles, 2, A) front and rear; `slides` are bodies without wheels to roll on; `brake_n` is the
    force along the body that slows those with wheels.
    """

    mass_kg: Array
    yaw_inertia_kgm2: Array
    length_m: Array
    width_m: Array
    box_ahead_m: Array
    front_m: Array
    rear_m: Array
    stiffness_npr: Array
    load_n: Array
    friction: Array
    slides: Flags
    brake_n: Array
    tire_angle_rad: Array

    def only(self, accidents: Indices) -> Bodies:
        """Return those of some accidents."""
        return Bodies._make(part[..., accidents] for part in self)


def accident_bodies(
    vehicle: VehicleParameters,
    touches: Touches,
    *,
    kinds: Sequence[RoadUserKind],
    friction_factor: Array,
) -> Bodies:
    """Describe the ego and its partner in each of A touches.

    The ego has the parameters of `vehicle`, goes on braking as it did, and keeps its tyre angle.
    The other has the mass of its kind and the yaw inertia of an even box, m (l² + w²) / 12.
    """
    count = len(touches.time_s)
    length, width = touches.user_size_m.T
    mass = np.array([KINDS[kind].mass_kg for kind in kinds])
    sliding = np.array([_SLIDING_FRICTION.get(kind, np.nan) for kind in kinds])
    slides = np.isfinite(sliding)
    grip = np.where([kind == "tram" for kind in kinds], _RAIL_FRICTION, _TYRE_FRICTION)
    grip = np.where(slides, sliding, grip) * friction_factor
    rear = vehicle.cog_from_rear_axle_m.value
    front = vehicle.wheelbase_m.value - rear
    own_friction = vehicle.friction.value * friction_factor
    decel = np.stack([np.maximum(-touches.ego_states[:, 7], 0.0), np.zeros(count)])
    axle = _AXLE_SHARE * length

    def both(own: float, others: Array) -> Array:
        return np.stack([np.full(count, own), others])

    axles = np.stack([both(front, axle), both(rear, axle)])
    masses = both(vehicle.mass_kg.value, mass)
    loads = masses * GRAVITY_MPS2 * axles[::-1] / axles.sum(axis=0)
    stiffness = _STIFFNESS_PRAD * loads
    stiffness[0, 0] = vehicle.front_cornering_stiffness_npr.value
    stiffness[1, 0] = vehicle.rear_cornering_stiffness_npr.value
    friction = np.stack([own_friction, grip])
    brake = masses * np.minimum(decel, _BRAKED_SHARE * friction * GRAVITY_MPS2)
    return Bodies(
        mass_kg=masses,
        yaw_inertia_kgm2=both(
            vehicle.yaw_inertia_kgm2.value, mass * (np.square(length) + np.square(width)) / 12.0
        ),
        length_m=both(vehicle.length_m.value, length),
        width_m=both(vehicle.width_m.value, width),
        box_ahead_m=both(box_centre_from_base_m(vehicle) - rear, np.zeros(count)),
        front_m=axles[0],
        rear_m=axles[1],
        stiffness_npr=stiffness,
        load_n=loads,
        friction=friction,
        slides=np.stack([np.zeros(count, dtype=bool), slides]),
        brake_n=brake,
        tire_angle_rad=np.stack([touches.ego_states[:, 6], np.zeros(count)]),
    )


class GroundForces(NamedTuple):
    """What the ground may exert until asked again, each (3, 2, A).

    Damping in N s/m and limit in N of what resists sliding: sideways at the front axle, sideways
    at the rear axle, and along the body.
    """

    damping: Array
    limit_n: Array


def ground_forces(bodies: Bodies, velocity: Array) -> GroundForces:
    """Return the forces of tyres, or of those who slide, at body velocities (2, A, 2).

    Tyres as in the planar vehicle, within the friction circle that braking leaves; sliding
    friction points against the velocity, whichever way the body is turned.
    """
    ahead, aside = np.abs(velocity[..., 0]), np.abs(velocity[..., 1])
    damping = np.empty((3, *ahead.shape))
    damping[:2] = bodies.stiffness_npr / np.maximum(ahead, _MIN_SPEED_MPS)
    damping[2] = _BRAKE_DAMPING_PS * bodies.mass_kg
    limit = bodies.friction * bodies.load_n
    total = limit.sum(axis=0)
    rolling = np.sqrt(np.maximum(1.0 - np.square(bodies.brake_n / total), 0.0))
    speed = np.maximum(np.hypot(ahead, aside), 1e-6)
    # A body that slides and hardly moves may still turn: it holds against that.
    sideways = np.where(speed > 0.1, np.maximum(aside / speed, 0.1), 1.0)
    along = np.where(bodies.slides, total * np.maximum(ahead / speed, 0.1), bodies.brake_n)
    return GroundForces(
        damping, np.stack([*(limit * np.where(bodies.slides, sideways, rolling)), along])
    )
