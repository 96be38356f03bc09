"""Two cars whose ways cross, as they really drive: the truth that a verdict is held against."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.rectangles import Rectangles, clearance
from foretwin.sim_worker.batch.collision_detection import ego_rectangles, first_touches
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m

TRUTH_S = 0.001


class Drive(NamedTuple):
    """One that comes to the crossing point at `at_s`, in a bend, with a speed that swings."""

    at_s: float
    yaw_rad: float
    speed_mps: float
    curvature_pm: float
    swing_mps: float
    aside_m: float = 0.0

    def poses(self, time_s: Array) -> Array:
        """Return (N, 3) poses of base_link at times (N,)."""
        along = self._along(time_s)
        turned = self.curvature_pm * along
        # The chord of an arc, so that a straight one needs no case of its own.
        chord = along * np.sinc(turned / (2.0 * np.pi))
        towards = self.yaw_rad + turned / 2.0
        x = chord * np.cos(towards) - self.aside_m * np.sin(self.yaw_rad)
        y = chord * np.sin(towards) + self.aside_m * np.cos(self.yaw_rad)
        return np.stack([x, y, self.yaw_rad + turned], axis=1)

    def _along(self, time_s: Array) -> Array:
        left = time_s - self.at_s
        return self.speed_mps * left + self.swing_mps * (1.0 - np.cos(left))

    def speeds(self, time_s: Array) -> Array:
        """Return (N,) speeds."""
        return self.speed_mps + self.swing_mps * np.sin(time_s - self.at_s)

    def accels(self, time_s: Array) -> Array:
        """Return (N,) accelerations."""
        return self.swing_mps * np.cos(time_s - self.at_s)


def drawn(random: np.random.Generator) -> tuple[Drive, Drive]:
    """Return two that come to the crossing point at about one time: some touch, some do not."""
    a, b = (
        Drive(
            at_s=4.0 + random.uniform(-1.0, 1.0),
            yaw_rad=random.uniform(-np.pi, np.pi),
            speed_mps=random.uniform(4.0, 14.0),
            curvature_pm=random.uniform(-0.03, 0.03),
            swing_mps=random.uniform(-2.0, 2.0),
            aside_m=random.uniform(-2.0, 2.0),
        )
        for _ in range(2)
    )
    return a, b


class Met(NamedTuple):
    """What those say who see both at one place."""

    touched: bool
    least_m: float


def co_located(
    one: VehicleParameters,
    a: Drive,
    other: VehicleParameters,
    b: Drive,
    *,
    from_s: float = 0.0,
    to_s: float = 8.0,
) -> Met:
    """Return the verdict of `first_touches` and the clearance, every millisecond."""
    time_s = np.arange(from_s, to_s, TRUTH_S)
    mine, theirs = a.poses(time_s), b.poses(time_s)
    states = np.zeros((1, len(time_s), 8))
    states[0, :, :3] = mine
    ahead = box_centre_from_base_m(other)
    users = theirs.copy()
    users[:, 0] += ahead * np.cos(theirs[:, 2])
    users[:, 1] += ahead * np.sin(theirs[:, 2])
    size = np.array([[[other.length_m.value, other.width_m.value]]])
    touches = first_touches(one, states, users[None, :, None], size, tick_s=TRUTH_S)
    outline = Rectangles(users[:, :2], users[:, 2], *size[0, 0])
    apart = clearance(ego_rectangles(one, states[0]), outline)
    return Met(bool(len(touches.future)), float(apart.min()))
