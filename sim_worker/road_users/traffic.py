"""Other road users of S futures, up to R in each, moved together along paths of their own.

Their motion along a path is all there is to it: arc length and speed. Law-abiding ones decide a few
times a second, as people do, and keep the acceleration in between. Those who heed nobody are where
their pace has them at the time, recorded ones where they were.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.sim_worker.driver_model import DECIDE_EVERY_S
from foretwin.sim_worker.road_users.crowd import Crowd, EgoBoxes
from foretwin.sim_worker.road_users.law_abiding import LawAbiding, Now
from foretwin.sim_worker.road_users.paces import Paces, WayMade
from foretwin.sim_worker.road_users.path_table import OnPaths, PathTable
from foretwin.sim_worker.road_users.replay import Replay
from foretwin.sim_worker.road_users.right_of_way import PathRules

_FORESEEN = 32
"""Ticks."""


class _Foreseen(NamedTuple):
    """Where those who heed nobody are at `_FORESEEN` ticks from `from_s` on, each (T, K)."""

    from_s: float
    tick_s: float
    made: WayMade

    def _tick(self, now_s: float) -> int:
        return round((now_s - self.from_s) / self.tick_s)

    def holds(self, now_s: float, tick_s: float) -> bool:
        """Return whether it says where they are then."""
        tick = self._tick(now_s)
        known = tick_s == self.tick_s and 0 <= tick < _FORESEEN
        return known and abs(self.from_s + tick * tick_s - now_s) < 1e-9

    def at(self, now_s: float) -> WayMade:
        """Return where they are (K,) then."""
        tick = self._tick(now_s)
        return WayMade(self.made.arc_m[tick], self.made.speed_mps[tick])


class Traffic:
    """The road users of one job; `arc_m`, `speed_mps` (S, R) and `poses` (S, R, 3) are now.

    The first of each future are those of `replay`; while one is away, its speed is NaN too.
    """

    def __init__(
        self,
        crowd: Crowd,
        table: PathTable,
        rules: PathRules,
        paces: Paces,
        replay: Replay | None = None,
    ) -> None:
        self.crowd, self.table, self.replay, self._rules = crowd, table, replay, rules
        self._paces = paces
        self._on = table.on(crowd.path_of)
        self._now_s: float | Array = 0.0
        self._absent = None if crowd.present.all() else ~crowd.present
        self.arc_m = crowd.start_arc_m.copy()
        self.speed_mps = np.where(crowd.present, crowd.start_speed_mps, 0.0)
        self._paced = np.nonzero(crowd.pace_of >= 0)
        self._motion = crowd.pace_of[self._paced]
        # Their own clocks as the future begins.
        self._clock_s = paces.time_at(self._motion, self.arc_m[self._paced])
        self._brakes_at_s = self._clock_s + crowd.brakes_at_s[self._paced]
        self._foreseen: _Foreseen | None = None
        self._pace(0.0)
        self._put()
        self._accel = np.zeros_like(self.arc_m)
        self._lawful = LawAbiding(crowd, table, rules)
        self.reacts = len(self._lawful.rows) > 0
        """Whether any of them does anything but keep a speed."""

    def _put(self) -> None:
        self.place = self.table.place(self._on, self.arc_m)
        gone = None if self.replay is None else self._play_back(self.replay)
        self.poses = self.table.poses(self.place, self.crowd.lateral_m)
        if gone is not None:
            np.copyto(self.poses[:, : gone.shape[1]], np.nan, where=gone[..., None])
        if self._absent is not None:
            self.poses[self._absent] = np.nan

    def _play_back(self, replay: Replay) -> Flags:
        """Put recorded road users where they are now; returns (1 or S, T) who of them is away."""
        now, count = replay.at(self._now_s), len(replay)
        mine = (slice(None), slice(count))
        self.place.node[mine] = self._on.begin[mine] + now.node
        self.place.share[mine] = now.share
        self.speed_mps[mine] = now.speed_mps
        return now.gone

    def begun(self, futures: Indices) -> Traffic:
        """Return traffic (K, R) that begins as that of these futures did."""
        crowd = Crowd._make(f[futures] for f in self.crowd)
        return Traffic(crowd, self.table, self._rules, self._paces, self.replay)

    def carry_on(self, before: Traffic, futures: Flags) -> None:
        """Let the `futures` (S,) go on from where traffic of the same paths has them."""
        for mine, theirs in (
            (self.arc_m, before.arc_m),
            (self.speed_mps, before.speed_mps),
            (self._accel, before._accel),
        ):
            mine[futures] = theirs[futures]
        self._lawful.carry_on(before._lawful, futures)
        self._now_s = np.where(futures[:, None], before._now_s, self._now_s)
        self._put()

    def take_over(self, before: Traffic, column_of: Indices, shift_m: Array) -> None:
        """Let the road users of one future decide as those in columns `column_of` (R,) of other
        traffic would have gone on, -1 for who was not there; the arc lengths of their paths are
        `shift_m` (R,) more than there."""
        there = column_of >= 0
        self._accel[0, there] = before._accel[0, column_of[there]]
        self._lawful.take_over(before._lawful, column_of, shift_m)

    def step(self, *, time_s: float | Array, dt_s: float) -> None:
        """Advance by `dt_s` from `time_s`, one or (S, 1), with what was decided last."""
        self._now_s = time_s + dt_s
        if self.reacts:
            after = np.maximum(self.speed_mps + self._accel * dt_s, 0.0)
            self.arc_m += 0.5 * (self.speed_mps + after) * dt_s
            self.speed_mps = after
        self._pace(dt_s)
        if self.replay is not None:
            self.arc_m[:, : len(self.replay)] = 0.0
        self._put()

    def _pace(self, dt_s: float) -> None:
        """Put those who heed nobody where they are now."""
        if not len(self._motion):
            return
        if isinstance(self._now_s, float) and dt_s > 0.0:
            # Their motion is known for good: that of many ticks costs little more than of one.
            if self._foreseen is None or not self._foreseen.holds(self._now_s, dt_s):
                times: Array = self._now_s + dt_s * np.arange(float(_FORESEEN))[:, None]
                self._foreseen = _Foreseen(self._now_s, dt_s, self._motion_at(times))
            now = self._foreseen.at(self._now_s)
        else:
            now = self._motion_at(np.broadcast_to(self._now_s, self.arc_m.shape)[self._paced])
        self.arc_m[self._paced], self.speed_mps[self._paced] = now

    def _motion_at(self, now_s: Array) -> WayMade:
        brakes_by = self.crowd.brakes_by_mps2[self._paced]
        clock_s = self._clock_s + now_s
        return self._paces.braked(self._motion, clock_s, self._brakes_at_s, brakes_by)

    @property
    def motion(self) -> tuple[Array, Array, Array]:
        """Arc lengths, speeds and what was decided last of accelerations, each (S, R)."""
        return self.arc_m, self.speed_mps, self._accel

    def poses_at(self, arc_m: Array) -> Array:
        """Return (…, R, T, 3) where road users of the one future would be at places (…, R, T) of
        their paths."""
        on = OnPaths._make(column[0][:, None] for column in self._on)
        return self.table.poses(self.table.place(on, arc_m))

    def brake(self, who: Flags, decel_mps2: Array) -> None:
        """Let those (R,) brake so hard (R,) until they decide again."""
        self._accel[:, who] = -decel_mps2[who]

    def brake_at_most(self, decel_mps2: Array) -> None:
        """Let nobody brake harder than so (R,) by what was decided last."""
        np.maximum(self._accel, -decel_mps2, out=self._accel)

    def decide(
        self,
        ego: EgoBoxes,
        red_arcs_m: Array,
        *,
        every_s: float = DECIDE_EVERY_S,
        watch_lights: bool = False,
    ) -> None:
        """Let law-abiding road users choose their accelerations, as they do `every_s`; `red_arcs_m`
        (P, K) of paths, or (S, P, K). Who watches lights sees one turn red without delay."""
        if self.reacts:
            now = Now(self.poses, self.speed_mps, self.arc_m)
            chosen = self._lawful.accelerations(
                now, ego, red_arcs_m, every_s=every_s, watch_lights=watch_lights
            )
            self._accel[self._lawful.rows, self._lawful.columns] = chosen
