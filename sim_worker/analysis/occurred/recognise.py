"""Scenarios that really occurred in a drive, from its motion, its detections and its Worlds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from foretwin.contracts.drive import RoadUserKind
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.analysis.occurred.across_way import across_way
from foretwin.sim_worker.analysis.occurred.along_way import Encounter, along_way
from foretwin.sim_worker.analysis.occurred.driven_way import DrivenWay, runs_of
from foretwin.sim_worker.analysis.occurred.ego_manoeuvres import EgoStretch, ego_stretches
from foretwin.sim_worker.analysis.occurred.measures import finite, measures_of
from foretwin.sim_worker.analysis.occurred.preventable import Prevented, prevented
from foretwin.sim_worker.analysis.occurred.roads import Roads
from foretwin.sim_worker.analysis.occurred.rows import OPENLABEL, USER_TAGS, OccurredScenario
from foretwin.sim_worker.analysis.occurred.scene import (
    Detected,
    DrivenMotion,
    OtherCourse,
    courses_of,
)
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m

_LEAST_ROWS = 5
_INSTEAD = {
    "turns_into_path": ("cut_in",),
    "oncoming_turns_across": ("stationary_ahead",),
}
"""Who turns in from another road does not cut in as well."""


def recognise(
    ego: DrivenMotion,
    detected: Iterable[Detected],
    roads: Roads,
    *,
    vehicle: VehicleParameters,
) -> tuple[OccurredScenario, ...]:
    """Return what occurred, by when it began; nothing where the car never moved.

    Motion and detections are in the frame of `roads`; a drive with holes is looked at piece by
    piece.
    """
    courses = courses_of(detected, ego)
    found: list[OccurredScenario] = []
    for piece in runs_of(np.asarray(np.isfinite(ego.xy_m).all(axis=1))):
        if piece.stop - piece.start < _LEAST_ROWS:
            continue
        stamps, *motion = ego
        part = DrivenMotion(stamps[piece], *(column[piece] for column in motion))
        there = [c for course in courses if (c := cut_to(course, piece)) is not None]
        try:
            way = DrivenWay(
                part,
                centre_ahead_m=box_centre_from_base_m(vehicle),
                length_m=vehicle.length_m.value,
                width_m=vehicle.width_m.value,
            )
        except ValueError:
            continue
        found += _of_piece(way, roads, there, vehicle)
    return tuple(sorted(found, key=lambda row: (row.begin_ns, row.kind, row.other_id)))


def cut_to(course: OtherCourse, piece: slice) -> OtherCourse | None:
    """Return the part of a course within rows of the drive, counted from their first."""
    first = max(course.first, piece.start)
    after = min(course.first + len(course.xy_m), piece.stop)
    if after - first < _LEAST_ROWS:
        return None
    rows = slice(first - course.first, after - course.first)
    return course._replace(
        first=first - piece.start,
        xy_m=course.xy_m[rows],
        velocity_mps=course.velocity_mps[rows],
        yaw_rad=course.yaw_rad[rows],
        speed_mps=course.speed_mps[rows],
        standing=course.standing[rows],
    )


def _of_piece(
    way: DrivenWay, roads: Roads, courses: Sequence[OtherCourse], vehicle: VehicleParameters
) -> list[OccurredScenario]:
    own = ego_stretches(way, roads)
    across = across_way(way, courses)
    along = along_way(way, roads, courses)
    replaced = {(one.course.user_id, kind) for one in across for kind in _INSTEAD.get(one.kind, ())}
    met = [*across, *(m for m in along if (m.course.user_id, m.kind) not in replaced)]
    rows = [_own_row(way, one) for one in own]
    return rows + [_met_row(way, one, _junction(own, one), vehicle) for one in met]


def _junction(own: Sequence[EgoStretch], met: Encounter) -> str:
    """Return in which junction it was, as far as the car was in one then."""
    for one in own:
        if one.junction_id and one.first < met.after and met.first < one.after:
            return one.junction_id
    return ""


def _own_row(way: DrivenWay, one: EgoStretch) -> OccurredScenario:
    stamps = way.ego.stamp_ns
    return OccurredScenario(
        kind=one.kind,
        begin_ns=int(stamps[one.first]),
        end_ns=int(stamps[min(one.after, len(stamps)) - 1]),
        junction_id=one.junction_id,
        side=one.side,
        ego_speed_mps=float(way.ego.speed_mps[one.first]),
        tags=OPENLABEL[one.kind],
    )


def _met_row(
    way: DrivenWay, met: Encounter, junction_id: str, vehicle: VehicleParameters
) -> OccurredScenario:
    stamps, course = way.ego.stamp_ns, met.course
    first = int(np.clip(met.first, course.first, course.first + len(course.xy_m) - 1))
    on, own = way.see(course), first - course.first
    until = max(min(met.after, course.first + len(course.xy_m)) - course.first, own + 1)
    gaps = np.abs(on.gap_m[own:until])
    in_way = np.abs(on.left_m[own:until]) < way.half_m[1] + course.size_m[1] / 2.0
    ahead = gaps[in_way & (gaps > 0.0) & (gaps < 1e3)]
    measured = measures_of(way, met, vehicle)
    lead = way.path.yaw_at(on.arc_m[own : own + 1].copy())[0]
    along = float(course.velocity_mps[own] @ [np.cos(lead), np.sin(lead)])
    speed = float(way.ego.speed_mps[first])
    tags = (*OPENLABEL[met.kind], *_user_tag(course.kind))
    return OccurredScenario(
        kind=met.kind,
        begin_ns=int(stamps[first]),
        end_ns=int(stamps[min(met.after, len(stamps)) - 1]),
        junction_id=junction_id,
        other_id=course.user_id,
        other_kind=course.kind,
        side=met.side,
        ego_speed_mps=speed,
        other_speed_mps=float(course.speed_mps[own]),
        gap_m=float(ahead.min()) if len(ahead) else None,
        closing_mps=speed - along,
        ttc_s=measured.ttc_s,
        pet_s=measured.pet_s,
        drac_mps2=measured.drac_mps2,
        time_headway_s=measured.time_headway_s,
        beyond=measured.beyond,
        **_drivers(prevented(way, met)),
        tags=tags,
    )


def _drivers(found: Prevented | None) -> dict[str, Any]:
    if found is None:
        return {}
    return {
        "careful_prevents": found.careful,
        "careful_gap_m": finite(found.careful_least_gap_m),
        "fuzzy_prevents": found.fuzzy,
        "fuzzy_gap_m": finite(found.fuzzy_least_gap_m),
    }


def _user_tag(kind: RoadUserKind) -> tuple[str, ...]:
    return (USER_TAGS[kind],) if kind in USER_TAGS else ()
