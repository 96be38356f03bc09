"""Cases played by a car that does not intervene: it is hit where, and when, that was planned."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.futures import FuturesResult, Job
from foretwin.contracts.world import World
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.driven_line import arc_at, driven_lines, time_at
from foretwin.sim_worker.futures.ego_dry_run import (
    rehearsal_stage,
    rehearsed_cases,
    staged_cases,
)
from foretwin.sim_worker.futures.future_rows import future_rows
from foretwin.sim_worker.futures.playable import job_at
from foretwin.sim_worker.futures.result_digest import result_digest
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.futures.scene import SceneMaker
from foretwin.sim_worker.scenarios.reading import catalogue
from foretwin.sim_worker.scenarios.roles import StagedCase
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.scenarios.test_real_junctions import SMALL, worlds_of
from tests.sim_worker.scenarios.worlds import cross, motorway, places, race_track, ring

COVERS = (
    "foretwin.sim_worker.futures.driven_touch",
    "foretwin.sim_worker.futures.ego_alone",
    "foretwin.sim_worker.futures.driven_line",
    "foretwin.sim_worker.futures.planned_impacts",
    "foretwin.sim_worker.scenarios.staged",
)

CAR = load_vehicle()
NEAR_M = 0.1
CASES = 3
HEALTHY = (
    "scp", "ccftap", "cccscp", "cpta", "cbta", "ltap_od", "ltip", "rtip", "lead_stopping",
    "occluded_pedestrian", "emergency_vehicle",
)  # fmt: skip


class Played(NamedTuple):
    """A scenario played at its first place in a World: cases, result, and the job."""

    cases: list[StagedCase]
    result: FuturesResult
    job: Job


@functools.cache
def _stage(world_id: str) -> tuple[BatchSimulation, SceneMaker]:
    world = _WORLDS[world_id]
    return BatchSimulation(world, CAR, nsim=16), SceneMaker(world)


_WORLDS: dict[str, World] = {}


def play(world: World, scenario_id: str, planner: str = "constant_speed") -> Played | None:
    """Play a few cases where they are placed first; None where there is no place."""
    _WORLDS[world.id] = world
    stage, maker = _stage(world.id)
    scenario = catalogue()[scenario_id]
    found = places(scenario, world, most=1)
    if not found.places:
        return None
    cases = [case for case in found.cases[0] if isinstance(case, StagedCase)]
    cases = cases[:: -(-len(cases) // CASES)]
    job = job_at(found.places[0], scenario, [case.values for case in cases], world, planner=planner)
    job = msgspec.structs.replace(job, accidents=True)
    assert all(isinstance(case, StagedCase) for case in staged_cases(job, stage, maker).values())
    return Played(cases, run_job(job, stage, scenes=maker), job)


def off_m(played: Played, row: int) -> float:
    """How far the planned point of the ego's front is from its place as the touch comes."""
    case, result = played.cases[row], played.result
    accident = next(a for a in result.accidents if a.future == row)
    assert case.actors[accident.road_user].name == case.impact_with
    assert accident.time_s == pytest.approx(case.impact_time_s, abs=0.05)
    states = result.trajectory.states[row].astype(float)
    before = int(np.ceil(accident.time_s / 0.1 - 1e-6)) - 1
    point = _front(case, _moved(states[before], accident.time_s - 0.1 * before))
    return float(np.hypot(*(point - case.impact_point_m)))


def _moved(state: Array, since_s: float) -> Array:
    x, y, yaw, vx, vy, rate = state[:6]
    ahead = yaw + rate * since_s / 2.0
    x += (vx * np.cos(ahead) - vy * np.sin(ahead)) * since_s
    y += (vx * np.sin(ahead) + vy * np.cos(ahead)) * since_s
    return np.array([x, y, yaw + rate * since_s])


