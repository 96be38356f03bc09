"""The parts of a case: who starts where, and the case being staged while they are given out."""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import RoadUserKind
from foretwin.contracts.scenario import ActorPart, Conduct, Relation, Scenario
from foretwin.geometry.frenet_path import SPACING_M, FrenetPath
from foretwin.geometry.polyline import length
from foretwin.sim_worker.driver_model import HEEDLESS_BRISKNESS
from foretwin.sim_worker.road_users.paces import Paces, briskness
from foretwin.sim_worker.scenarios.drawing import Values
from foretwin.sim_worker.scenarios.impact import Impact, MovingBox
from foretwin.sim_worker.scenarios.places import ScenarioPlace
from foretwin.sim_worker.scenarios.ways import Way
from foretwin.sim_worker.vehicle.road_user_kinds import KINDS, KindTraits

ALONG: tuple[Relation, ...] = ("ahead", "behind", "beside", "parked")
"""Relations of those who have no way of their own: they are on the ego's path or beside it."""


class StagedActor(NamedTuple):
    """Another road user of a case.

    `xy_m` (N, 2) is its own path; its box's centre starts at `start_arc_m` of it, `lateral_m` to
    the left. It moves with `speed_mps` until, if it stops, it brakes with `decel_mps2` after
    `acts_after_s`.
    """

    name: str
    kind: RoadUserKind
    relation: Relation
    xy_m: Array
    start_arc_m: float
    lateral_m: float
    speed_mps: float
    conduct: Conduct
    acts_after_s: float
    decel_mps2: float
    hidden_by: str
    way: str
    """The connections or the line that it takes."""

    def start_on(self, way: Way) -> float:
        """Return where it starts on the way that it takes; its own path may begin before that."""
        return self.start_arc_m - (length(self.xy_m) - length(way.xy_m))

    def moving(self, path: FrenetPath) -> MovingBox:
        """Return it as it moves on a path unless something intervenes."""
        brakes = self.acts_after_s if self.conduct == "stops" else math.inf
        brisk = briskness(self.conduct, self.decel_mps2)
        box = moving_box(self.kind, path, self.speed_mps, brisk=brisk)
        return box._replace(
            offset_m=self.lateral_m, brakes_after_s=brakes, decel_mps2=self.decel_mps2
        )

    @property
    def traits(self) -> KindTraits:
        """Return the sizes and limits of its kind."""
        return KINDS[self.kind]


class StagedCase(NamedTuple):
    """All starts in one case, in the World's frame.

    The ego's base_link starts at `ego_arc_m` of its way, `ego_lateral_m` to its left. Where a touch
    is planned, an ego that keeps its speed touches the first road user after `impact_time_s` with
    its front's point `impact_share` at `impact_point_m` (2,); else the three are NaN.
    """

    place: ScenarioPlace
    values: Values
    actors: tuple[StagedActor, ...]
    ego_arc_m: float
    ego_lateral_m: float
    ego_speed_mps: float
    impact_time_s: float
    impact_point_m: Array
    impact_share: float
    impact_with: str
    off_lanes_m: float
    """How far beyond the World's lanes the ego or an actor starts, on a road prolonged."""
    meets_s: float
    """When the ego is where it touches the first road user, or would if that came on time; NaN
    where it meets nobody."""


@functools.lru_cache(maxsize=64)
def _pace(path: FrenetPath, speed_mps: float, brisk: float) -> Paces:
    return Paces([path], np.zeros(1, np.intp), np.array([speed_mps]), np.array([brisk]))


def moving_box(
    kind: RoadUserKind, path: FrenetPath, speed_mps: float, *, brisk: float = HEEDLESS_BRISKNESS
) -> MovingBox:
    """Return the box of a road user that drives along a path as it does on its own."""
    size, path = KINDS[kind], path.eased
    paces = _pace(path, speed_mps, brisk) if speed_mps > 0.0 else None
    return MovingBox(path, speed_mps, size.length_m, size.width_m, paces=paces)


class PlannedMeeting(NamedTuple):
    """Where the ego and an actor meet, and by which way the actor comes."""

    impact: Impact
    way: Way


class Staging(NamedTuple):
    """A case while it is staged: the ego's motion is known, and, once placed, its start."""

    scenario: Scenario
    values: Values
    place: ScenarioPlace
    ego: MovingBox
    start_m: float = 0.0

    def number(self, part: ActorPart, field: str) -> float:
        """Return a drawn number of an actor."""
        return self.values[f"{part.name}.{field}"]

    def actor(
        self, part: ActorPart, xy_m: Array, start_arc_m: float, lateral_m: float, way: str
    ) -> StagedActor:
        """Return an actor that starts on a path, led straight back where it starts before it."""
        if start_arc_m < _LEAST_ARC_M:
            # By whole steps: the nodes of the longer path are those of the shorter one.
            more = math.ceil((_LEAST_ARC_M - start_arc_m) / SPACING_M) * SPACING_M
            back = (xy_m[0] - xy_m[1]) / max(float(np.hypot(*(xy_m[0] - xy_m[1]))), 1e-9)
            xy_m = np.concatenate([(xy_m[0] + more * back)[None], xy_m])
            start_arc_m += more
        return StagedActor(
            name=part.name,
            kind=part.kind,
            relation=part.relation,
            xy_m=xy_m,
            start_arc_m=start_arc_m,
            lateral_m=lateral_m,
            speed_mps=0.0 if part.conduct == "parked" else self.number(part, "speed_mps"),
            conduct=part.conduct,
            acts_after_s=self.number(part, "acts_after_s"),
            decel_mps2=self.number(part, "decel_mps2"),
            hidden_by=part.hidden_by,
            way=way,
        )


_LEAST_ARC_M = 1.0
"""Paths begin behind whoever starts on them."""
