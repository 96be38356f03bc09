"""What happens in the second after a car touches another road user.

Road users are no part of a stage's physics; from the touch on, the car and the one it met are both
bodies with mass, spin and friction, in a Batch of their own with all accidents of a job side by
side. Planar: nobody is thrown up or run over, and cars do not deform.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.drive import RoadUserKind
from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.polyline import left_of
from foretwin.geometry.rectangles import Rectangles, separations
from foretwin.sim_worker.batch.accident_bodies import (
    Bodies,
    GroundForces,
    accident_bodies,
    ground_forces,
)
from foretwin.sim_worker.batch.accident_model import AccidentBatch, ContactLaw, Crush
from foretwin.sim_worker.batch.collision_detection import Touches
from foretwin.sim_worker.vehicle.reference_points import base_from_cog, cog_from_base

_STIFF, _STIFF_LOOK_S = Crush(400.0, 0.0005), 0.01
_SOFT, _SOFT_LOOK_S = Crush(100.0, 0.0025), 0.025
"""Contacts, and the longest time between two looks at the ground forces and at who is near."""
_STIFF_FOR_S = 0.05
"""The first impact is over by then; what follows is slower and may be less stiff."""
_APART_STEP_S = 0.01
"""For those who cannot touch before the next look."""
ACCIDENT_S = 1.0
"""How long both are followed after the touch."""
DELTA_V_WITHIN_S = 0.25
"""Delta-v is that within 250 ms of the touch, as event data recorders have it (49 CFR 563.7)."""


class Accidents(NamedTuple):
    """A accidents in the order of the touches, in the frame of the touches.

    `future`, `user`, `time_s`, `point_m` as in `Touches`. `angle_rad` (A,) is the other's heading
    seen from the ego's: 0 rear-end, ±π head-on. `closing_mps` (A,) is how fast the two points that
    touch approach along the normal. `ego_delta_v_mps`, `user_delta_v_mps` (A, 2) are the velocity
    changes that the contact alone gave each centre of gravity within 250 ms.

    `after_time_s` (N,) from 0, the touch; `ego_states` (A, N, 8) of base_link, `user_poses`
    (A, N, 3) of box centres, `user_velocities` (A, N, 3). `valid` (A,) false where the two began
    inside each other or the simulation failed: all that follows from the impact is NaN there.
    """

    future: Indices
    user: Indices
    time_s: Array
    point_m: Array
    angle_rad: Array
    closing_mps: Array
    ego_delta_v_mps: Array
    user_delta_v_mps: Array
    after_time_s: Array
    ego_states: Array
    user_poses: Array
    user_velocities: Array
    valid: Flags


def run_accidents(
    vehicle: VehicleParameters,
    touches: Touches,
    *,
    kinds: Sequence[RoadUserKind],
    friction_factor: Array | float = 1.0,
    impact: ContactLaw | None = None,
    ground: bool = True,
    duration_s: float = ACCIDENT_S,
    step_s: float = 0.05,
) -> Accidents:
    """Run each of A touches on for `duration_s` with both bodies moving freely.

    `kinds` of the road users touched, one for each, of whom none brakes; `friction_factor` of the
    ground, one for all or (A,). Results are `step_s` apart. Without `ground` nothing but the impact
    acts. Raises ValueError where the numbers of touches and kinds differ, or where `duration_s` is
    no multiple of `step_s`.
    """
    count = len(touches.time_s)
    if len(kinds) != count:
        raise ValueError(f"{len(kinds)} kinds of road users for {count} touches")
    steps = duration_s / step_s
    if steps < 1.0 - 1e-9 or abs(steps - round(steps)) > 1e-6:
        raise ValueError(f"duration_s {duration_s:g} must be a multiple of step_s {step_s:g}")
    friction = np.broadcast_to(friction_factor, count)
    bodies = accident_bodies(vehicle, touches, kinds=kinds, friction_factor=friction)
    poses, velocities = _start(vehicle, touches)
    apart = np.flatnonzero(~touches.from_start)
    tracks = _run(
        bodies.only(apart),
        poses[:, apart],
        velocities[:, apart],
        impact=impact or ContactLaw(),
        ground=ground,
        steps=round(steps),
        step_s=step_s,
    )
    return _results(vehicle, touches, apart, tracks, velocities, step_s)


class _Tracks(NamedTuple):
    """Centres of gravity of A accidents: poses, velocities (N, 2, A, 3), delta-v (2, A, 2)."""

    poses: Array
    velocities: Array
    delta_v_mps: Array


def _run(
    bodies: Bodies,
    poses: Array,
    velocities: Array,
    *,
    impact: ContactLaw,
    ground: bool,
    steps: int,
    step_s: float,
) -> _Tracks:
    count = poses.shape[1]
    track = np.empty((2, steps + 1, 2, count, 3))
    impulse = np.zeros((2, count, 3))
    if not count:
        return _Tracks(track[0], track[1], impulse[..., :2])
    batch = AccidentBatch(bodies, impact)
    batch.place(poses, velocities)
    track[0, 0], track[1, 0] = poses, velocities
    if not ground:
        nothing = np.zeros((3, *bodies.mass_kg.shape))
        batch.set_ground(GroundForces(nothing, nothing))
    for step in range(steps):
        stiff = step * step_s < _STIFF_FOR_S - 1e-9
        crush, longest = (_STIFF, _STIFF_LOOK_S) if stiff else (_SOFT, _SOFT_LOOK_S)
        batch.set_crush(crush)
        looks = math.ceil(step_s / longest - 1e-9)
        for look in range(looks):
            if ground:
                batch.set_ground(_ground(bodies, batch))
            near = _may_touch(bodies, batch, within_s=step_s / looks)
            given = batch.advance(near, step_s / looks, crush.timestep_s)
            batch.advance(~near, step_s / looks, _APART_STEP_S)
            if (step + look / looks) * step_s < DELTA_V_WITHIN_S - 1e-9:
                impulse[:, near] += given
        track[0, step + 1], track[1, step + 1] = batch.poses, batch.velocities
    return _Tracks(track[0], track[1], impulse[..., :2] / bodies.mass_kg[..., None])


def _ground(bodies: Bodies, batch: AccidentBatch) -> GroundForces:
    yaw, velocity = batch.poses[..., 2], batch.velocities
    cos, sin = np.cos(yaw), np.sin(yaw)
    ahead = cos * velocity[..., 0] + sin * velocity[..., 1]
    aside = cos * velocity[..., 1] - sin * velocity[..., 0]
    return ground_forces(bodies, np.stack([ahead, aside], axis=-1))


def _may_touch(bodies: Bodies, batch: AccidentBatch, *, within_s: float) -> Flags:
    """(A,) bool: whether the two cannot be ruled out to meet before the next look."""
    poses, velocities = batch.poses, batch.velocities
    yaw = poses[..., 2]
    centre = poses[..., :2] + bodies.box_ahead_m[..., None] * np.stack(
        [np.cos(yaw), np.sin(yaw)], axis=-1
    )
    boxes = [Rectangles(centre[i], yaw[i], bodies.length_m[i], bodies.width_m[i]) for i in range(2)]
    gap = separations(*boxes).max(axis=0)
    between = velocities[1] - velocities[0]
    fastest = np.hypot(between[:, 0], between[:, 1])
    fastest += (np.abs(velocities[..., 2]) * (bodies.length_m + bodies.width_m)).sum(axis=0)
    return np.asarray(gap < fastest * within_s + 0.02)


def _start(vehicle: VehicleParameters, touches: Touches) -> tuple[Array, Array]:
    """Return poses and velocities (2, A, 3) of both centres of gravity at the touch."""
    positions, own = cog_from_base(vehicle, touches.ego_states)
    return (
        np.stack([positions[:, :3], touches.user_poses]),
        np.stack([own[:, :3], touches.user_velocities]),
    )


def _results(
    vehicle: VehicleParameters,
    touches: Touches,
    apart: Indices,
    tracks: _Tracks,
    velocities: Array,
    step_s: float,
) -> Accidents:
    count, instants = len(touches.time_s), len(tracks.poses)
    ego = np.full((count, instants, 8), np.nan)
    poses = np.full((count, instants, 3), np.nan)
    rates, delta_v = poses.copy(), np.full((2, count, 2), np.nan)
    delta_v[:, apart] = tracks.delta_v_mps
    poses[apart] = tracks.poses[:, 1].transpose(1, 0, 2)
    rates[apart] = tracks.velocities[:, 1].transpose(1, 0, 2)
    ego[apart] = _base_states(vehicle, tracks, touches.ego_states[apart], step_s)
    valid = np.isfinite(ego).all(axis=(1, 2)) & np.isfinite(poses).all(axis=(1, 2))
    turned = touches.user_poses[:, 2] - touches.ego_states[:, 2]
    centre = cog_from_base(vehicle, touches.ego_states)[0][:, :2]
    arms = touches.point_m - np.stack([centre, touches.user_poses[:, :2]])
    at_point = velocities[..., :2] + velocities[..., 2:] * left_of(arms)
    closing = ((at_point[0] - at_point[1]) * touches.normal).sum(axis=-1)
    return Accidents(
        future=touches.future,
        user=touches.user,
        time_s=touches.time_s,
        point_m=touches.point_m,
        angle_rad=wrap_angle(turned),
        closing_mps=np.where(touches.from_start, np.nan, closing),
        ego_delta_v_mps=delta_v[0],
        user_delta_v_mps=delta_v[1],
        after_time_s=np.arange(instants, dtype=np.float64) * step_s,
        ego_states=ego,
        user_poses=poses,
        user_velocities=rates,
        valid=valid,
    )


def _base_states(vehicle: VehicleParameters, tracks: _Tracks, start: Array, step_s: float) -> Array:
    """Return (A, N, 8) states of base_link; the tyre angle stays what it was."""
    instants, _, count, _ = tracks.poses.shape
    joints, rates = np.zeros((2, instants * count, 4))
    joints[:, :3] = tracks.poses[:, 0].reshape(-1, 3)
    joints[:, 3] = np.tile(start[:, 6], instants)
    rates[:, :3] = tracks.velocities[:, 0].reshape(-1, 3)
    states = base_from_cog(vehicle, joints, rates, np.zeros((instants * count, 8)))
    states = states.reshape(instants, count, 8).transpose(1, 0, 2).copy()
    states[:, 1:, 7] = np.diff(states[:, :, 3], axis=1) / step_s
    states[:, 0, 7] = start[:, 7]
    return states
