"""Tracking of trajectories in time and space: where a car should be, when, and how fast."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.driver_model import HOLD_MPS2, HOLD_SPEED_MPS, MAX_DECEL_MPS2
from foretwin.sim_worker.planner_interface import PlannerOutput, PlannerView
from foretwin.sim_worker.planners.tracking import lookahead_m, steer_towards
from foretwin.sim_worker.vehicle.resistance import resistance_mps2

_NEAR_S = 3.0
"""A car is looked for on its trajectory within this time of where it should be."""
_POSITION_GAIN, _SPEED_GAIN = 0.6, 1.5
"""1/s², 1/s: critically damped."""
_MAX_ACCEL_MPS2 = 4.0
"""Chosen: more than cars have, so that whose trajectory it is decides."""


class Trajectories(NamedTuple):
    """For each of S cars, or with a leading axis of 1 for all: N instants of base_link.

    `time_s` (S, N) rises; `xy_m` (S, N, 2), `yaw_rad` and `speed_mps` (S, N) in the World's frame.
    """

    time_s: Array
    xy_m: Array
    yaw_rad: Array
    speed_mps: Array


def check_trajectories(trajectories: Trajectories) -> None:
    """Raise ValueError in words for shapes that differ, no numbers, or times that do not rise."""
    time = trajectories.time_s
    if time.ndim != 2 or time.shape[1] < 2:
        raise ValueError(f"a trajectory needs two or more instants, not shape {time.shape}")
    for name, values in zip(trajectories._fields, trajectories, strict=True):
        wanted = (*time.shape, 2) if name == "xy_m" else time.shape
        if values.shape != wanted:
            raise ValueError(f"{name} of shape {values.shape}, not {wanted}")
        if not np.isfinite(values).all():
            raise ValueError(f"{name} holds what is no number")
    if not (np.diff(time, axis=1) > 0.0).all():
        raise ValueError("time_s does not rise")


def track(view: PlannerView, trajectories: Trajectories, *, time_s: Array | float) -> PlannerOutput:
    """Return commands that lead S cars along their trajectories, on which it is `time_s` now.

    Along it: the trajectory's acceleration, and what makes up for being late or slow. Across:
    pure pursuit of the trajectory's line, prolonged by the path ahead.
    """
    count = len(view.arc_m)
    line = _Line(trajectories, count)
    now = np.broadcast_to(np.asarray(time_s, dtype=np.float64), (count,))
    late_m, speed, accel = line.schedule(now)
    own_arc, aside = line.place_of(view.states[:, :2], now)
    late_m = late_m - own_arc
    present = view.states[:, 3]
    wanted = accel + _POSITION_GAIN * late_m + _SPEED_GAIN * (speed - present)
    wanted = np.minimum(np.maximum(wanted, -MAX_DECEL_MPS2), _MAX_ACCEL_MPS2)
    hold = (
        (np.abs(present) < HOLD_SPEED_MPS) & (speed < HOLD_SPEED_MPS) & (wanted <= HOLD_SPEED_MPS)
    )
    command = np.where(
        hold, HOLD_MPS2, wanted + resistance_mps2(view.vehicle, present, view.climb_mps2)
    )
    goal = line.point_at(own_arc + lookahead_m(present, aside), view)
    return PlannerOutput(command, steer_towards(view, goal))


class _Line:
    """The trajectories as lines in space, by arc length."""

    def __init__(self, trajectories: Trajectories, count: int) -> None:
        def rows(values: Array) -> Array:
            return np.broadcast_to(values, (count, *values.shape[1:]))

        self._time, self._speed = rows(trajectories.time_s), rows(trajectories.speed_mps)
        self._xy, self._yaw = rows(trajectories.xy_m), rows(trajectories.yaw_rad)
        steps = np.diff(trajectories.xy_m, axis=1)
        length = np.hypot(steps[..., 0], steps[..., 1])
        arc = np.concatenate([np.zeros_like(length[:, :1]), np.cumsum(length, axis=1)], axis=1)
        self._steps, self._length, self._arc = rows(steps), rows(length), rows(arc)
        self._row = np.arange(count)
        self._segments = self._length.shape[1]

    def schedule(self, time_s: Array) -> tuple[Array, Array, Array]:
        """Return (S,) arc length, speed and acceleration at a time; before and after: at rest in
        time, so that the ends hold."""
        before = (self._time <= time_s[:, None]).sum(axis=1) - 1
        k = np.minimum(np.maximum(before, 0), self._segments - 1)
        row = self._row
        span = self._time[row, k + 1] - self._time[row, k]
        share = np.minimum(np.maximum((time_s - self._time[row, k]) / span, 0.0), 1.0)
        gain = self._speed[row, k + 1] - self._speed[row, k]
        # With the speeds of both ends, the way within a segment is no longer linear in time.
        ends = self._speed[row, k] + self._speed[row, k + 1]
        bent = np.where(np.abs(ends) > 0.1, gain / np.where(np.abs(ends) > 0.1, ends, 1.0), 0.0)
        way = share * (1.0 - bent * (1.0 - share))
        arc = self._arc[row, k] + way * self._length[row, k]
        return arc, self._speed[row, k] + share * gain, gain / span

    def place_of(self, xy_m: Array, time_s: Array) -> tuple[Array, Array]:
        """Return (S,) the arc length nearest to positions, among instants near a time, and how
        far away that is."""
        away = np.square(self._xy - xy_m[:, None]).sum(axis=2)
        near = np.abs(self._time - time_s[:, None]) <= _NEAR_S
        near |= ~near.any(axis=1, keepdims=True)
        nearest = np.where(near, away, np.inf).argmin(axis=1)
        best, best_arc = np.full(len(xy_m), np.inf), np.zeros(len(xy_m))
        for k in (nearest - 1, nearest):
            k = np.minimum(np.maximum(k, 0), self._segments - 1)
            start, step = self._xy[self._row, k], self._steps[self._row, k]
            length = self._length[self._row, k]
            along = ((xy_m - start) * step).sum(axis=1) / np.maximum(length, 1e-6) ** 2
            along = np.minimum(np.maximum(along, 0.0), 1.0)
            distance = np.square(start + along[:, None] * step - xy_m).sum(axis=1)
            arc = self._arc[self._row, k] + along * length
            best_arc = np.where(distance < best, arc, best_arc)
            best = np.minimum(best, distance)
        return best_arc, np.sqrt(best)

    def point_at(self, arc_m: Array, view: PlannerView) -> Array:
        """Return points (S, 2) at arc lengths; beyond the end, along the path beside it."""
        k = (self._arc[:, :-1] <= arc_m[:, None]).sum(axis=1) - 1
        k = np.minimum(np.maximum(k, 0), self._segments - 1)
        length = self._length[self._row, k]
        share = (arc_m - self._arc[self._row, k]) / np.maximum(length, 1e-6)
        share = np.minimum(np.maximum(share, 0.0), 1.0)[:, None]
        point = self._xy[self._row, k] + share * self._steps[self._row, k]
        beyond = arc_m - self._arc[:, -1]
        if (beyond > 0.0).any():
            end = view.path.locate(self._xy[:, -1], near_arc_m=view.arc_m + arc_m - beyond)
            onward = view.path.point_at(end.arc_m + beyond, end.offset_m)
            point = np.where((beyond > 0.0)[:, None], onward, point)
        return np.asarray(point)
