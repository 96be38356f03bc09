"""Jerk-optimal motions in one dimension: quintic to a place, quartic to a speed.

Takahashi, Hongo, Ninomiya, Sugimoto (1989), Local path planning and motion control for AGV in
positioning; as used by Werling, Ziegler, Kammel, Thrun (2010), Optimal trajectory generation for
dynamic street scenarios in a Frenet frame.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Indices

Floats = npt.NDArray[np.floating]
"""In double precision where a car follows them, in single precision where they are rated."""


class Motions(NamedTuple):
    """Polynomials of time: `coefficients` (6, …), lowest first, that hold until `end_s` (…)."""

    coefficients: Floats
    end_s: Floats

    def of(self, *places: Indices | slice) -> Motions:
        """Return those at places along the axes (…)."""
        return Motions(self.coefficients[:, *places], self.end_s[*places])

    def place_at(self, time_s: Floats) -> Floats:
        """Return places at times that broadcast against (…); see `at`."""
        c, t = self.coefficients, np.minimum(time_s, self.end_s)
        place = c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * (c[4] + t * c[5]))))
        late = time_s - t
        if late.any():
            place = place + late * self.speed_at(t)
        return np.asarray(place)

    def speed_at(self, time_s: Floats) -> Floats:
        """Return speeds at times that broadcast against (…); see `at`."""
        c, t = self.coefficients, np.minimum(time_s, self.end_s)
        bends = 3.0 * c[3] + t * (4.0 * c[4] + t * (5.0 * c[5]))
        return np.asarray(c[1] + t * (2.0 * c[2] + t * bends))

    def at(self, time_s: Floats) -> tuple[Floats, Floats, Floats]:
        """Return place, speed and acceleration at times that broadcast against (…).

        After the end they go on at the end's speed.
        """
        c, t = self.coefficients, np.minimum(time_s, self.end_s)
        place, speed, accel = c[5], 5.0 * c[5], 20.0 * c[5]
        for k in (4, 3, 2, 1, 0):
            place = place * t + c[k]
            if k > 0:
                speed = speed * t + float(k) * c[k]
            if k > 1:
                accel = accel * t + float(k * (k - 1)) * c[k]
        late = time_s - t
        return place + late * speed, speed, accel * (late <= 0.0)

    def jerk_at(self, time_s: Floats) -> Floats:
        """Return the jerk at times, zero after the end."""
        c = self.coefficients
        jerk = 6.0 * c[3] + time_s * (24.0 * c[4] + time_s * (60.0 * c[5]))
        return np.asarray(jerk * (time_s <= self.end_s))


def to_speed(
    place: Floats, speed: Floats, accel: Floats, *, end_speed: Floats, end_s: Floats
) -> Motions:
    """Return quartic motions that reach a speed, without acceleration, after `end_s`."""
    shape = np.broadcast_shapes(place.shape, end_speed.shape, end_s.shape)
    c, t = np.empty((6, *shape)), np.broadcast_to(end_s, shape)
    gain, ease = (end_speed - speed - accel * t) / t, -accel
    c[0], c[1], c[2] = place, speed, 0.5 * accel
    c[3] = (gain - ease / 3.0) / t
    c[4] = (0.25 * ease - 0.5 * gain) / (t * t)
    c[5] = 0.0
    return Motions(c, t)


def to_place(
    place: Floats,
    speed: Floats,
    accel: Floats,
    *,
    end_place: Floats,
    end_speed: Floats,
    end_s: Floats,
) -> Motions:
    """Return quintic motions that reach a place at a speed, without acceleration, after `end_s`."""
    shape = np.broadcast_shapes(place.shape, end_place.shape, end_speed.shape, end_s.shape)
    c, t = np.empty((6, *shape)), np.broadcast_to(end_s, shape)
    square = t * t
    cube = square * t
    ease = -accel * square
    way = end_place - place - speed * t + 0.5 * ease
    gain = (end_speed - speed) * t + ease
    ease = 0.5 * ease
    c[0], c[1], c[2] = place, speed, 0.5 * accel
    c[3] = (10.0 * way - 4.0 * gain + ease) / cube
    c[4] = (7.0 * gain - 15.0 * way - 2.0 * ease) / (square * square)
    c[5] = (6.0 * way - 3.0 * gain + ease) / (cube * square)
    return Motions(c, t)


def braked(place: Floats, speed: Floats, *, decel: float) -> Motions:
    """Return motions that brake evenly from now on until they stand; their jerk is not told."""
    c = np.zeros((6, *np.broadcast_shapes(place.shape, speed.shape)))
    c[0], c[1], c[2] = place, speed, -0.5 * decel
    return Motions(c, np.broadcast_to(speed / decel, c.shape[1:]))


def joined(*parts: Motions) -> Motions:
    """Return several sets of motions as one, along the last axis, that of candidates."""
    return Motions(
        np.concatenate([part.coefficients for part in parts], axis=-1),
        np.concatenate([part.end_s for part in parts], axis=-1),
    )
