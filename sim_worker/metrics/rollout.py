"""What metrics are computed from: S futures of N instants with R other road users each.

What many metrics share of a rollout, outlines and all road users as the ego sees them, is computed
when first asked for and kept, so that metrics can be picked one by one.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeVar

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.futures import STATE_COLUMNS
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.metrics.ground import DrivableGround
from foretwin.sim_worker.metrics.lane_areas import LaneAreas
from foretwin.sim_worker.metrics.route_rules import RouteRules
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m
from foretwin.world_gen.rules.signal_state import HeardCycle, LiveColour

_Kept = TypeVar("_Kept")
_FUTURES_AT_ONCE = 8
_BACKS_MPS = 0.05
"""An ego that goes backwards more slowly stands: nuPlan, no_ego_at_fault_collisions."""
_FAR_M = 1e6
"""Where an absent road user is put: out of reach of every metric, yet a number."""


class Rollout(NamedTuple):
    """Simulated or recorded motion, all in one plane frame.

    `time_s` (N,); `states` (S, N, 8) of base_link as `futures.STATE_COLUMNS`; `users`
    (S, N, R, 3) x, y, yaw of box centres, NaN where a road user is not there; `user_speed_mps`
    (S, N, R) along their yaw; `user_size_m` (S, R, 2) length and width; `valid` (S,) false where
    the simulation diverged or its planner failed. A future ends at its instant `last` (S,), where
    it hits a road user: after it the ego stays where it is and is alone.
    """

    time_s: Array
    states: Array
    users: Array
    user_speed_mps: Array
    user_size_m: Array
    valid: Flags
    vehicle: VehicleParameters
    last: Indices | None = None


class Measure(NamedTuple):
    """A metric's values (S,), or (S, N) where it says so, NaN wherever `valid` is false."""

    values: Array
    valid: Flags


class Context(NamedTuple):
    """What a rollout is judged against; a metric that needs what is None is not computed.

    `reference` (N, 3) holds base_link poses at the rollout's instants, NaN where unknown;
    `user_mass_kg` (S, R) the road users' masses. `start_s` is the drive time
    of the rollout's time 0, at which signal plans are read, `live` what signals were heard, and
    `learnt` the cycles that they repeat, in the rollout's time.
    """

    path: FrenetPath | None = None
    ground: DrivableGround | None = None
    rules: RouteRules | None = None
    lanes: LaneAreas | None = None
    reference: Array | None = None
    user_mass_kg: Array | None = None
    start_s: float = 0.0
    live: Mapping[str, LiveColour] | None = None
    learnt: Mapping[str, HeardCycle] = {}


class Relative(NamedTuple):
    """Road users in the axes of the ego's box at the same instant, all (S, N, R).

    Positions of centres `ahead_m`, `left_m`; relative yaw as `cos` and `sin`; velocities relative
    to the ego's `ahead_mps`, `left_mps`; `speed_mps` of the road users over ground.
    """

    ahead_m: Array
    left_m: Array
    cos: Array
    sin: Array
    ahead_mps: Array
    left_mps: Array
    speed_mps: Array


