"""Passed, failed or not observable: a few seconds of motion, simulated or driven, by criteria."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.analysis.agreement.doubt import WorldDoubt, place_doubt
from foretwin.sim_worker.analysis.agreement.jolts import SELDOM_S, gently
from foretwin.sim_worker.analysis.agreement.judgement import Judgement, VerdictWord, word
from foretwin.sim_worker.analysis.agreement.stop_lines import at_lights, at_signs
from foretwin.sim_worker.analysis.agreement.window import Users, Window
from foretwin.sim_worker.metrics.ground import DrivableGround
from foretwin.sim_worker.metrics.impact import minimum_clearance
from foretwin.sim_worker.metrics.progress import on_road
from foretwin.sim_worker.metrics.rollout import Context, Rollout, RolloutView
from foretwin.sim_worker.metrics.route_rules import RouteRules

CRITERIA = ("clearance", "drivable_area", "red_light", "stop_line", "comfort")
LEAST_CLEARANCE_M = 0.2
"""Nearer to another road user is a failure; boxes as detected are no more exact than that."""
_PRECISE_M, _NEAR_M = 0.5, 1.0
"""Positions of such standard deviations tell whether a car is on the road, or crosses a line."""


class CriteriaEvaluator:
    """Judges motion through one window, by the World and the path that `rules` are of."""

    def __init__(
        self, window: Window, rules: RouteRules, doubt: WorldDoubt, vehicle: VehicleParameters
    ) -> None:
        self._window, self._rules, self._doubt, self._vehicle = window, rules, doubt, vehicle
        self._place = place_doubt(window, vehicle)
        self._placed = bool(np.isfinite(self._place.position_std_m))
        self._lines = [
            (line, doubt.line_ahead_m(line.line_id, self._place))
            for line in rules.lines
            if self._placed
        ]

    @functools.cached_property
    def asked(self) -> Flags:
        """(5,) which of `CRITERIA` reality has the means to answer here."""
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
                inside and std_m <= _PRECISE_M and self._on_what_is_drawn,
                lights and std_m <= _NEAR_M,
                signs and std_m <= _NEAR_M,
                window.state_period_s <= SELDOM_S and bool(np.isfinite(window.driven_std).all()),
            ]
        )

    @property
    def _on_what_is_drawn(self) -> bool:
        """Whether the World holds what the car drives on: no yards, no streets closed to cars."""
        if self._doubt.exact:
            return True
        began = np.repeat(self._window.driven[None, :1], len(self._window.time_s), axis=1)
        return not (self._window.closed_road or self._surely_off(began)[0])

    def judge(self, states: Array, users: Users, *, std: Array | None = None) -> Judgement:
        """Judge motions (S, N, 8) among `users` by `CRITERIA`, (S, 5).

        `std` (N, 2) are the standard deviations of speed and yaw where these were estimated.
        """
        count = len(states)
        poses, speeds, sizes = (np.broadcast_to(part, (count, *part.shape)) for part in users)
        valid = np.ones(count, dtype=bool)
        rollout = Rollout(self._window.time_s, states, poses, speeds, sizes, valid, self._vehicle)
        view = RolloutView(rollout, Context(ground=self._doubt.drawn))
        near = minimum_clearance(view).values < LEAST_CLEARANCE_M
        drawn = on_road(view).values > 0.5
        off = np.zeros(count, dtype=bool)
        if not drawn.all():
            off[~drawn] = self._surely_off(states[~drawn])
        red = at_lights(view, self._lines, self._window.heard, self._window.stamp_ns)
        unstopped, jolts = at_signs(view, self._lines), gently(view, std)
        return Judgement(
            np.column_stack([~near, drawn, red.passes, unstopped.passes, jolts.passes]),
            np.column_stack([near, off, red.fails, unstopped.fails, jolts.fails]),
        )

    def _surely_off(self, states: Array) -> Flags:
        """Return (S,) whether cars leave all ground that there may be, wherever the antenna is."""
        off = np.full(len(states), self._placed)
        if not self._placed:
            return off
        most = self._doubt.ground_at_most(self._place)
        for ahead_m in self._place.ahead_m:
            off[off] = ~self._stays(states[off], ahead_m, most)
        return off

    def _stays(self, states: Array, ahead_m: float, ground: DrivableGround) -> Flags:
        count, instants = states.shape[:2]
        moved = states.copy()
        moved[..., 0] += ahead_m * np.cos(states[..., 2])
        moved[..., 1] += ahead_m * np.sin(states[..., 2])
        nobody = np.zeros((count, instants, 0, 3)), np.zeros((count, instants, 0))
        alone = Rollout(
            self._window.time_s, moved, *nobody, np.zeros((count, 0, 2)),
            np.ones(count, dtype=bool), self._vehicle,
        )  # fmt: skip
        return np.asarray(on_road(RolloutView(alone, Context(ground=ground))).values > 0.5)


class Verdicts(NamedTuple):
    """Both sides of a window, each criterion (5,) of those that reality was `asked`."""

    asked: Flags
    simulated: Judgement
    driven: Judgement

    @property
    def observable(self) -> Flags:
        """(5,) of which criteria reality tells whether they were kept."""
        return self.driven.passes | self.driven.fails

    @property
    def simulated_word(self) -> VerdictWord:
        """What becomes of the simulation."""
        return self._word(self.simulated)

    @property
    def driven_word(self) -> VerdictWord:
        """What became of the drive."""
        return self._word(self.driven)

    def _word(self, side: Judgement) -> VerdictWord:
        """Return failed where a criterion was, else not observable where one that was asked is."""
        kept = bool(self.asked.any()) and bool(side.passes[self.asked].all())
        return word(kept, bool(side.fails.any()))


def verdicts(window: Window, evaluator: CriteriaEvaluator) -> Verdicts:
    """Judge both sides of a window; what reality cannot answer is counted on neither."""
    asked = evaluator.asked
    sides = [
        evaluator.judge(window.simulated[None], window.simulated_users),
        evaluator.judge(window.driven[None], window.driven_users, std=window.driven_std),
    ]
    simulated, driven = (Judgement(*(flags[0] & asked for flags in side)) for side in sides)
    return Verdicts(asked, simulated, driven)
