"""What the law-abiding make of those around them: follow, stop at red, leave ground to others.

Free road and following: improved intelligent driver model (`driver_model.improved_idm_mps2`), the
nearest of a leader, a red light and ground to be left to others counting as what is ahead. All of
it is noticed late (`noticed.py`); who watches lights sees one turn red at once, and its green late.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.geometry.rectangles import Rectangles, overlapping
from foretwin.sim_worker import driver_model as driver
from foretwin.sim_worker.road_users.compiled import FIELDS, find_ahead, take_nearest
from foretwin.sim_worker.road_users.crowd import Crowd, EgoBoxes
from foretwin.sim_worker.road_users.noticed import Noticed
from foretwin.sim_worker.road_users.path_table import OnPaths, PathTable
from foretwin.sim_worker.road_users.right_of_way import PathRules

_BESIDE_M = 0.3
_CURVE_AHEAD_M = 15.0
_NEAR_M, _ALONGSIDE_COS = 15.0, 0.94
"""Who stands nearer than this and is turned by 20° or more is looked at as it stands."""
_SWEPT_M: Array = np.arange(0.0, _NEAR_M + 10.0, 0.5)
"""Of the own path, places whose ground is held against who stands near."""
_AS_FAST_MPS, _CAUGHT_UP_SHARE = 1.0, 2.0
"""Who is nearly as fast as another, and within twice the gap that it wants, follows it."""


class Now(NamedTuple):
    """Road users now: `poses` (S, R, 3), NaN where absent, `speed_mps` and `arc_m` (S, R)."""

    poses: Array
    speed_mps: Array
    arc_m: Array


class _Pairs(NamedTuple):
    """Pairs of which one may have to wait, (N,) each: places among the lawful ones, futures,
    columns of the others, the ego first; and the ground they share as in `PathRules.meetings`
    (N, 4)."""

    who: Indices
    future: Indices
    other: Indices
    ground: Array


class LawAbiding:
    """The K law-abiding ones of a crowd, in the order of `rows` (K,) and `columns` (K,)."""

    def __init__(self, crowd: Crowd, table: PathTable, rules: PathRules) -> None:
        self.rows, self.columns = s, r = np.nonzero(crowd.lawful & crowd.present)
        self._crowd, self._table, self._rules = crowd, table, rules
        self._path = crowd.path_of[s, r]
        self._on = table.on(self._path)
        self._half, self._lateral = 0.5 * crowd.length_m[s, r], crowd.lateral_m[s, r]
        self._width = crowd.width_m[s, r]
        self._decel, self._most = crowd.decel_mps2[s, r], crowd.accel_mps2[s, r]
        self._time_gap, self._lag = crowd.time_gap_s[s, r], crowd.lag_s[s, r]
        self._brisk = crowd.briskness[s, r]
        self.noticed = Noticed(crowd.reaction_s[s, r], s, r)
        self._desired = crowd.desired_mps[s, r]
        self._keeps = np.full(len(s), np.nan)
        """Of the gap that it would keep, the share that it does; unknown until it first looks."""
        most = len(s) * (crowd.present.shape[1] + 1)
        self._who, self._found = np.empty(most, dtype=np.intp), np.empty((FIELDS, most))
        self._pairs: tuple[int, _Pairs] | None = None

    def accelerations(
        self,
        now: Now,
        ego: EgoBoxes,
        red_arcs_m: Array,
        *,
        every_s: float,
        watch_lights: bool = False,
    ) -> Array:
        """Return (K,) what they choose, `every_s`; `red_arcs_m` (P, K) of paths, or (S, P, K)."""
        s, r, decel, most = self.rows, self.columns, self._decel, self._most
        arc, speed = now.arc_m[s, r], now.speed_mps[s, r]
        bend = self._bend(arc)
        gap, lead_speed = self._leader(now, ego, arc, bend)
        self._look_first(gap, speed, lead_speed)
        red = red_arcs_m[self._path] if red_arcs_m.ndim == 2 else red_arcs_m[s, self._path]
        line = self._before(red, arc, speed)
        still = np.minimum(line, self._wait(now, ego, arc, speed))
        nearer = still < gap
        ahead = np.stack(
            [
                arc + np.where(nearer, still, gap),
                np.where(nearer, 0.0, lead_speed),
                np.where(nearer, 0.0, self._keeps * driver.STANDSTILL_GAP_M),
            ]
        )
        end, lead_speed, least = self.noticed.after(ahead, every_s=every_s)
        gap = end - arc
        if watch_lights:
            nearer = line < gap
            gap = np.where(nearer, line, gap)
            lead_speed, least = np.where(nearer, 0.0, (lead_speed, least))
        wanted = least + driver.dynamic_gap_m(
            speed, lead_speed, self._keeps * self._time_gap, most, decel
        )
        accel = driver.improved_idm_mps2(
            speed, self._desired, wanted / np.maximum(gap, 0.1), most, decel
        )
        accel = np.minimum(accel, self._for_bends(arc, speed))
        # Who stands sets off for a way that is worth it, and does not creep up to what it awaits.
        stays = (speed < driver.HOLD_SPEED_MPS) & (gap < least + driver.WORTH_M)
        accel = np.where(stays, np.minimum(accel, driver.HOLD_MPS2), accel)
        return np.asarray(np.clip(accel, -driver.EMERGENCY_DECEL_MPS2, most))

    def _look_first(self, gap: Array, speed: Array, lead_speed: Array) -> None:
        """Take what newcomers are first seen to do for their own way, as the speed that they have.

        Who follows closer than it was drawn to keeps doing so, and who has caught up with another
        wants to be faster.
        """
        new = np.isnan(self._keeps)
        if not new.any():
            return
        share = gap / (driver.STANDSTILL_GAP_M + speed * self._time_gap)
        follows = (np.abs(lead_speed - speed) < _AS_FAST_MPS) & (speed > driver.LEAST_START_MPS)
        keeps = np.clip(np.where(follows, share, 1.0), driver.OTHERS_CLOSEST, 1.0)
        wants = np.where(follows & (share < _CAUGHT_UP_SHARE), driver.CAUGHT_UP, 1.0)
        self._keeps = np.where(new, keeps, self._keeps)
        self._desired = np.where(new, wants * self._desired, self._desired)

    def carry_on(self, before: LawAbiding, futures: Flags) -> None:
        """Let those of the `futures` (S,) know what they knew before; the others begin anew."""
        self.noticed.carry_on(before.noticed, futures)
        same = self.noticed.same_as(before.noticed, futures)
        for mine, theirs in (
            (self._keeps, before._keeps),
            (self._desired, before._desired),
        ):
            mine[same[0]] = theirs[same[1]]

    def take_over(self, before: LawAbiding, column_of: Indices, shift_m: Array) -> None:
        """Let those of one future know what they did in columns `column_of` (R,), -1 for who was
        not there, on paths whose arc lengths are `shift_m` (R,) more; they keep their distance."""
        place = {column: k for k, column in enumerate(before.columns.tolist())}
        pairs = [
            (k, place[column_of[r]])
            for k, r in enumerate(self.columns.tolist())
            if int(column_of[r]) in place
        ]
        same = np.array(pairs, dtype=np.intp).reshape(-1, 2).T
        self.noticed.take_over(before.noticed, same, shift_m[self.columns[same[0]]])
        self._keeps[same[0]] = before._keeps[same[1]]

    def _for_bends(self, arc: Array, speed: Array) -> Array:
        """Return what brings a driver to the speed that bends allow where it decides next."""
        there = self._table.place(self._on, arc + speed * driver.DECIDE_EVERY_S)
        allowed = np.sqrt(self._brisk * self._table.square_bound(there))
        return np.asarray((allowed - speed) / driver.DECIDE_EVERY_S)

    def _bend(self, arc: Array) -> Array:
        """Return (K,) the mean curvature of the own path over the next metres."""
        here = self._table.headings(self._table.place(self._on, arc))
        there = self._table.headings(self._table.place(self._on, arc + _CURVE_AHEAD_M))
        return np.asarray((there - here) / _CURVE_AHEAD_M)

    def _leader(self, now: Now, ego: EgoBoxes, arc: Array, bend: Array) -> tuple[Array, Array]:
        """Return the gap to the lead in the own lane, infinite without one, and its speed.

        Others are looked for beside the parabola that the own path bends along; by that alone
        drivers at a junction stand for each other where there is room to pass, and for good.
        """
        crowd = self._crowd
        x, y, yaw = now.poses[self.rows, self.columns].T
        cos, sin = np.cos(yaw), np.sin(yaw)
        mine = np.stack([x, y, yaw, cos, sin, 0.5 * bend, self._width, self._half])
        count = find_ahead(
            self.rows, mine, ego.poses, ego.speed_mps, (ego.length_m, ego.width_m),
            now.poses, now.speed_mps, crowd.length_m, crowd.width_m,
            (driver.SIGHT_M, _BESIDE_M), self._who, self._found,
        )  # fmt: skip
        who, found = self._who[:count], self._found[:, :count]
        close = (np.abs(found[5]) < driver.STANDING_MPS) & (found[0] < _NEAR_M)
        close &= np.cos(found[2]) < _ALONGSIDE_COS
        gap, speed = np.full(len(x), np.inf), np.zeros(len(x))
        if close.any():
            self._stand_by(gap, arc, mine, who[close], found[:, close])
            who, found = who[~close], found[:, ~close]
        turned = found[2]
        take_nearest(who, found, np.cos(turned), np.sin(turned), mine, _BESIDE_M, gap, speed)
        return gap, speed

    def _stand_by(self, gap_m: Array, arc: Array, mine: Array, who: Indices, found: Array) -> None:
        """Lower gaps (K,) to those who stand near and turned, as `find_ahead` has them: to where
        the own way first touches their boxes, which reach far less far than along its heading."""
        ahead, beside, turned, length, width, _ = found
        x, y, yaw, cos, sin, half_bend = mine[:6, who]
        left = beside + half_bend * np.square(ahead)
        middle = np.stack([x + cos * ahead - sin * left, y + sin * ahead + cos * left], axis=-1)
        stands = Rectangles(
            middle[:, None], (yaw + turned)[:, None], length[:, None], width[:, None]
        )
        on = OnPaths._make(column[who, None] for column in self._on)
        place = self._table.place(on, arc[who, None] + _SWEPT_M)
        poses = self._table.poses(
            place, np.broadcast_to(self._lateral[who, None], place.node.shape)
        )
        wide = self._width[who, None] + 2.0 * _BESIDE_M
        swept = Rectangles(poses[..., :2], poses[..., 2], 2.0 * self._half[who, None], wide)
        touches = overlapping(swept, stands)
        first_m = np.where(touches.any(axis=1), _SWEPT_M[touches.argmax(axis=1)], np.inf)
        np.minimum.at(gap_m, who, first_m)

    def _wait(self, now: Now, ego: EgoBoxes, arc: Array, speed: Array) -> Array:
        """Return how far ground lies ahead that must be left to others, else infinite."""
        k, row, o, ground = self._pairs_with(ego.path_of)
        ahead = ground[:, 0] - arc[k] - self._half[k]
        # Whoever has entered, or can no more stop before, goes on.
        reach = np.square(speed[k]) / (2.0 * self._decel[k])
        meets = np.flatnonzero(
            (ahead > reach - driver.LINE_GAP_M) & (ahead < reach + driver.SIGHT_M)
        )
        k, row, o, ground, ahead = k[meets], row[meets], o[meets], ground[meets], ahead[meets]
        arcs = _with_ego(ego.arc_m, now.arc_m)[row, o]
        speeds = _with_ego(ego.speed_mps, now.speed_mps)[row, o]
        halves = 0.5 * _with_ego(ego.length_m, self._crowd.length_m)[row, o]
        _, leave, their_in, their_out = ground.T
        moving = np.maximum(speeds, driver.STANDING_MPS)
        reach_s = (their_in - arcs - halves) / moving
        reach_s = np.where((speeds < driver.STANDING_MPS) & (reach_s > 0.0), np.inf, reach_s)
        gone_s = (their_out - arcs + halves) / moving
        pace = np.maximum(speed[k], 4.0)
        enter_s = np.maximum(ahead, 0.0) / pace
        clear_s = (leave - arc[k] + self._half[k]) / pace
        taken = (
            (gone_s > 0.0) & (reach_s < clear_s + self._lag[k]) & (gone_s > enter_s - driver.LEAD_S)
        )
        gap = np.full(len(self.rows), np.inf)
        np.minimum.at(gap, k[taken], ahead[taken] - driver.LINE_GAP_M)
        return gap

    def _pairs_with(self, ego_path: int) -> _Pairs:
        """Return the pairs of which one may have to wait, found once: paths do not change."""
        if self._pairs is None or self._pairs[0] != ego_path:
            meetings, crowd = self._rules.meetings, self._crowd
            # One more row and column than paths: absent road users take the last, without meetings.
            waits = np.pad(np.isfinite(meetings[..., 0]), (0, 1))
            there = _with_ego(ego_path, np.where(crowd.present, crowd.path_of, len(meetings)))
            k, o = np.nonzero(waits[self._path[:, None], there[self.rows]])
            others = o != self.columns[k] + 1
            k, o = k[others], o[others]
            row = self.rows[k]
            pairs = _Pairs(k, row, o, meetings[self._path[k], there[row, o]])
            self._pairs = (ego_path, pairs)
        return self._pairs[1]

    def _before(self, lines_m: Array, arc: Array, speed: Array) -> Array:
        """Return how far ahead the next of the lines (K, L) is that can still be stopped at."""
        ahead = lines_m - (arc + self._half)[:, None]
        reach = np.square(speed) / (2.0 * driver.LINE_DECEL_MPS2)
        ahead = np.where(ahead > reach[:, None] - driver.LINE_GAP_M, ahead, np.inf)
        return np.asarray(ahead.min(axis=1, initial=np.inf)) - driver.LINE_GAP_M


def _with_ego(ego: Array | float, others: Array) -> Array:
    """Return (S, 1 + R) the ego's values (S,), or the one of all, before those of others (S, R)."""
    found = np.empty((others.shape[0], others.shape[1] + 1), dtype=others.dtype)
    found[:, 0], found[:, 1:] = ego, others
    return found
