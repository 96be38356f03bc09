"""The ground that a case's participants sweep, and what of the World stands on it."""

from __future__ import annotations

import math

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.rectangles import Rectangles, overlapping
from foretwin.sim_worker.batch.collision_detection import ego_rectangles
from foretwin.sim_worker.futures.driven_line import DrivenLine, time_at
from foretwin.sim_worker.scenarios.impact import ego_box
from foretwin.sim_worker.scenarios.roles import ALONG, StagedCase

_EVERY_S = 0.1
_LONGEST_STEP_M = 1.0
"""Boxes are laid no farther apart: a vehicle is longer."""


def met_on_the_way(
    case: StagedCase, line: DrivenLine | None, vehicle: VehicleParameters, *, horizon_s: float
) -> str:
    """Return who of a case begins in, or would go through, what stands in the World, or whom the
    ego would touch that is parked, before the impact, or, where none is planned, before the end;
    nothing where all ways are free.

    The ego is where it drove, by its `line`, or else on its path.
    """
    walls = case.place.walls
    end_s = case.impact_time_s if case.impact_with else horizon_s
    fastest = max(case.ego_speed_mps, *(a.speed_mps for a in case.actors), 0.0)
    count = math.ceil(max(end_s / _EVERY_S, end_s * fastest / _LONGEST_STEP_M)) + 1
    time_s = np.linspace(0.0, end_s, count)
    ego = _ego_boxes(case, line, vehicle, time_s)
    for actor in case.actors:
        if actor.relation == "parked" and actor.name != case.impact_with:
            way = case.place.way_named(actor.way)
            stands_m = np.full(count, actor.start_on(way))
            if overlapping(ego, actor.moving(way.path).rectangles(stands_m)).any():
                return f"the ego would touch {actor.name} on its way"
    if walls is None:
        return ""
    met = walls.first_met(ego, drives=not case.place.reverse)
    if met is not None:
        return _words("the ego", met, case.place.reverse)
    for actor in case.actors:
        way = case.place.way_named(actor.way)
        if actor.relation in ALONG and actor.lateral_m == 0.0 and not case.impact_with:
            # Who leads or follows the ego goes where it goes, for longer than is looked at.
            continue
        box = actor.moving(way.path)
        boxes = box.rectangles(box.arc_after(actor.start_on(way), time_s))
        drives = actor.speed_mps > 0.0 and actor.kind not in ("pedestrian", "bicycle")
        if (met := walls.first_met(boxes, drives=drives)) is not None:
            return _words(actor.name, met, False)
    return ""


def _words(who: str, met: int, into_bay: bool) -> str:
    if met == 0:
        return f"{who} would begin in what stands there"
    return f"{who} would touch what stands {'beside the bay' if into_bay else 'in its way'}"


def _ego_boxes(
    case: StagedCase, line: DrivenLine | None, vehicle: VehicleParameters, time_s: Array
) -> Rectangles:
    path, speed, reverse = case.place.ego.path, case.ego_speed_mps, case.place.reverse
    box = ego_box(vehicle, path, speed, case.ego_lateral_m, reverse=reverse)
    on_path = box.rectangles(case.ego_arc_m + speed * time_s)
    if line is None:
        return on_path
    line_s = time_at(line, case.ego_arc_m, speed) + time_s
    ticks = np.minimum(np.searchsorted(line.time_s, line_s), len(line.states) - 1)
    driven = ego_rectangles(vehicle, line.states[ticks])
    # Before its line begins, it comes along its path.
    came = line_s < 0.0
    return driven._replace(
        centre_m=np.where(came[:, None], on_path.centre_m, driven.centre_m),
        yaw_rad=np.where(came, on_path.yaw_rad, driven.yaw_rad),
    )
