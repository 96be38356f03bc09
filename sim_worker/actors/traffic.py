"""Other road users of S futures, up to R in each, moved together along paths of their own.

Their motion along a path is all there is to it: arc length and speed. Law-abiding ones follow
whoever is ahead, stop at red and wait where the World says so; they decide a few times a second,
as people do, and keep the acceleration in between.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from contracts.arrays import Array
from sim_worker.actors.path_table import Indices, PathTable
from sim_worker.actors.right_of_way import PathRules

Flags = npt.NDArray[np.bool_]

TIME_GAP_S, STANDSTILL_GAP_M = 1.2, 2.0
_SIGHT_M = 60.0
_BESIDE_M = 0.3
_CURVE_AHEAD_M = 15.0
_LATERAL_ACCEL_MPS2 = 2.5
_LINE_GAP_M = 1.0
_LAG_S, _LEAD_S = 1.0, 0.5
"""Nobody enters ground that somebody else leaves less than `_LEAD_S` before, or reaches less than
`_LAG_S` after."""
_STANDING_MPS = 0.5


class Crowd(NamedTuple):
    """Who is on the road besides the ego; every field (S, R).

    `path_of` is a place in the `PathTable`; `lateral_m` lies to its left. `desired_mps` is the
    speed on a free road. From `brakes_at_s` on, infinite for most, it brakes by `brakes_by_mps2`.
    `lawful` ones react to others, the rest keep their speed.
    """

    present: Flags
    lawful: Flags
    length_m: Array
    width_m: Array
    path_of: Indices
    lateral_m: Array
    start_arc_m: Array
    start_speed_mps: Array
    desired_mps: Array
    accel_mps2: Array
    decel_mps2: Array
    brakes_at_s: Array
    brakes_by_mps2: Array


class EgoBoxes(NamedTuple):
    """The ego as others see it: box centres (S, 3) x, y, yaw, speeds (S,), places on its path (S,).

    `path_of` is the ego path's place in the table; `arc_m` that of the box centre.
    """

    poses: Array
    speed_mps: Array
    path_of: int
    arc_m: Array
    length_m: float
    width_m: float


class Traffic:
    """The road users of one job; `arc_m`, `speed_mps` (S, R) and `poses` (S, R, 3) are now."""

    def __init__(self, crowd: Crowd, table: PathTable, rules: PathRules) -> None:
        self.crowd, self.table, self._rules = crowd, table, rules
        self.arc_m = crowd.start_arc_m.copy()
        self.speed_mps = np.where(crowd.present, crowd.start_speed_mps, 0.0)
        self.poses = self._placed()
        self._accel = np.zeros_like(self.arc_m)
        self._lawful = np.nonzero(crowd.lawful & crowd.present)
        self._brakes = bool(np.isfinite(crowd.brakes_at_s[crowd.present]).any())
        # One more row and column than paths: who is not there takes the last, and meets nobody.
        self._waits = np.pad(np.isfinite(rules.meetings[..., 0]), (0, 1))
        self._path_there = np.where(crowd.present, crowd.path_of, len(table))
        self.reacts = len(self._lawful[0]) > 0
        """Whether anybody does anything but keep a speed."""

    def _placed(self) -> Array:
        crowd = self.crowd
        poses = self.table.poses(crowd.path_of, self.arc_m, crowd.lateral_m)
        poses[~crowd.present] = np.nan
        return poses

    def begun(self, futures: Indices) -> Traffic:
        """Return traffic (K, R) that begins as that of these futures did."""
        return Traffic(Crowd._make(f[futures] for f in self.crowd), self.table, self._rules)

    def carry_on(self, before: Traffic, futures: Flags) -> None:
        """Let the `futures` (S,) go on from where traffic of the same paths has them."""
        for mine, theirs in (
            (self.arc_m, before.arc_m),
            (self.speed_mps, before.speed_mps),
            (self.poses, before.poses),
            (self._accel, before._accel),
        ):
            mine[futures] = theirs[futures]

    def step(self, *, time_s: float | Array, dt_s: float) -> None:
        """Advance by `dt_s` from `time_s`, one or (S, 1), with what was decided last."""
        crowd = self.crowd
        if self.reacts or self._brakes:
            accel = self._accel
            if self._brakes:
                accel = np.where(time_s >= crowd.brakes_at_s - 1e-9, -crowd.brakes_by_mps2, accel)
            after = np.maximum(self.speed_mps + accel * dt_s, 0.0)
            self.arc_m += 0.5 * (self.speed_mps + after) * dt_s
            self.speed_mps = after
        else:
            self.arc_m += self.speed_mps * dt_s
        self.poses = self._placed()

    def decide(self, ego: EgoBoxes, red_arcs_m: Array) -> None:
        """Let law-abiding road users choose their accelerations; `red_arcs_m` (P, K) of paths, or
        (S, P, K).

        Free road and following: intelligent driver model (Treiber, Hennecke, Helbing 2000, eq. 2
        and 3), the nearest of a leader, a red light and ground to be left to others counting as
        what is ahead.
        """
        s, r = self._lawful
        if not len(s):
            return
        crowd = self.crowd
        mine = _Mine(
            rows=s,
            columns=r,
            arc=self.arc_m[s, r],
            speed=self.speed_mps[s, r],
            path=crowd.path_of[s, r],
            half=0.5 * crowd.length_m[s, r],
            decel=crowd.decel_mps2[s, r],
        )
        gap, lead_speed = self._leader(mine, ego)
        red = red_arcs_m[mine.path] if red_arcs_m.ndim == 2 else red_arcs_m[s, mine.path]
        line = _before(red, mine)
        still = np.minimum(line, self._wait(mine, ego))
        nearer = still < gap
        gap, lead_speed = np.where(nearer, still, gap), np.where(nearer, 0.0, lead_speed)
        most = crowd.accel_mps2[s, r]
        wanted = STANDSTILL_GAP_M * (~nearer) + np.maximum(
            mine.speed * TIME_GAP_S
            + mine.speed * (mine.speed - lead_speed) / (2.0 * np.sqrt(most * mine.decel)),
            0.0,
        )
        free = 1.0 - (mine.speed / np.maximum(self._allowed(mine), 0.1)) ** 4
        accel = most * (free - np.square(wanted / np.maximum(gap, 0.1)))
        self._accel[s, r] = np.clip(accel, -2.0 * mine.decel, most)

    def _allowed(self, mine: _Mine) -> Array:
        """Return the speed that the bend ahead and the own wish allow."""
        bend = np.abs(self._bend(mine))
        curve = np.sqrt(_LATERAL_ACCEL_MPS2 / np.maximum(bend, 1e-6))
        return np.minimum(self.crowd.desired_mps[mine.rows, mine.columns], curve)

    def _bend(self, mine: _Mine) -> Array:
        """Return the mean curvature of the own path over the next metres."""
        here = self.table.poses(mine.path, mine.arc)[:, 2]
        there = self.table.poses(mine.path, mine.arc + _CURVE_AHEAD_M)[:, 2]
        return np.asarray((there - here) / _CURVE_AHEAD_M)

    def _leader(self, mine: _Mine, ego: EgoBoxes) -> tuple[Array, Array]:
        """Return the gap to whoever is ahead in the own lane, infinite for nobody, and its speed.

        Others are looked for beside the parabola that the own path bends along.
        """
        s, r = mine.rows, mine.columns
        crowd = self.crowd
        x, y, yaw = self.poses[s, r].T
        others = np.concatenate([ego.poses[:, None], self.poses], axis=1)[s]
        dx, dy = others[..., 0] - x[:, None], others[..., 1] - y[:, None]
        near = np.square(dx) + np.square(dy) < _SIGHT_M**2
        near[np.arange(len(s)), r + 1] = False
        k, o = np.nonzero(near)
        cos, sin = np.cos(yaw)[k], np.sin(yaw)[k]
        ahead = cos * dx[k, o] + sin * dy[k, o]
        left = cos * dy[k, o] - sin * dx[k, o] - 0.5 * self._bend(mine)[k] * np.square(ahead)
        turned = others[k, o, 2] - yaw[k]
        length = np.concatenate(
            [np.full((len(crowd.length_m), 1), ego.length_m), crowd.length_m], 1
        )
        width = np.concatenate([np.full((len(crowd.width_m), 1), ego.width_m), crowd.width_m], 1)
        along = np.abs(np.cos(turned)), np.abs(np.sin(turned))
        long, wide = length[s[k], o], width[s[k], o]
        gap = ahead - mine.half[k] - 0.5 * (long * along[0] + wide * along[1])
        beside = 0.5 * (crowd.width_m[s, r][k] + long * along[1] + wide * along[0]) + _BESIDE_M
        in_way = (ahead > 0.0) & (np.abs(left) < beside)
        speeds = np.concatenate([ego.speed_mps[:, None], self.speed_mps], axis=1)
        nearest = np.full(len(s), np.inf)
        np.minimum.at(nearest, k[in_way], gap[in_way])
        chosen = in_way & (gap == nearest[k])
        speed = np.zeros(len(s))
        speed[k[chosen]] = speeds[s[k[chosen]], o[chosen]] * np.cos(turned[chosen])
        return nearest, np.maximum(speed, 0.0)

    def _wait(self, mine: _Mine, ego: EgoBoxes) -> Array:
        """Return how far ground lies ahead that must be left to somebody else, else infinite."""
        s, r = mine.rows, mine.columns
        crowd = self.crowd
        count = len(crowd.path_of)
        there = np.concatenate([np.full((count, 1), ego.path_of), self._path_there], axis=1)
        k, o = np.nonzero(self._waits[mine.path[:, None], there[s]])
        row = s[k]
        found = self._rules.meetings[mine.path[k], there[row, o]]
        ahead = found[:, 0] - mine.arc[k] - mine.half[k]
        # Whoever has entered, or can no more stop before, goes on.
        reach = np.square(mine.speed[k]) / (2.0 * mine.decel[k])
        meets = (ahead > reach - _LINE_GAP_M) & (ahead < reach + _SIGHT_M) & (o != r[k] + 1)
        k, row, o, found, ahead = k[meets], row[meets], o[meets], found[meets], ahead[meets]
        arcs = np.concatenate([ego.arc_m[:, None], self.arc_m], axis=1)[row, o]
        speeds = np.concatenate([ego.speed_mps[:, None], self.speed_mps], axis=1)[row, o]
        halves = (
            0.5
            * np.concatenate([np.full((count, 1), ego.length_m), crowd.length_m], axis=1)[row, o]
        )
        _, leave, their_in, their_out = found.T
        moving = np.maximum(speeds, _STANDING_MPS)
        reach_s = (their_in - arcs - halves) / moving
        reach_s = np.where((speeds < _STANDING_MPS) & (reach_s > 0.0), np.inf, reach_s)
        gone_s = (their_out - arcs + halves) / moving
        pace = np.maximum(mine.speed[k], 4.0)
        enter_s = np.maximum(ahead, 0.0) / pace
        clear_s = (leave - mine.arc[k] + mine.half[k]) / pace
        taken = (gone_s > 0.0) & (reach_s < clear_s + _LAG_S) & (gone_s > enter_s - _LEAD_S)
        gap = np.full(len(s), np.inf)
        np.minimum.at(gap, k[taken], ahead[taken] - _LINE_GAP_M)
        return gap


class _Mine(NamedTuple):
    """The law-abiding ones, each (K,)."""

    rows: Indices
    columns: Indices
    arc: Array
    speed: Array
    path: Indices
    half: Array
    decel: Array


def _before(lines_m: Array, mine: _Mine) -> Array:
    """Return how far ahead the next of the lines (K, L) is that can still be stopped at."""
    ahead = lines_m - (mine.arc + mine.half)[:, None]
    reach = np.square(mine.speed) / (4.0 * mine.decel)
    ahead = np.where(ahead > reach[:, None] - _LINE_GAP_M, ahead, np.inf)
    return np.asarray(ahead.min(axis=1, initial=np.inf)) - _LINE_GAP_M
