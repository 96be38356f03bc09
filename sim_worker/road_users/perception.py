"""Other road users as a driver perceives them: places on the ego's path, late or lost by faults."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.frenet_path import FrenetPoint
from foretwin.sim_worker.planner_interface import SeenUsers
from foretwin.sim_worker.road_users.compiled import hide_behind, nearest_in_way
from foretwin.sim_worker.road_users.path_table import PathPlace, PathProjection
from foretwin.sim_worker.road_users.sight_lines import OpaqueGrid, hidden
from foretwin.sim_worker.road_users.traffic import Traffic
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m

_MARGIN_M = 0.3
"""What passes the car's side by less than this is in its way."""
_WALLS_EVERY_S = 0.1
"""Cars see again so often whom walls hide: in that time what comes out goes on by its width."""


class PerceptionFaults(NamedTuple):
    """Each (S,): how late others are perceived, and from when for how long not at all."""

    delay_s: Array
    lost_from_s: Array
    lost_for_s: Array


class Lead(NamedTuple):
    """What is ahead of S cars: bumper to bumper, infinite without a lead, and its speed; (S,)."""

    gap_m: Array
    speed_mps: Array


class Sight:
    """What S cars see of the traffic around them, tick by tick."""

    def __init__(
        self,
        traffic: Traffic,
        along: PathProjection,
        vehicle: VehicleParameters,
        faults: PerceptionFaults,
        *,
        tick_s: float,
        walls: OpaqueGrid | None = None,
        kept: int | None = None,
    ) -> None:
        """`along` projects the traffic's paths on the ego's; nobody sees through `walls`.

        What was seen is remembered for the longest delay, or for `kept` ticks.
        """
        crowd = traffic.crowd
        self._crowd, self._along, self._vehicle = crowd, along, vehicle
        self._length_m, self._width_m = vehicle.length_m.value, vehicle.width_m.value
        self._front_m = box_centre_from_base_m(vehicle) + self._length_m / 2.0
        self._size = np.stack([crowd.length_m, crowd.width_m], axis=-1)
        self._late = np.round(faults.delay_s / tick_s).astype(np.intp)
        self._faults, self._tick_s = faults, tick_s
        rows, them = np.nonzero((crowd.hidden_by >= 0) & crowd.present)
        self._hidden = rows, them, crowd.hidden_by[rows, them].astype(np.intp)
        """Futures, who is hidden in them and by whom, each (H,)."""
        self._by_actors = len(rows) > 0
        self._unknown = crowd.present & ~crowd.known
        self._strangers = np.flatnonzero(self._unknown.any(axis=0))
        self._walls = walls if len(self._strangers) else None
        self.needs_eyes = self._by_actors or self._walls is not None
        """Whether it matters where the cars' eyes are."""
        self._behind_walls: Flags | None = None
        self._walls_every = max(round(_WALLS_EVERY_S / tick_s), 1)
        kept = kept or int(self._late.max(initial=0)) + 1
        self._past: list[tuple[npt.NDArray[Any], ...]] = [_now(traffic)] * kept
        self._anybody_late = bool(self._late.any())
        self._ever_lost = bool((faults.lost_for_s > 0.0).any())
        self._all_there = traffic.replay is None and bool(crowd.present.all())
        self._beside_m = crowd.lateral_m if crowd.lateral_m.any() else None

    def begun(self, futures: Indices, traffic: Traffic) -> Sight:
        """Return the sight of (K,) cars that see `traffic`, begun as that of these futures did."""
        return Sight(
            traffic,
            self._along,
            self._vehicle,
            PerceptionFaults._make(column[futures] for column in self._faults),
            tick_s=self._tick_s,
            walls=self._walls,
            kept=len(self._past) + 1,
        )

    def carry_on(self, before: Sight, futures: Flags, *, looked: bool) -> None:
        """Let the `futures` (S,) remember what they saw before, both sights being `begun`.

        Who has `looked` at this instant already looks again.
        """
        past = [*before._past[1:], before._past[-1]] if looked else before._past
        row = futures[:, None]
        kept = row, row, row, row[..., None]
        self._past = [
            tuple(np.where(k, *pair) for k, *pair in zip(kept, theirs, mine, strict=True))
            for mine, theirs in zip(self._past, past, strict=True)
        ]

    def look(self, tick: int | Indices, traffic: Traffic, eyes_xy_m: Array) -> SeenUsers:
        """Return what is seen at a tick, or ticks (S,), from where the cars' fronts are (S, 2)."""
        self._past = [_now(traffic), *self._past[:-1]]
        node, share, speed, poses = self._past[0]
        if self._anybody_late:
            rows = np.arange(len(node))
            node, share, speed, poses = (
                np.stack([past[k] for past in self._past])[self._late, rows] for k in range(4)
            )
        on_arc, offset, turned = self._along.at(PathPlace(node, share))
        if self._beside_m is not None:
            offset = offset + self._beside_m * np.cos(turned)
        unseen = self._unseen(tick, poses, eyes_xy_m)
        if unseen is not None:
            np.copyto(on_arc, np.nan, where=unseen)
            poses = np.where(unseen[..., None], np.nan, poses)
        return SeenUsers(poses, speed, self._size, on_arc, offset, self._crowd.walks, turned)

    def _unseen(self, tick: int | Indices, poses: Array, eyes_xy_m: Array) -> Flags | None:
        """(S, R) bool: which are absent, lost or hidden; None where all are seen."""
        if self._all_there and not self._ever_lost and not self.needs_eyes:
            return None
        unseen = np.isnan(poses[..., 0])
        if self._ever_lost:
            unseen |= self._lost(np.asarray(tick) * self._tick_s)[:, None]
        if self._by_actors:
            rows, them, by = self._hidden
            yaw = poses[rows, by, 2]
            cos, sin = np.cos(yaw), np.sin(yaw)
            hide_behind(rows, them, by, poses, cos, sin, self._size, eyes_xy_m, unseen)
        if self._walls is not None:
            due = not isinstance(tick, int) or tick % self._walls_every == 0
            if due or self._behind_walls is None:
                these = slice(None), self._strangers
                length_m = self._crowd.length_m[these]
                found = hidden(self._walls, eyes_xy_m, poses[these], length_m)
                self._behind_walls = np.zeros_like(unseen)
                self._behind_walls[these] = found & self._unknown[these]
            unseen |= self._behind_walls
        return unseen

    def _lost(self, time_s: float | Array) -> Flags:
        since = time_s - self._faults.lost_from_s
        return np.asarray((since >= 0.0) & (since < self._faults.lost_for_s))

    def lead(self, seen: SeenUsers, place: FrenetPoint) -> Lead:
        """Return who is in the way of base_link at `place` (S,) on the ego's path."""
        gap, speed = np.empty((2, len(place.arc_m)))
        own_m = self._front_m, self._length_m, self._width_m, _MARGIN_M
        nearest_in_way(
            seen.arc_m, seen.offset_m, np.cos(seen.turned_rad), np.sin(seen.turned_rad),
            seen.speed_mps, self._crowd.length_m, self._crowd.width_m,
            place.arc_m, place.offset_m, own_m, gap, speed,
        )  # fmt: skip
        return Lead(gap, speed)


def _now(traffic: Traffic) -> tuple[npt.NDArray[Any], ...]:
    """Return what is remembered of an instant: places, speeds and poses."""
    node, share = traffic.place
    return node, share, traffic.speed_mps.copy(), traffic.poses
