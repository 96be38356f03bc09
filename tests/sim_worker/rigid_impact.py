"""Planar impact of two rigid bodies at one point, in closed form.

Brach (1983), Analysis of planar vehicle collisions using equations of impulse and momentum,
Accident Analysis and Prevention 15; without an impulse of moment.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array


class Body(NamedTuple):
    """Mass, yaw inertia, centre of gravity (2,) and velocity (3,) with the yaw rate last."""

    mass_kg: float
    yaw_inertia_kgm2: float
    centre_m: Array
    velocity: Array


def impact(
    one: Body, other: Body, *, point_m: Array, normal: Array, restitution: float, friction: float
) -> tuple[Array, Array]:
    """Return the velocities (3,) of both after the impact; `normal` points from one to other.

    The tangential impulse is what ends sliding, or friction times the normal one if that is less.
    """
    tangent = np.array([-normal[1], normal[0]])
    axes = np.stack([normal, tangent])
    mobility, sliding = np.zeros((2, 2)), np.zeros(2)
    for body, sign in ((one, 1.0), (other, -1.0)):
        arm = point_m - body.centre_m
        turn = axes @ np.array([-arm[1], arm[0]])
        mobility += np.eye(2) / body.mass_kg + np.outer(turn, turn) / body.yaw_inertia_kgm2
        sliding += sign * (axes @ body.velocity[:2] + turn * body.velocity[2])
    wanted = np.array([-restitution * sliding[0], 0.0]) - sliding
    impulse = np.linalg.solve(mobility, wanted)
    if abs(impulse[1]) > friction * abs(impulse[0]):
        # Against the sliding: the impulse on `one` along the normal is negative.
        ratio = friction * np.sign(sliding[1])
        normal_impulse = wanted[0] / (mobility[0, 0] + mobility[0, 1] * ratio)
        impulse = normal_impulse * np.array([1.0, ratio])
    after = []
    for body, sign in ((one, 1.0), (other, -1.0)):
        arm = point_m - body.centre_m
        push = sign * impulse @ axes
        spin = (arm[0] * push[1] - arm[1] * push[0]) / body.yaw_inertia_kgm2
        after.append(body.velocity + np.array([*(push / body.mass_kg), spin]))
    return after[0], after[1]
