"""Cases as a real car meets them: cast on the line that it drives alone.

A car cuts and runs wide in bends, where its path is a line without inertia. So the ego drives
alone first, and who is to meet it is cast on the line that it left, at the time it came by. What
then does not fit its roads, meets what stands there, or misses its impact is no case that can be
played: placements, pictures and jobs all ask here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.futures import Job
from foretwin.contracts.scenario import EGO
from foretwin.contracts.trace import traced
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.slopes import slopes_of
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.driven_line import (
    KEEPS_SPEED,
    DrivenLine,
    arc_at,
    driven_lines,
    drives_as_cast,
    time_at,
)
from foretwin.sim_worker.futures.driven_touch import AFTER_S, met_as_driven
from foretwin.sim_worker.futures.ego_alone import drive_alone, felt_faults
from foretwin.sim_worker.futures.scene import SceneMaker
from foretwin.sim_worker.futures.swept_ground import met_on_the_way
from foretwin.sim_worker.scenarios.fitting import ill_timed, unfit
from foretwin.sim_worker.scenarios.places import Unplaced
from foretwin.sim_worker.scenarios.roles import ALONG, StagedActor, StagedCase
from foretwin.sim_worker.scenarios.ways import Way

_STRAIGHT_PM = 1e-3
"""On a line that bends no more, a car is where its path is."""
_RUN_UP_M = 10.0
"""Who starts so far before the first bend drives it as all do who come along there."""


class _Ego(NamedTuple):
    """How an ego drives alone; all egos of a job that do so share one line.

    It begins at `start_m`: where the case does, or, for all that come `in_time` before the path
    bends, at one place there. So what becomes of a case does not depend on those beside it.
    """

    speed_mps: float
    lateral_m: float
    reverse: bool
    faults: tuple[tuple[str, float], ...]
    in_time: bool
    start_m: float


def rehearsal_stage(
    vehicle: VehicleParameters, *, nsim: int = 32, control_hz: float = 20.0
) -> BatchSimulation:
    """Return a stage on which egos of any World drive alone: open ground, as what stands in a
    World is asked of the World itself, and who follows them drives on behind the impact."""
    return BatchSimulation(None, vehicle, nsim=nsim, control_hz=control_hz)


@traced("rehearse")
def rehearsed_cases(
    job: Job, vehicle: VehicleParameters, maker: SceneMaker
) -> dict[int, StagedCase | Unplaced]:
    """Return `staged_cases` on a stage made for a job, if any of its rows names a place.

    Rows that differ in numbers and planner alone are one case, and rehearsed once.
    """
    same: dict[tuple[object, ...], list[int]] = {}
    for row, future in enumerate(job.futures):
        if future.place:
            case = future.scenario_id, future.place, *sorted(future.values.items())
            same.setdefault(case, []).append(row)
    if not same:
        return {}
    first = [rows[0] for rows in same.values()]
    starts = None if job.starts is None else job.starts[first]
    futures = tuple(job.futures[row] for row in first)
    distinct = msgspec.structs.replace(job, futures=futures, starts=starts)
    stage = rehearsal_stage(vehicle, nsim=len(first), control_hz=job.control_hz)
    found = staged_cases(distinct, stage, maker)
    return {row: found[n] for n, rows in enumerate(same.values()) if n in found for row in rows}


def staged_cases(
    job: Job, stage: BatchSimulation, maker: SceneMaker
) -> dict[int, StagedCase | Unplaced]:
    """Return the cases of the rows that name their place, met where the car really drives.

    `stage` is a `rehearsal_stage`. A function of the job, as what it leads to: its drives are
    driven together, and kept for jobs that ask for the very same.
    """
    stage.slopes = slopes_of(maker.world)
    scenarios = {scenario.id: scenario for scenario in job.scenarios}
    played = maker.staged_cases(job, stage.vehicle)
    for row, case in played.items():
        if isinstance(case, StagedCase):
            reason = unfit(scenarios[job.futures[row].scenario_id], case)
            played[row] = _refused(case, reason) if reason else case
    bent = {
        row: case
        for row, case in played.items()
        if isinstance(case, StagedCase) and math.isfinite(case.meets_s) and _bends(case)
    }
    lines = _lines(job, bent, stage, maker) if bent else {}
    played |= _on_lines(job, bent, lines, stage, maker)
    for row, case in played.items():
        if isinstance(case, StagedCase):
            scenario = scenarios[job.futures[row].scenario_id]
            line = lines[_ego(bent[row])] if row in bent else None
            reason = ill_timed(scenario, case) or met_on_the_way(
                case, line, stage.vehicle, horizon_s=scenario.horizon_s
            )
            played[row] = _refused(case, reason) if reason else case
    return played


def _on_lines(
    job: Job,
    bent: Mapping[int, StagedCase],
    lines: Mapping[_Ego, DrivenLine],
    stage: BatchSimulation,
    maker: SceneMaker,
) -> dict[int, StagedCase | Unplaced]:
    """Return the cases of bent ways met on the lines that were driven, or why they are not."""
    groups: dict[tuple[str, str, _Ego], list[int]] = {}
    for row, case in bent.items():
        future = job.futures[row]
        groups.setdefault((future.scenario_id, future.place, _ego(case)), []).append(row)
    scenarios = {scenario.id: scenario for scenario in job.scenarios}
    found: dict[int, StagedCase | Unplaced] = {}
    on_time: dict[int, StagedCase] = {}
    for (scenario_id, place, ego), rows in groups.items():
        line = lines[ego]
        cases = [job.futures[row].values for row in rows]
        scenario, way = scenarios[scenario_id], line.way
        start_m = None if ego.in_time else ego.start_m
        again = maker.scenarios.cast(
            scenario, cases, place, stage.vehicle, ego_way=way, ego_arc_m=start_m
        )
        for row, met in zip(rows, again, strict=True):
            case = bent[row]
            if isinstance(met, Unplaced) or met.impact_with != case.impact_with:
                reason = f"{case.impact_with} is not met where a car really drives"
                found[row] = met if isinstance(met, Unplaced) else _refused(case, reason)
            elif not drives_as_cast(met, line, case.place.ego.path):
                speed = f"{3.6 * case.ego_speed_mps:.0f} km/h"
                found[row] = _refused(case, f"no car drives the ego's bends with {speed}")
            else:
                on_time[row] = _on_time(met, line, case.place.ego, tick_s=stage.control_dt_s)
    promised = {row: case for row, case in on_time.items() if case.impact_with}
    driven = {row: (case, lines[_ego(bent[row])]) for row, case in promised.items()}
    as_driven = met_as_driven(driven, stage)
    found |= on_time
    for row, case in promised.items():
        reason = f"driven, {case.impact_with} is not met by the point of the front that was planned"
        found[row] = as_driven.get(row) or _refused(case, reason)
    return found


def _refused(case: StagedCase, reason: str) -> Unplaced:
    return Unplaced(case.place.junction_id, reason, True)


def _ego(case: StagedCase) -> _Ego:
    path = case.place.ego.path
    bends = path.arc_m[(np.abs(path.curvature_pm) > _STRAIGHT_PM) & (path.arc_m > 0.0)]
    first_bend = float(bends.min(initial=np.inf))
    in_time = case.ego_arc_m < first_bend - _RUN_UP_M
    shift = case.values[f"{EGO}.lateral_shift_m"]
    start = first_bend - _RUN_UP_M if in_time else case.ego_arc_m
    faults = felt_faults(case.values)
    return _Ego(case.ego_speed_mps, shift, case.place.reverse, faults, in_time, start)


def _bends(case: StagedCase) -> bool:
    """Return whether the ego's path bends before it meets somebody."""
    path = case.place.ego.path
    until = case.ego_arc_m + case.ego_speed_mps * case.meets_s
    inside = (path.arc_m >= case.ego_arc_m - 1.0) & (path.arc_m <= until + 1.0)
    return bool(np.abs(path.curvature_pm[inside]).max(initial=0.0) > _STRAIGHT_PM)