def _front(case: StagedCase, pose: Array) -> Array:
    ahead = CAR.length_m.value - CAR.rear_overhang_m.value
    left = case.place.near_sign * (case.impact_share - 0.5) * CAR.width_m.value
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    return np.array([pose[0] + ahead * cos - left * sin, pose[1] + ahead * sin + left * cos])


@pytest.mark.parametrize("scenario_id", HEALTHY)
def test_without_intervention_the_ego_is_hit_where_that_was_planned(scenario_id: str) -> None:
    played = play(cross(), scenario_id)
    assert played is not None
    planned = [row for row, case in enumerate(played.cases) if case.impact_with]
    assert planned
    assert max(off_m(played, row) for row in planned) <= NEAR_M


def test_traffic_on_the_left_is_met_as_well() -> None:
    played = play(cross(left_hand=True), "ccftap")
    assert played is not None
    assert max(off_m(played, row) for row in range(len(played.cases))) <= NEAR_M


def test_a_ring_is_entered_where_somebody_comes_round() -> None:
    played = play(ring(), "roundabout_entry")
    assert played is not None
    planned = [row for row, case in enumerate(played.cases) if case.impact_with]
    assert planned
    assert max(off_m(played, row) for row in planned) <= NEAR_M


def test_the_case_gives_the_start() -> None:
    played = play(cross(), "ccftap")
    assert played is not None
    for row, case in enumerate(played.cases):
        start = played.result.trajectory.states[row, 0]
        assert start[3] == pytest.approx(played.job.futures[row].values["ego.speed_mps"])
        pose = case.place.ego.path.pose_at(np.array([case.ego_arc_m]))
        assert start[:2] == pytest.approx(pose.xy_m[0], abs=1e-3)
        assert start[2] == pytest.approx(pose.yaw_rad[0], abs=1e-3)


def test_a_driven_line_begins_where_its_case_does() -> None:
    """Chords behind the start are shorter than the bend that they follow."""
    angle = np.linspace(0.0, 3.0, 200)
    bend = 15.0 * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])
    case = places(catalogue()["scp"], cross(), most=1).cases[0][0]
    assert isinstance(case, StagedCase)
    way = case.place.ego._replace(xy_m=bend, path=FrenetPath(bend))
    begun = case._replace(place=case.place._replace(ego=way), ego_arc_m=30.0)
    pose = way.path.pose_at(30.0 + 0.3 * np.arange(40.0))
    states = np.zeros((1, 40, 8))
    states[0, :, :2], states[0, :, 2], states[0, :, 3] = pose.xy_m, pose.yaw_rad, 6.0
    (line,) = driven_lines([begun], states, tick_s=0.05)
    assert line.arc_m[0] == pytest.approx(30.0, abs=1e-6)
    assert time_at(line, 30.0, 6.0) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("scenario_id", ["rtip", "cbta"])
