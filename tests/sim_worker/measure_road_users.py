"""Measure how hard the road users of swept cases brake, drive off and turn.

`python -m tests.sim_worker.measure_road_users [--cases N] [--seed S]` reads the maps of the folder
named by FORETWIN_DATA, left-hand ones among them, plays cases of the whole catalogue on junctions
drawn by the seed until N were played, and prints by scenario how many road users moved, how many of
them went beyond 0.8 g along or across, and the extremes; then the worst, by name and place, and how
many of the promised impacts happened. Two measures are taken of each, of what is recorded at every
control tick: from speed and heading, and from positions alone, 0.2 s apart.
"""

from __future__ import annotations

import argparse
import random
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.futures import Future, FuturesResult, Job, PathAhead
from foretwin.contracts.scenario import Scenario
from foretwin.contracts.world import World
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.playable import places, rehearsal_stage
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.futures.scene import SceneMaker
from foretwin.sim_worker.scenarios.drawing import Values, draw_cases
from foretwin.sim_worker.scenarios.places import ScenarioPlace
from foretwin.sim_worker.scenarios.reading import catalogue
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.data_maps import data_folder

MAPS = (
    "osm-berlin-mitte/berlin-mitte.osm",
    "osm-berlin-moritzplatz/berlin-moritzplatz.osm",
    "osm-kingsway/kingsway_junction.osm",
    "osm-leeds/leeds.osm.gz",
    "osm-austin-downtown/austin.osm.gz",
    "osm-monaco/monaco.osm.gz",
    "osm-badhersfeld/badhersfeld.osm.xml.gz",
)
G_MPS2 = 9.81
BOUND_MPS2 = 0.8 * G_MPS2
"""Tyres on dry asphalt give no more for long."""
TICK_S = 0.05
_WINDOW = 4
"""Ticks between the positions that second differences are taken of."""
_PLACES, _CASES = 2, 4
"""At most so many places of a scenario at a junction, and cases at each."""
_STEPS_ASIDE_MPS2 = 0.05
"""Above what a scenario asks of who stops, for the rounding of what is recorded."""


class Moved(NamedTuple):
    """One road user of one case: its greatest accelerations, and whether it did more than may be.

    `along_mps2` and `across_mps2` are of speed and heading, `jolt_mps2` of positions alone.
    """

    where: str
    scenario: str
    name: str
    along_mps2: float
    across_mps2: float
    jolt_mps2: float
    asked_mps2: float
    """What the scenario itself asks of it along its way, 0 for most."""

    @property
    def beyond(self) -> bool:
        """Return whether it goes beyond 0.8 g where nobody asked for it."""
        along = max(BOUND_MPS2, self.asked_mps2 + _STEPS_ASIDE_MPS2)
        return self.along_mps2 > along or self.across_mps2 > BOUND_MPS2


class Played(NamedTuple):
    """What came of a number of cases: their road users, and promised and kept impacts."""

    moved: tuple[Moved, ...]
    cases: int
    promised: int
    kept: int


def accelerations(poses: Array, speed_mps: Array, tick_s: float) -> tuple[Array, Array, Array]:
    """Return the greatest accelerations (R,) along, across, and of positions, in m/s².

    `poses` (N, R, 3) and `speed_mps` (N, R), NaN where a road user is not there.
    """
    yaw_rate = np.diff(np.unwrap(poses[..., 2], axis=0), axis=0) / tick_s
    along = np.abs(np.diff(speed_mps, axis=0)) / tick_s
    across = np.abs(yaw_rate) * (speed_mps[1:] + speed_mps[:-1]) / 2.0
    xy, w = poses[..., :2], _WINDOW
    second = (xy[2 * w :] - 2.0 * xy[w:-w] + xy[: -2 * w]) / (w * tick_s) ** 2
    found = (along, across, np.hypot(second[..., 0], second[..., 1]))
    along_m, across_m, jolt_m = (np.nanmax(np.nan_to_num(a), axis=0, initial=0.0) for a in found)
    return along_m, across_m, jolt_m


def worlds(data: Path, names: Sequence[str], seed: int) -> Iterator[tuple[str, World]]:
    """Yield junctions of the maps in turn, in an order drawn by the seed."""
    sources = []
    for name in names:
        osm = read_map(data / name)
        graph = build_road_graph(osm)
        junctions = list(find_intersections(osm, graph))
        index = index_map(osm, graph, junctions)
        random.Random(seed).shuffle(junctions)
        sources.append((name.split("/")[0], osm, graph, junctions, index))
    while any(junctions for *_, junctions, _ in sources):
        for name, osm, graph, junctions, index in sources:
            if junctions:
                junction = junctions.pop()
                yield name, build_world(osm, graph, junction, index=index)


