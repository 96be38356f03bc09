"""Quintic curves by the five control vectors of their derivatives (Bézier): points and bends.

The headings of a curve lie between those of its vectors, as its derivatives are weighted sums of
these; and it turns no farther than they do from one to the next.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import cross, left_of, turn_rad

_DEGREE = 4


class Motion(NamedTuple):
    """Derivatives (P, K, 2) of curves by their parameter, their lengths and curvatures (P, K)."""

    velocity: Array
    speed: Array
    curvature_pm: Array


def control_vectors(
    gap: Array, velocity: Array, end_velocity: Array, bend_pm: Array, end_bend_pm: Array
) -> Array:
    """Return (5, K, 2) the vectors of curves that go on by `gap` (K, 2).

    They begin and end with velocities (K, 2) per parameter, and with curvatures (K,).
    """
    pace2, end_pace2 = (velocity**2).sum(axis=1), (end_velocity**2).sum(axis=1)
    # Of what a curve's second derivative is, the curvature asks for the part across.
    pace, end_pace = np.sqrt(pace2), np.sqrt(end_pace2)
    second = velocity + (bend_pm * pace / _DEGREE)[:, None] * left_of(velocity)
    fourth = end_velocity - (end_bend_pm * end_pace / _DEGREE)[:, None] * left_of(end_velocity)
    middle = (_DEGREE + 1) * gap - velocity - second - fourth - end_velocity
    return np.stack([velocity, second, middle, fourth, end_velocity])


def turned_rad(vectors: Array) -> Array:
    """Return (K,) how far curves turn at most, to and fro added up."""
    return np.asarray(np.abs(turn_rad(vectors[:-1], vectors[1:])).sum(axis=0))


def displacements(vectors: Array, at: Array) -> Array:
    """Return where curves lie from their starts: `vectors` (5, M, 2), `at` (M,) from 0 to 1."""
    powers = _bernstein(at, _DEGREE + 1)
    integrals = np.cumsum(powers[:0:-1], axis=0)[::-1] / (_DEGREE + 1)
    return np.asarray(np.einsum("im,imc->mc", integrals, vectors))


def motion(vectors: Array, at: Array) -> Motion:
    """Return how K curves go on, all at P places: `vectors` (5, K, 2), `at` (P,) from 0 to 1."""
    velocity = np.einsum("ip,ikc->pkc", _bernstein(at, _DEGREE), vectors)
    change = np.einsum("ip,ikc->pkc", _bernstein(at, _DEGREE - 1), np.diff(vectors, axis=0))
    speed = np.maximum(np.hypot(velocity[..., 0], velocity[..., 1]), 1e-6)
    return Motion(velocity, speed, np.asarray(_DEGREE * cross(velocity, change) / speed**3))


def _bernstein(at: Array, degree: int) -> Array:
    """Return the Bernstein polynomials of a degree, (degree + 1, M)."""
    n = np.arange(degree + 1)[:, None]
    scale = np.array([math.comb(degree, i) for i in range(degree + 1)])[:, None]
    return np.asarray(scale * at**n * (1.0 - at) ** (degree - n))
