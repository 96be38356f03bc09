"""A road user of the traffic model on its way, which is led on lane by lane while it drives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import RoadUserKind
from foretwin.contracts.frames import LocalFrame, target_from_source_m
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.polyline import arc_lengths, points_at
from foretwin.sim_worker.road_users.right_of_way import JunctionRules, Taken
from foretwin.sim_worker.scenarios.roads import RoadNetwork
from foretwin.sim_worker.scenarios.seen import LaneSearch

_BEHIND_M = 30
"""So much of the way stays behind a road user, in whole metres: nodes stay where they are."""
_JOINT_M = 0.02
_LAST_M = 2.0


class RoadsInForce(NamedTuple):
    """The World in force, as those who drive in it know it."""

    network: RoadNetwork
    lanes: LaneSearch
    rules: JunctionRules


@dataclass(slots=True)
class Rider:
    """Who drives along lanes: its way `xy_m` (N, 2) with limits (N,), and where it is on it.

    `last_id` is the lane or connection at the way's end, None once the World has changed or has no
    more of it. `taken` is what the way takes of the World's connections.
    """

    name: str
    kind: RoadUserKind
    size_m: tuple[float, float]
    limit_share: float
    xy_m: Array
    limit_mps: Array
    last_id: str | None
    arc_m: float
    speed_mps: float
    path: FrenetPath
    taken: tuple[Taken, ...]
    ended: bool = False
    """Whether the World in force has no more of the way."""
    shifted_m: float = 0.0
    """By how much arc lengths have grown since the simulation last took the way."""

    @property
    def left_m(self) -> float:
        """How much of the way is left."""
        return self.path.length_m - self.arc_m

    def lead_on(self, roads: RoadsInForce, far_m: float, rng: np.random.Generator) -> bool:
        """Lead the way on along lanes, turns drawn, until `far_m` are left or lanes end; returns
        whether it has changed. What lies far behind is forgotten."""
        if self.ended:
            return False
        last = self.last_id or self._lane_at_end(roads)
        parts, limits = [self.xy_m], [self.limit_mps]
        ahead_m = self.left_m
        while last is not None and ahead_m < far_m:
            onward = [one for one in roads.network.after(last) if roads.network.drivable(one)]
            if not onward:
                break
            last = onward[int(rng.integers(len(onward)))]
            line = roads.network.line(last)
            ahead_m += float(arc_lengths(line)[-1])
            parts.append(line)
            limits.append(np.full(len(line), roads.network.limit_mps(last)))
        self.ended, self.last_id = ahead_m < far_m, last
        self._lay(np.concatenate(parts), np.concatenate(limits), roads.rules)
        return True

    def _lane_at_end(self, roads: RoadsInForce) -> str | None:
        """Return the lane at the way's end, with what is left of it put onto the way."""
        step = self.xy_m[-1] - points_at(self.xy_m, self.path.length_m - _LAST_M)
        end = self.xy_m[-1]
        lane = roads.lanes.under(end, float(np.arctan2(step[1], step[0])))
        if lane is None:
            return None
        line = lane.centerline
        on_m = float(FrenetPath(line).locate(end[None]).arc_m[0])
        arc = arc_lengths(line)
        # Lanes of two Worlds do not lie on each other to the centimetre: the step is a slant.
        rest = line[arc > on_m + _LAST_M]
        self.xy_m = np.concatenate([self.xy_m, rest])
        limit = np.full(len(rest), roads.network.limit_mps(lane.id))
        self.limit_mps = np.concatenate([self.limit_mps, limit])
        return lane.id

    def move_into(self, target: LocalFrame, source: LocalFrame, rules: JunctionRules) -> None:
        """Take the way along into the frame of another World."""
        self.last_id, self.ended = None, False
        self._lay(target_from_source_m(target, source, self.xy_m), self.limit_mps, rules)

    def _lay(self, xy_m: Array, limit_mps: Array, rules: JunctionRules) -> None:
        step = np.hypot(*np.diff(xy_m, axis=0).T)
        keep = np.concatenate([[True], step > _JOINT_M])
        xy_m, limit_mps = xy_m[keep], limit_mps[keep]
        # Of a way that has been left behind, its last metres stay: it goes on straight from there.
        most_m = float(np.hypot(*np.diff(xy_m, axis=0).T).sum()) - _LAST_M
        cut_m = max(0.0, float(np.floor(min(self.arc_m - _BEHIND_M, most_m))))
        if cut_m > 0.0:
            arc = arc_lengths(xy_m)
            ahead = arc > cut_m + _JOINT_M
            first = int(np.argmax(ahead))
            xy_m = np.concatenate([points_at(xy_m, np.array([cut_m])), xy_m[ahead]])
            limit_mps = np.concatenate([limit_mps[max(first - 1, 0)][None], limit_mps[ahead]])
        self.arc_m -= cut_m
        self.shifted_m -= cut_m
        self.xy_m, self.limit_mps = xy_m, limit_mps
        self.path = FrenetPath(xy_m, limit_mps).eased
        self.taken = rules.taken(self.path)