def test_a_case_begins_whole_ticks_from_its_line(scenario_id: str) -> None:
    played = play(cross(), scenario_id)
    assert played is not None
    maker = _stage(cross().id)[1]
    lines = {ego.speed_mps: line for kept in maker.rehearsed.values() for ego, line in kept.items()}
    for case in played.cases:
        line = lines[case.ego_speed_mps]
        ticks = time_at(line, case.ego_arc_m, case.ego_speed_mps) * played.job.control_hz
        assert ticks == pytest.approx(round(ticks), abs=1e-6)
        arc_m = line.arc_m[len(line.arc_m) // 2]
        since_s = time_at(line, arc_m, case.ego_speed_mps)
        assert arc_at(line, since_s, case.ego_speed_mps) == pytest.approx(arc_m)


def test_lorries_are_come_up_to_on_a_motorway_and_slower_cars_on_a_race_track() -> None:
    for world, scenario_id in (
        (motorway(), "overtaking_motorway"),
        (race_track(), "race_track_lap"),
    ):
        played = play(world, scenario_id)
        assert played is not None
        assert not any(played.result.left_out)
        assert played.result.outcome.valid.all()
        assert (played.result.outcome.progress_m > 60.0).all()


def test_a_car_backs_into_its_bay_unless_somebody_walks_behind_it() -> None:
    played = play(cross(), "reversing_parking", "reverse_pursuit")
    assert played is not None
    states = played.result.trajectory.states
    assert (states[:, 5, 3] < -0.5).all()
    assert not played.result.outcome.collided.any()
    end = played.cases[0].place.ego.xy_m[-1]
    assert (np.hypot(*(states[:, -1, :2] - end).T) < 8.0).all()


def test_what_has_no_place_in_a_world_is_not_played_and_told() -> None:
    played = play(cross(), "scp")
    assert played is not None
    stage, maker = _stage(cross().id)
    lost = msgspec.structs.replace(played.job.futures[0], place="nowhere")
    job = msgspec.structs.replace(played.job, futures=(lost, *played.job.futures[1:]))
    result = run_job(job, stage, scenes=maker)
    ((index, reason),) = result.unplaced
    assert index == lost.index
    assert "no place 'nowhere'" in reason
    # To the others it is as if it had never been asked for.
    others = msgspec.structs.replace(job, futures=job.futures[1:])
    assert result_digest(result) == result_digest(run_job(others, stage, scenes=maker))
    nobody = run_job(msgspec.structs.replace(job, futures=(lost,)), stage, scenes=maker)
    assert nobody.future_indices == ()
    assert [i for i, _ in nobody.unplaced] == [lost.index]
    (row,) = future_rows(msgspec.structs.replace(job, futures=(lost,)), nobody, job_sha256="a" * 64)
    assert (row["left_out"], row.get("valid")) == (reason, None)


def test_another_maker_of_scenes_gives_the_same_bits() -> None:
    played = play(cross(), "ccftap")
    assert played is not None
    other = BatchSimulation(cross(), CAR, nsim=8)
    assert result_digest(run_job(played.job, other)) == result_digest(played.result)


def test_a_case_is_rehearsed_once_however_many_numbers_it_is_played_with(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    played = play(cross(), "ccftap")
    assert played is not None
    stage, maker = _stage(cross().id)
    seen: list[int] = []

    def counted(job: Job, *given: Any) -> Any:
        seen.append(len(job.futures))
        return staged_cases(job, *given)

    monkeypatch.setattr("foretwin.sim_worker.futures.ego_dry_run.staged_cases", counted)
    futures = tuple(
        msgspec.structs.replace(one, index=3 * k + n, numbers={"friction_factor": friction})
        for k, friction in enumerate((1.0, 0.4))
        for n, one in enumerate(played.job.futures)
    )
    job = msgspec.structs.replace(played.job, futures=futures)
    rehearsed = rehearsed_cases(job, CAR, maker)
    assert seen == [len(played.cases)] == [3]
    assert sorted(rehearsed) == list(range(6))
    each = staged_cases(job, rehearsal_stage(CAR, nsim=6), maker)
    for row, case in rehearsed.items():
        alone = each[row]
        assert isinstance(case, StagedCase)
        assert isinstance(alone, StagedCase)
        assert case.values == alone.values == job.futures[row].values
        assert (case.ego_arc_m, case.impact_time_s) == (alone.ego_arc_m, alone.impact_time_s)
    result = run_job(job, stage, scenes=maker)
    assert result.future_indices == tuple(range(6))


@pytest.mark.real_data
@pytest.mark.parametrize("name", ["berlin-mitte", "moritzplatz"])
def test_on_real_junctions_the_ego_is_hit_where_that_was_planned(data_dir: Path, name: str) -> None:
    off = []
    for world in worlds_of(data_dir / SMALL[name], most=2):
        for scenario_id in ("scp", "ccftap", "cpta", "ltip"):
            played = play(world, scenario_id)
            if played is None:
                continue
            planned = [row for row, case in enumerate(played.cases) if case.impact_with]
            off += [off_m(played, row) for row in planned]
    assert len(off) >= 10
    assert max(off) <= NEAR_M