def _lines(
    job: Job, bent: Mapping[int, StagedCase], stage: BatchSimulation, maker: SceneMaker
) -> dict[_Ego, DrivenLine]:
    """Return the line of each ego, all driven side by side."""
    first: dict[_Ego, StagedCase] = {}
    last_s = 0.0
    for case in bent.values():
        ego = _ego(case)
        first.setdefault(ego, case._replace(ego_arc_m=ego.start_m))
        until_s = case.meets_s + (case.ego_arc_m - ego.start_m) / case.ego_speed_mps
        last_s = max(last_s, until_s / (1.0 - KEEPS_SPEED))
    egos = sorted(first)
    ticks = math.ceil((last_s + AFTER_S) / stage.control_dt_s)
    way = first[egos[0]].place.ego
    key = (way.name, stage.vehicle.name, stage.control_dt_s, ticks, *egos)
    if key not in maker.rehearsed:
        cases = [first[ego] for ego in egos]
        states = drive_alone(job, cases, stage, maker, ticks)
        maker.rehearsed[key] = dict(
            zip(egos, driven_lines(cases, states, tick_s=stage.control_dt_s), strict=True)
        )
    lines: dict[_Ego, DrivenLine] = maker.rehearsed[key]
    return lines


def _on_time(case: StagedCase, line: DrivenLine, way: Way, *, tick_s: float) -> StagedCase:
    """Return a case, on the ego's path `way` again, in which those who come meet the ego when it
    really is there.

    It begins whole control ticks from its line: a car steers into a sharp bend some centimetres
    elsewhere where its ticks fall otherwise.
    """
    speed, met_m = case.ego_speed_mps, case.ego_arc_m + case.ego_speed_mps * case.meets_s
    from_s = round(time_at(line, case.ego_arc_m, speed) / tick_s) * tick_s
    start_m = arc_at(line, from_s, speed)
    later_s = time_at(line, met_m, speed) - from_s - case.meets_s
    ahead_m = start_m - case.ego_arc_m
    return case._replace(
        place=case.place._replace(ego=way),
        actors=tuple(_from_line(actor, later_s, ahead_m, line, way) for actor in case.actors),
        ego_arc_m=start_m,
        impact_time_s=case.impact_time_s + later_s,
        meets_s=case.meets_s + later_s,
    )


def _from_line(
    actor: StagedActor, later_s: float, ahead_m: float, line: DrivenLine, way: Way
) -> StagedActor:
    """Return an actor so much earlier; who drives along with the ego is so far ahead as that, and
    who stands stays there: the line and the ego's path are not the same in bends."""
    if actor.relation not in ALONG:
        box = actor.moving(FrenetPath(actor.xy_m))
        return actor._replace(start_arc_m=float(box.arc_after(actor.start_arc_m, -later_s)))
    along_m = ahead_m if actor.speed_mps > 0.0 else 0.0
    if actor.way != way.name:
        return actor._replace(start_arc_m=actor.start_arc_m + along_m)
    arc = np.array([actor.start_on(line.way) + along_m])
    aside_m = 0.0 if actor.speed_mps > 0.0 else actor.lateral_m
    place = way.path.locate(line.way.path.point_at(arc, aside_m), near_arc_m=arc)
    lateral_m = actor.lateral_m if actor.speed_mps > 0.0 else float(place.offset_m[0])
    return actor._replace(xy_m=way.xy_m, start_arc_m=float(place.arc_m[0]), lateral_m=lateral_m)