def measure(data: Path, *, cases: int, seed: int, maps: Sequence[str] = MAPS) -> Played:
    """Play at least so many placed cases, fewer where the maps have no more."""
    moved: list[Moved] = []
    vehicle = load_vehicle()
    rehearsal = rehearsal_stage(vehicle)
    played = promised = kept = 0
    for name, world in worlds(data, maps, seed):
        maker = SceneMaker(world)
        stages: dict[int, BatchSimulation] = {}
        for scenario in catalogue().values():
            every = draw_cases(scenario)
            chosen = every[:: -(-len(every) // _CASES)]
            found = places(
                scenario, world, scenes=maker, stage=rehearsal, vehicle=vehicle, most=_PLACES
            ).places
            for place in found:
                if len(chosen) not in stages:
                    stages[len(chosen)] = BatchSimulation(
                        world, vehicle, nsim=len(chosen), control_hz=1.0 / TICK_S
                    )
                job = _job(scenario, chosen, place, world)
                result = run_job(job, stages[len(chosen)], scenes=maker)
                where = f"{name} {world.intersection.id} {place.name}"
                moved += _moved(scenario, where, result)
                played += len(result.future_indices)
                if result.planned is not None:
                    meant = [bool(met) for met in result.planned.met]
                    promised += sum(meant)
                    kept += int(np.sum(np.asarray(result.planned.off_m)[meant] <= 0.1))
        print(f"{name:24} {world.intersection.id:14} {played:5} cases", file=sys.stderr)
        if played >= cases:
            break
    return Played(tuple(moved), played, promised, kept)


def _job(scenario: Scenario, cases: Sequence[Values], place: ScenarioPlace, world: World) -> Job:
    planner = "reverse_pursuit" if place.reverse else "constant_speed"
    still: dict[str, Any] = dict.fromkeys(
        ("yaw_rad", "speed_mps", "yaw_rate_radps", "accel_mps2"), 0.0
    )
    return Job(
        round_id=0,
        job_index=0,
        world_id=world.id,
        state=VehicleState(vehicle_id="ego", stamp_ns=0, position=world.frame.origin, **still),
        path=PathAhead(xy_m=place.ego.xy_m, speed_limit_mps=place.ego.speed_limit_mps),
        futures=tuple(
            Future(
                index=i,
                name=f"{scenario.id} {i}",
                planner=planner,
                scenario_id=scenario.id,
                values=values,
                place=place.name,
            )
            for i, values in enumerate(cases)
        ),
        horizon_s=scenario.horizon_s,
        step_s=TICK_S,
        seed=0,
        cruise_speed_mps=cases[0]["ego.speed_mps"],
        scenarios=(scenario,),
        lights_by_plan=True,
        accidents=True,
        accident_motion=False,
        control_hz=1.0 / TICK_S,
    )


def _moved(scenario: Scenario, where: str, result: FuturesResult) -> Iterator[Moved]:
    tracks = result.road_users
    for row in range(len(result.future_indices)):
        poses = tracks.poses[row].astype(np.float64)
        speed = tracks.speed_mps[row].astype(np.float64)
        along, across, jolt = accelerations(poses, speed, TICK_S)
        for column, part in enumerate(scenario.actors):
            if part.conduct == "parked" or not np.isfinite(poses[0, column, 0]):
                continue
            asked = 0.0
            if part.conduct == "stops":
                value = part.decel_mps2
                asked = value if isinstance(value, float) else max(*value.values, value.max or 0.0)
            case = result.future_indices[row]
            yield Moved(
                f"{where} case {case}", scenario.id, part.name,
                float(along[column]), float(across[column]), float(jolt[column]), asked,
            )  # fmt: skip


def table(played: Played) -> str:
    """Return the figures as text."""
    lines = [f"{'scenario':22} {'users':>5} {'>.8 g':>5} {'>1 g':>5}  along across  jolt (m/s²)"]
    by: dict[str, list[Moved]] = {}
    for one in played.moved:
        by.setdefault(one.scenario, []).append(one)
    for name, ones in [*sorted(by.items()), ("all", list(played.moved))]:
        most = np.array([one[3:6] for one in ones]).max(axis=0)
        beyond = sum(one.beyond for one in ones)
        past_g = sum(max(one.along_mps2, one.across_mps2) > G_MPS2 for one in ones)
        figures = "  ".join(f"{value:5.1f}" for value in most)
        lines.append(f"{name:22} {len(ones):5} {beyond:5} {past_g:5}  {figures}")
    lines.append(f"{played.cases} cases, {played.kept} of {played.promised} promised impacts kept")
    worst = sorted(played.moved, key=lambda one: -max(one.along_mps2, one.across_mps2))[:10]
    lines += [
        f"{one.along_mps2:5.1f} along {one.across_mps2:5.1f} across: {one.scenario} {one.name}, "
        f"{one.where}"
        for one in worst
    ]
    return "\n".join(lines)


def main(arguments: Sequence[str]) -> int:
    """Measure and print; returns 3 where anybody goes beyond 0.8 g."""
    parser = argparse.ArgumentParser(prog="python -m tests.sim_worker.measure_road_users")
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args(arguments)
    played = measure(data_folder(), cases=asked.cases, seed=asked.seed)
    print(table(played))
    return 3 if any(one.beyond for one in played.moved) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
