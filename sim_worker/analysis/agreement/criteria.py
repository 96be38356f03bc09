"""Pass or fail of a few seconds of motion, simulated or driven, by the same criteria."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Stamps
from foretwin.contracts.drive import SignalColour
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.polyline import arc_lengths
from foretwin.sim_worker.driver_model import STANDING_MPS
from foretwin.sim_worker.metrics.ground import DrivableGround
from foretwin.sim_worker.metrics.rollout import Context, Rollout, RolloutView
from foretwin.sim_worker.metrics.route_rules import LineAhead, RouteRules
from foretwin.sim_worker.metrics.table import METRICS
from foretwin.sim_worker.metrics.violations import STOPS, line_crossings

CRITERIA = ("clearance", "drivable_area", "red_light", "stop_line", "comfort")
LEAST_CLEARANCE_M = 0.2
"""Nearer to another road user is a failure; boxes as detected are no more exact than that."""
_STOP_WITHIN_M = 6.0
"""A car that stands within so much before a stop line has stopped for it."""
_HEARD_FOR_NS = 2_000_000_000
_PRECISE_M, _NEAR_M = 0.5, 1.0
"""Positions of such standard deviations tell whether a car is on the road, or crosses a line."""


class Users(NamedTuple):
    """Other road users at N instants: `poses` (N, R, 3), NaN where one is not there, speeds (N, R),
    length and width (R, 2)."""

    poses: Array
    speed_mps: Array
    size_m: Array


class Heard(NamedTuple):
    """What a signal group was heard to show: stamps (M,), rising, and colours."""

    stamps_ns: Stamps
    colours: tuple[SignalColour, ...]


class Window(NamedTuple):
    """The same seconds simulated and driven, in one World: states (N, 8) at `time_s` (N,).

    `known_users` says whether the car reported road users throughout; `position_std_m` is the
    greatest while it drove, None where unknown.
    """

    round_id: int
    stamp_ns: int
    junction_id: str
    world_id: str
    time_s: Array
    simulated: Array
    simulated_users: Users
    driven: Array
    driven_users: Users
    path_xy_m: Array
    heard: Mapping[str, Heard]
    known_users: bool
    position_std_m: float | None


class CriteriaEvaluator:
    """Judges motion through one window, by the World and the path that `rules` are of."""

    def __init__(
        self, window: Window, rules: RouteRules, ground: DrivableGround, vehicle: VehicleParameters
    ) -> None:
        self._window, self._rules, self._ground, self._vehicle = window, rules, ground, vehicle

    @property
    def observable(self) -> Flags:
        """(5,) whether reality shows what becomes of each of `CRITERIA`."""
        window, lines = self._window, self._rules.lines
        std_m = np.inf if window.position_std_m is None else window.position_std_m
        reach_m = self._rules.world.radius_m - self._vehicle.length_m.value
        ways = np.concatenate([window.simulated[:, :2], window.driven[:, :2]])
        inside = bool((np.hypot(*ways.T) < reach_m).all())
        lights = any(line.group_id in window.heard for line in lines if line.control == "signal")
        signs = any(line.control == "stop" for line in lines)
        return np.array(
            [
                window.known_users,
                inside and std_m <= _PRECISE_M,
                lights and std_m <= _NEAR_M,
                signs and std_m <= _NEAR_M,
                True,
            ]
        )

    def failures(self, states: Array, users: Users) -> Flags:
        """Return (S, 5) which of `CRITERIA` motions (S, N, 8) among `users` fail."""
        count = len(states)
        poses, speeds, sizes = (np.broadcast_to(part, (count, *part.shape)) for part in users)
        valid = np.ones(count, dtype=bool)
        rollout = Rollout(self._window.time_s, states, poses, speeds, sizes, valid, self._vehicle)
        view = RolloutView(rollout, Context(ground=self._ground))
        red, unstopped = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
        for line in self._rules.lines:
            if line.control == "signal":
                self._at_red(view.front_m, line, red)
            elif line.control == "stop":
                self._without_stop(view.front_m, line, view.speed_mps, unstopped)
        return np.column_stack(
            [
                METRICS["min_clearance"].compute(view).values < LEAST_CLEARANCE_M,
                METRICS["on_road"].compute(view).values < 0.5,
                red,
                unstopped,
                METRICS["comfortable"].compute(view).values < 0.5,
            ]
        )

    def _at_red(self, front: Array, line: LineAhead, red: Flags) -> None:
        heard = self._window.heard.get(line.group_id or "")
        if heard is None:
            return
        future, time_s = line_crossings(front, line.ends_m, self._window.time_s)
        for row, at_s in zip(future, time_s, strict=True):
            stamp_ns = self._window.stamp_ns + round(float(at_s) * 1e9)
            last = int(np.searchsorted(heard.stamps_ns, stamp_ns, side="right")) - 1
            if last >= 0 and stamp_ns - heard.stamps_ns[last] <= _HEARD_FOR_NS:
                red[row] |= heard.colours[last] in STOPS

    def _without_stop(
        self, front: Array, line: LineAhead, speed_mps: Array, unstopped: Flags
    ) -> None:
        """Mark motions that cross a line without standing before it, unless they begin near it."""
        time_s = self._window.time_s
        future, crossed_s = line_crossings(front, line.ends_m, time_s)
        for row, at_s in zip(future, crossed_s, strict=True):
            gone_m = arc_lengths(front[row])
            line_m = float(np.interp(at_s, time_s, gone_m))
            before = (time_s <= at_s) & (gone_m >= line_m - _STOP_WITHIN_M)
            if line_m >= _STOP_WITHIN_M:
                unstopped[row] |= bool(np.abs(speed_mps[row, before]).min() > STANDING_MPS)


class Verdicts(NamedTuple):
    """Both sides of a window: failed criteria (5,) of those that are observable (5,)."""

    observable: Flags
    simulated: Flags
    driven: Flags

    @property
    def simulated_passes(self) -> bool:
        """Whether the simulation fails no criterion."""
        return not bool(self.simulated.any())

    @property
    def driven_passes(self) -> bool:
        """Whether the drive failed no criterion."""
        return not bool(self.driven.any())


def verdicts(window: Window, evaluator: CriteriaEvaluator) -> Verdicts:
    """Judge both sides of a window; what reality does not show is counted on neither."""
    observable = evaluator.observable
    simulated = evaluator.failures(window.simulated[None], window.simulated_users)[0]
    driven = evaluator.failures(window.driven[None], window.driven_users)[0]
    return Verdicts(observable, simulated & observable, driven & observable)
