"""Finds the road a car is on, as it drives and without looking ahead."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.running import MOST_LISTED, FirstOf
from foretwin.orchestrator.routing.road_hypotheses import (
    BEGIN_RADIUS_M,
    SEARCH_RADIUS_M,
    STEP_M,
    Hypothesis,
    first_hypotheses,
    next_hypotheses,
)
from foretwin.orchestrator.routing.road_index import NearEdge, RoadIndex, legality, project
from foretwin.world_gen.roads.road_graph import DirectedEdge, RoadGraph

LOST_AFTER_M = 20.0
_SURE = 2.0
"""What more must speak against each other road for a match to be confident."""
_LEAST_STRETCH_M = 5.0


class Match(NamedTuple):
    """Where on the map the car is; `lateral_m` is positive left of the edge's driving direction.

    `confident` is false where another road is nearly as likely, or the nearest is far away;
    `direction_known` is false until the car's heading has told which way it drives.
    """

    directed_edge: DirectedEdge
    s_on_edge_m: float
    lateral_m: float
    distance_m: float
    confident: bool
    direction_known: bool = True
    heading_off_rad: float = 0.0
    """The car's heading against the road's there, positive to the left; 0 while it is unknown."""
    rivals: tuple[NearEdge, ...] = ()
    """Other roads than it and those next to it that are nearly as likely, likeliest first."""


class OffRoadStretch(NamedTuple):
    """A stretch driven where the map says that cars may not: no_car_road or against_one_way."""

    reason: str
    name: str
    way_ids: tuple[int, ...]
    length_m: float


class MapMatcher:
    """Follows one car through the road graph, fix by fix."""

    def __init__(self, graph: RoadGraph, *, index: RoadIndex | None = None) -> None:
        self._index = index or RoadIndex(graph)
        self._hypotheses: list[Hypothesis] = []
        self.roads_near: list[NearEdge] = []
        """Both directions of all roads near the car where it was matched last, nearest first."""
        self._step_xy: Array | None = None
        self._road_xy: Array | None = None
        self._away_m = 0.0
        self._direction_known = False
        self._stretches: FirstOf[OffRoadStretch] = FirstOf(MOST_LISTED)
        self._stretch: OffRoadStretch | None = None
        self._stretch_sure = False
        """Whether no road for cars was nearly as likely at some step of the present stretch."""

    @property
    def off_road_stretches(self) -> tuple[OffRoadStretch, ...]:
        """What has been driven where cars may not drive, the present stretch included."""
        present = self._present_stretch()
        return (*self._stretches, *((present,) if present else ()))

    def _present_stretch(self) -> OffRoadStretch | None:
        """Return the stretch that is being driven.

        A turn into the other carriageway seems for some metres to be one in the road, back along
        the first: what is that short, or was never sure, is none.
        """
        long = self._stretch is not None and self._stretch.length_m >= _LEAST_STRETCH_M
        return self._stretch if long and self._stretch_sure else None

    def update(
        self, xy_m: Array, yaw_rad: float, yaw_valid: bool, speed_mps: float
    ) -> Match | None:
        """Take the car's position (2,) in the graph's frame; return its match, None off the map.

        Off the map means: no road within `BEGIN_RADIUS_M` for `LOST_AFTER_M` of driving.
        Positions that are not finite are ignored; a heading that is not valid does not count.
        """
        xy = np.asarray(xy_m, dtype=np.float64)
        if not np.isfinite(xy).all():
            return self._match(None, None)
        yaw = yaw_rad if yaw_valid and math.isfinite(yaw_rad) else None
        if speed_mps < -0.3 and yaw is not None:
            yaw += math.pi
        moved = 0.0 if self._step_xy is None else float(np.hypot(*(xy - self._step_xy)))
        if not self._hypotheses:
            self._begin(xy, yaw)
        elif moved >= STEP_M or (yaw is not None and not self._direction_known):
            self._step(xy, yaw, moved)
        if self._away_m == 0.0:
            self._road_xy = xy
        return self._match(xy, yaw)

    def _begin(self, xy: Array, yaw: float | None) -> None:
        candidates = self._index.near(xy, BEGIN_RADIUS_M)
        self._step_xy, self.roads_near = xy, candidates
        if candidates:
            self._hypotheses = first_hypotheses(candidates, yaw)
            self._direction_known = yaw is not None
            self._away_m = 0.0

    def _step(self, xy: Array, yaw: float | None, moved_m: float) -> None:
        candidates = self._index.near(xy, SEARCH_RADIUS_M)
        self._step_xy, self.roads_near = xy, candidates
        if not candidates or candidates[0].distance_m > BEGIN_RADIUS_M:
            # A single wild fix must not end the match: no step counts for more than 5 m.
            self._away_m += min(moved_m, 5.0)
            if self._away_m > LOST_AFTER_M:
                self._hypotheses = []
                self._close_stretch()
            if not candidates or not self._hypotheses:
                return
        else:
            self._away_m = 0.0
        if yaw is not None and not self._direction_known:
            # The first heading decides alone: before it both directions were equally likely.
            self._hypotheses = first_hypotheses(candidates, yaw)
            self._direction_known = True
        else:
            self._hypotheses = next_hypotheses(
                self._index, self._hypotheses, candidates, yaw, moved_m
            )
        self._note_legality(moved_m)

    def _match(self, xy: Array | None, yaw: float | None) -> Match | None:
        # Away from every road the car's place on its last one is where it left it: a wild
        # position must not carry it to the road's end and past a junction.
        road_xy = self._road_xy
        if not self._hypotheses or road_xy is None:
            return None
        best = self._hypotheses[0]
        near = project(best.near.directed_edge, road_xy)
        rivals = tuple(
            project(other.near.directed_edge, road_xy)
            for other in self._hypotheses[1:]
            if other.cost <= _SURE and not _adjacent(best.near, other.near)
        )
        confident = (
            self._direction_known and self._away_m == 0.0 and near.distance_m < 15.0 and not rivals
        )
        off_rad = 0.0
        if xy is not None and yaw is not None and self._direction_known:
            here = near if xy is road_xy else project(near.directed_edge, xy)
            off_rad = float(wrap_angle(yaw - here.heading_rad))
        place = near.directed_edge, near.s_m, near.lateral_m, near.distance_m
        return Match(*place, confident, self._direction_known, off_rad, rivals)

    def _note_legality(self, moved_m: float) -> None:
        edge = self._hypotheses[0].near.directed_edge
        reason = legality(edge)
        if self._stretch is not None and reason != self._stretch.reason:
            self._close_stretch()
        if reason == "car":
            return
        now = self._stretch or OffRoadStretch(reason, edge.edge.name, (), 0.0)
        ways = now.way_ids if edge.edge.way_id in now.way_ids else (*now.way_ids, edge.edge.way_id)
        self._stretch = now._replace(way_ids=ways, length_m=now.length_m + moved_m)
        self._stretch_sure |= all(
            other.cost > _SURE or legality(other.near.directed_edge) != "car"
            for other in self._hypotheses
        )

    def _close_stretch(self) -> None:
        if (ended := self._present_stretch()) is not None:
            self._stretches.append(ended)
        self._stretch, self._stretch_sure = None, False


def _adjacent(one: NearEdge, other: NearEdge) -> bool:
    """Whether two candidates follow each other, so that doubt between them means little."""
    first, second = one.directed_edge, other.directed_edge
    return first.end_node == second.start_node or second.end_node == first.start_node
