"""Cases as a real car meets them: cast on the line that it drives alone.

A car cuts and runs wide in bends, where its path is a line without inertia. So the ego drives
alone first, and who is to meet it is cast on the line that it left, at the time it came by.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.futures import Future, Job
from foretwin.contracts.scenario import EGO
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.batch.collision_detection import first_touches
from foretwin.sim_worker.futures.closed_loop import drive
from foretwin.sim_worker.futures.driven_line import (
    DrivenLine,
    driven_lines,
    drives_as_cast,
    time_at,
)
from foretwin.sim_worker.futures.scene import SceneMaker
from foretwin.sim_worker.scenarios.impact import ego_box
from foretwin.sim_worker.scenarios.places import Unplaced
from foretwin.sim_worker.scenarios.roles import ALONG, StagedActor, StagedCase
from foretwin.sim_worker.scenarios.staged import staged_start
from foretwin.sim_worker.scenarios.ways import Way

_FORWARDS, _BACKWARDS = "constant_speed", "reverse_pursuit"
_STRAIGHT_PM = 1e-3
"""On a line that bends no more, a car is where its path is."""
_RUN_UP_M = 10.0
"""Who starts so far before the first bend drives it as all do who come along there."""
_NEAR_M = 0.07
"""From an impact to its plan, where one is promised: within 0.1 m however control ticks fall."""
_WATCHED_S = 1.0
"""Before it, one who drives alone is looked at for touches."""
_AFTER_S = 1.0
"""Lines go on for so long after the last impact."""


class _Ego(NamedTuple):
    """How an ego drives alone; all egos of a job that do so share one line.

    Where they start matters from where the path bends on; before it, `start_m` is None.
    """

    speed_mps: float
    lateral_m: float
    reverse: bool
    start_m: float | None


def staged_cases(
    job: Job, stage: BatchSimulation, maker: SceneMaker
) -> dict[int, StagedCase | Unplaced]:
    """Return the cases of the rows that name their place, met where the car really drives.

    A function of the job, as what it leads to: the drives of one job are driven together, and kept
    for jobs that ask for the very same.
    """
    played = maker.staged_cases(job, stage.vehicle)
    bent = {
        row: case
        for row, case in played.items()
        if isinstance(case, StagedCase) and math.isfinite(case.impact_time_s) and _bends(case)
    }
    if not bent:
        return played
    lines = _lines(job, bent, stage, maker)
    groups: dict[tuple[str, str, _Ego], list[int]] = {}
    for row, case in bent.items():
        future = job.futures[row]
        groups.setdefault((future.scenario_id, future.place, _ego(case)), []).append(row)
    scenarios = {scenario.id: scenario for scenario in job.scenarios}
    on_time: dict[int, StagedCase] = {}
    for (scenario_id, place, ego), rows in groups.items():
        line = lines[ego]
        cases = [job.futures[row].values for row in rows]
        scenario, way = scenarios[scenario_id], line.way
        again = maker.scenarios.cast(
            scenario, cases, place, stage.vehicle, ego_way=way, ego_arc_m=ego.start_m
        )
        for row, met in zip(rows, again, strict=True):
            # Where no car can drive like that, there is no time of an impact.
            played[row] = _unplanned(bent[row])
            meant = bent[row].impact_with
            if (
                isinstance(met, StagedCase)
                and met.impact_with == meant
                and drives_as_cast(met, line, bent[row].place.ego.path)
            ):
                on_time[row] = _on_time(met, line, bent[row].place.ego)
    off_m = _off_m(on_time, lines, bent, stage)
    played |= {row: case for row, case in on_time.items() if off_m[row] <= _NEAR_M}
    return played


def _off_m(
    cases: Mapping[int, StagedCase],
    lines: Mapping[_Ego, DrivenLine],
    bent: Mapping[int, StagedCase],
    stage: BatchSimulation,
) -> dict[int, float]:
    """Return how far from their plans impacts are, as it was driven, by row."""
    rows = list(cases)
    if not rows:
        return {}
    tick_s = stage.control_dt_s
    states, users, sizes = [], [], []
    for row in rows:
        case, line = cases[row], lines[_ego(bent[row])]
        from_s = time_at(line, case.ego_arc_m, case.ego_speed_mps)
        first = max(math.ceil((from_s + case.impact_time_s - _WATCHED_S) / tick_s), 0)
        ticks = first + np.arange(round((_WATCHED_S + _AFTER_S / 2.0) / tick_s))
        ticks = np.minimum(ticks, len(line.states) - 1)
        actor = next(a for a in case.actors if a.name == case.impact_with)
        way = case.place.way_named(actor.way)
        box = actor.moving(way.path)
        since_s = np.asarray(ticks * tick_s - from_s, dtype=np.float64)
        at = box.rectangles(actor.start_on(way) + box.travelled_m(since_s))
        states.append(line.states[ticks])
        users.append(np.column_stack([at.centre_m, at.yaw_rad])[:, None])
        sizes.append([(box.length_m, box.width_m)])
    touches = first_touches(
        stage.vehicle, np.stack(states), np.stack(users), np.array(sizes), tick_s=tick_s
    )
    off = dict.fromkeys(rows, math.inf)
    for future, state in zip(touches.future.tolist(), touches.ego_states, strict=True):
        off[rows[future]] = off_plan_m(cases[rows[future]], state, stage.vehicle)
    return off


def off_plan_m(case: StagedCase, state: Array, vehicle: VehicleParameters) -> float:
    """Return how far the point of the ego that is to be hit is from where that is planned, with
    base_link in a state (8,)."""
    box = ego_box(vehicle, case.place.ego.path, 0.0, reverse=case.place.reverse)
    yaw = float(state[2]) + (math.pi if case.place.reverse else 0.0)
    cos, sin = math.cos(yaw), math.sin(yaw)
    left = case.place.near_sign * (case.impact_share - 0.5) * box.width_m
    x = float(state[0]) + box.front_m * cos - left * sin - float(case.impact_point_m[0])
    y = float(state[1]) + box.front_m * sin + left * cos - float(case.impact_point_m[1])
    return math.hypot(x, y)


def _ego(case: StagedCase) -> _Ego:
    path = case.place.ego.path
    bends = path.arc_m[(np.abs(path.curvature_pm) > _STRAIGHT_PM) & (path.arc_m > 0.0)]
    in_time = case.ego_arc_m < bends.min(initial=np.inf) - _RUN_UP_M
    shift = case.values[f"{EGO}.lateral_shift_m"]
    start = None if in_time else case.ego_arc_m
    return _Ego(case.ego_speed_mps, shift, case.place.reverse, start)


def _bends(case: StagedCase) -> bool:
    """Return whether the ego's path bends before the impact."""
    path = case.place.ego.path
    until = case.ego_arc_m + case.ego_speed_mps * case.impact_time_s
    inside = (path.arc_m >= case.ego_arc_m - 1.0) & (path.arc_m <= until + 1.0)
    return bool(np.abs(path.curvature_pm[inside]).max(initial=0.0) > _STRAIGHT_PM)