class RolloutView:
    """One rollout and what it is judged against. Raises ValueError for shapes that do not fit."""

    def __init__(self, rollout: Rollout, context: Context | None = None) -> None:
        _check(rollout)
        self.rollout = rollout
        self.context = context or Context()
        states = np.asarray(rollout.states, dtype=np.float64)
        whole = np.isfinite(states).all(axis=(1, 2))
        self.valid: Flags = np.asarray(rollout.valid, dtype=bool) & whole
        """(S,) whether a future was simulated to its end."""
        self.all_valid = bool(self.valid.all())
        self.driven = states if self.all_valid else np.where(self.valid[:, None, None], states, 0.0)
        """States (S, N, 8) as simulated, beyond the end of a future too."""
        self.states = self.driven
        self.counts: Flags | None = None
        """Which instants (S, N) come before the end of a future; None where all do."""
        if rollout.last is not None:
            instants = np.arange(states.shape[1])
            self.counts = instants <= rollout.last[:, None]
            held = np.minimum(instants, rollout.last[:, None])
            self.states = np.take_along_axis(self.driven, held[..., None], axis=1)
        self.time_s = np.asarray(rollout.time_s, dtype=np.float64)
        vehicle = rollout.vehicle
        self.half_m = (vehicle.length_m.value / 2.0, vehicle.width_m.value / 2.0)
        self.half_length_m, self.half_width_m = self.half_m
        self.centre_ahead_m = box_centre_from_base_m(vehicle)
        """How far the middle of the ego's box lies ahead of base_link."""
        self._kept: dict[Callable[[RolloutView], Any], Any] = {}

    def keep(self, compute: Callable[[RolloutView], _Kept]) -> _Kept:
        """Return `compute(self)`, computed once: for what several metrics have in common."""
        if compute not in self._kept:
            self._kept[compute] = compute(self)
        kept: _Kept = self._kept[compute]
        return kept

    def measure(self, values: Array, valid: Flags | None = None) -> Measure:
        """Return `values` (S, …) as a Measure, NaN where a future, or `valid` (S, …), is not."""
        if valid is None:
            valid = np.ones(values.shape, dtype=bool)
            if self.all_valid:
                return Measure(np.array(values, dtype=np.float64), valid)
        if not self.all_valid:
            valid = valid & self.valid.reshape((-1,) + (1,) * (values.ndim - 1))
        return Measure(np.where(valid, values, np.nan), valid)

    @functools.cached_property
    def blocks(self) -> tuple[slice, ...]:
        """Futures a few at a time, so that what is computed of all road users stays in the cache:
        fresh memory for all at once takes longer than the arithmetic."""
        return tuple(
            slice(first, first + _FUTURES_AT_ONCE)
            for first in range(0, len(self.valid), _FUTURES_AT_ONCE)
        )

    @functools.cached_property
    def heading(self) -> tuple[Array, Array]:
        """Cosine and sine (S, N) of the ego's yaw."""
        yaw = self.states[..., 2]
        return np.cos(yaw), np.sin(yaw)

    @functools.cached_property
    def centre_m(self) -> Array:
        """(S, N, 2) middles of the ego's box."""
        cos, sin = self.heading
        return np.stack(
            [
                self.states[..., 0] + self.centre_ahead_m * cos,
                self.states[..., 1] + self.centre_ahead_m * sin,
            ],
            axis=-1,
        )

    @functools.cached_property
    def front_m(self) -> Array:
        """(S, N, 2) middles of the ego's front."""
        return self.centre_m + self.half_length_m * np.stack(self.heading, axis=-1)

    @functools.cached_property
    def speed_mps(self) -> Array:
        """(S, N) speed of the ego over ground, negative in reverse."""
        vx, vy = self.states[..., 3], self.states[..., 4]
        return np.asarray(np.copysign(np.hypot(vx, vy), vx))

    @functools.cached_property
    def backs(self) -> Flags:
        """(S, N) whether the ego drives backwards, so that its rear leads."""
        return np.asarray(self.states[..., 3] < -_BACKS_MPS)

    @functools.cached_property
    def trailing_axle_m(self) -> Array:
        """(S, N) how far ahead of base_link its trailing axle is: 0 where it drives forwards."""
        return np.where(self.backs, self.rollout.vehicle.wheelbase_m.value, 0.0)

    @functools.cached_property
    def there(self) -> Flags:
        """(S, N, R) where a road user is on the road."""
        there = np.asarray(np.isfinite(self.rollout.users[..., 0]))
        return there if self.counts is None else there & self.counts[..., None]

    @functools.cached_property
    def users(self) -> tuple[Array, Array, Array, Array]:
        """x, y, yaw and speed (S, N, R) of road users, far away and standing where absent."""
        users = self.rollout.users
        x, y, yaw = (np.array(users[..., k], dtype=np.float64, order="C") for k in range(3))
        speed = np.array(self.rollout.user_speed_mps, dtype=np.float64, order="C")
        if not self.there.all():
            gone = ~self.there
            np.copyto(x, _FAR_M, where=gone)
            for values in (y, yaw, speed):
                np.copyto(values, 0.0, where=gone)
        return x, y, yaw, speed

    @functools.cached_property
    def user_half_m(self) -> tuple[Array, Array]:
        """Half lengths and half widths (S, 1, R) of road users, 0 where unknown."""
        half = np.nan_to_num(np.asarray(self.rollout.user_size_m, dtype=np.float64)) / 2.0
        return half[:, None, :, 0], half[:, None, :, 1]

    @functools.cached_property
    def relative(self) -> Relative:
        """All road users in the ego's axes, far to its left where absent."""
        x, y, yaw, speed = self.users
        found = Relative._make([*(np.empty(x.shape) for _ in range(6)), speed])
        for rows in self.blocks:
            cos, sin = (values[rows, :, None] for values in self.heading)
            centre = self.centre_m[rows]
            dx, dy = x[rows] - centre[..., 0, None], y[rows] - centre[..., 1, None]
            np.add(cos * dx, sin * dy, out=found.ahead_m[rows])
            np.subtract(cos * dy, sin * dx, out=found.left_m[rows])
            turned = yaw[rows] - self.states[rows, :, 2, None]
            along, aside = found.cos[rows], found.sin[rows]
            np.cos(turned, out=along)
            np.sin(turned, out=aside)
            np.multiply(speed[rows], along, out=found.ahead_mps[rows])
            np.multiply(speed[rows], aside, out=found.left_mps[rows])
            found.ahead_mps[rows] -= self.states[rows, :, 3, None]
            found.left_mps[rows] -= self.states[rows, :, 4, None]
        if not self.there.all():
            # Abeam, whichever way the ego looks: far ahead, it would be a leader in the end.
            gone = ~self.there
            np.copyto(found.ahead_m, 0.0, where=gone)
            np.copyto(found.left_m, _FAR_M, where=gone)
        return found

    @functools.cached_property
    def centre_distance_m(self) -> Array:
        """(S, N, R) between the middles of the boxes."""
        seen = self.relative
        distance = np.empty(seen.ahead_m.shape)
        for rows in self.blocks:
            square = np.square(seen.ahead_m[rows], out=distance[rows])
            square += np.square(seen.left_m[rows])
            np.sqrt(square, out=square)
        return distance


def _check(rollout: Rollout) -> None:
    futures, instants = len(rollout.states), len(rollout.time_s)
    users = rollout.user_size_m.shape[1] if rollout.user_size_m.ndim == 3 else -1
    expected = {
        "states": (rollout.states.shape, (futures, instants, len(STATE_COLUMNS))),
        "users": (rollout.users.shape, (futures, instants, users, 3)),
        "user_speed_mps": (rollout.user_speed_mps.shape, (futures, instants, users)),
        "user_size_m": (rollout.user_size_m.shape, (futures, users, 2)),
        "valid": (rollout.valid.shape, (futures,)),
    }
    for name, (found, right) in expected.items():
        if found != right:
            raise ValueError(f"rollout: {name} has shape {found}, expected {right}")
    if instants < 2 or not (np.diff(rollout.time_s) > 0.0).all():
        raise ValueError("rollout: time_s must rise and hold at least two instants")