def _lines(
    job: Job, bent: Mapping[int, StagedCase], stage: BatchSimulation, maker: SceneMaker
) -> dict[_Ego, DrivenLine]:
    """Return the line of each ego, all driven side by side."""
    first: dict[_Ego, StagedCase] = {}
    for case in bent.values():
        ego = _ego(case)
        if ego not in first or case.ego_arc_m < first[ego].ego_arc_m:
            first[ego] = case
    egos = sorted(first, key=lambda ego: (ego[:3], ego.start_m or 0.0))
    last_s = max(
        case.impact_time_s + (case.ego_arc_m - first[_ego(case)].ego_arc_m) / case.ego_speed_mps
        for case in bent.values()
    )
    ticks = math.ceil((last_s + _AFTER_S) / stage.control_dt_s)
    way = first[egos[0]].place.ego
    starts = ((ego, first[ego].ego_arc_m) for ego in egos)
    key = (way.name, stage.vehicle.name, stage.control_dt_s, ticks, *starts)
    if key not in maker.rehearsed:
        cases = [first[ego] for ego in egos]
        states = _drive_alone(job, cases, stage, maker, ticks)
        maker.rehearsed[key] = dict(
            zip(egos, driven_lines(cases, states, tick_s=stage.control_dt_s), strict=True)
        )
    lines: dict[_Ego, DrivenLine] = maker.rehearsed[key]
    return lines


def _drive_alone(
    job: Job, cases: list[StagedCase], stage: BatchSimulation, maker: SceneMaker, ticks: int
) -> Array:
    """Return states (S, T, 8) of egos without other road users."""
    futures = tuple(
        Future(
            index=index,
            name="alone",
            planner=_BACKWARDS if case.place.reverse else _FORWARDS,
            values={f"{EGO}.speed_mps": case.ego_speed_mps},
        )
        for index, case in enumerate(cases)
    )
    same = ("round_id", "job_index", "world_id", "state", "path", "step_s", "seed")
    given: dict[str, Any] = {name: getattr(job, name) for name in same}
    alone = Job(
        **given,
        futures=futures,
        horizon_s=ticks * stage.control_dt_s,
        cruise_speed_mps=0.0,
        starts=np.stack([staged_start(case, stage.vehicle) for case in cases]),
    )
    near = np.array([case.ego_arc_m for case in cases])
    scene = maker.scene(alone, stage.vehicle, tick_s=stage.control_dt_s, start_arc_m=near)
    return drive(scene._replace(limit_share=None), stage, ticks=ticks).states


def _on_time(case: StagedCase, line: DrivenLine, way: Way) -> StagedCase:
    """Return a case, on the ego's path `way` again, in which those who come meet the ego when it
    really is there."""
    met_m = case.ego_arc_m + case.ego_speed_mps * case.impact_time_s
    from_s, to_s = (time_at(line, arc, case.ego_speed_mps) for arc in (case.ego_arc_m, met_m))
    later_s = (to_s - from_s) - case.impact_time_s
    return case._replace(
        place=case.place._replace(ego=way),
        actors=tuple(_from_line(actor, later_s, line, way) for actor in case.actors),
        impact_time_s=case.impact_time_s + later_s,
    )


def _from_line(actor: StagedActor, later_s: float, line: DrivenLine, way: Way) -> StagedActor:
    if actor.relation not in ALONG:
        return actor._replace(start_arc_m=actor.start_arc_m - actor.speed_mps * later_s)
    if actor.way != way.name:
        return actor
    arc = np.array([actor.start_on(line.way)])
    place = way.path.locate(line.way.path.point_at(arc), near_arc_m=arc)
    return actor._replace(xy_m=way.xy_m, start_arc_m=float(place.arc_m[0]))


def _unplanned(case: StagedCase) -> StagedCase:
    nowhere = np.full(2, math.nan)
    return case._replace(
        impact_time_s=math.nan, impact_point_m=nowhere, impact_share=math.nan, impact_with=""
    )
