"""Plays what foretwin calls placed on a map's junctions, and judges each case."""

from __future__ import annotations

import math
import random
import time
from collections.abc import Collection
from pathlib import Path
from typing import NamedTuple

import msgspec

from foretwin.contracts.futures import Job
from foretwin.contracts.world import World
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.ego_dry_run import rehearsal_stage
from foretwin.sim_worker.futures.playable import job_at, places
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.futures.scene import SceneMaker
from foretwin.sim_worker.scenarios.drawing import Values
from foretwin.sim_worker.scenarios.reading import catalogue
from foretwin.sim_worker.scenarios.roles import StagedCase
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.placed.played_case import Around, Verdict, judged
from tests.placed.raw_map import RawMap

RADIUS_M = 150.0
CASES = 3
"""Of one place, evenly among those that are drawn."""


class PlayedCase(NamedTuple):
    """A placed case of a scenario at a junction, and what became of it."""

    scenario_id: str
    junction_id: str
    place: str
    values: Values
    verdict: Verdict


class PlayedJunction(NamedTuple):
    """What was placed at one junction and played; `unplaced` by scenario; seconds of placing."""

    junction_id: str
    osm_nodes: tuple[int, ...]
    placed: tuple[str, ...]
    played: tuple[PlayedCase, ...]
    unplaced: dict[str, tuple[str, bool]]
    placing_s: float


class PlayedMap(NamedTuple):
    """The junctions of a map that were looked at, and the nodes of all that foretwin knows."""

    junctions: tuple[PlayedJunction, ...]
    known_nodes: frozenset[int]


def played_map(
    file: Path,
    raw: RawMap,
    *,
    most: int | None,
    seed: int = 7,
    kind: str | None = None,
    part: tuple[int, ...] = (1, 1),
    at: Collection[int] | None = None,
    only: Collection[str] | None = None,
) -> PlayedMap:
    """Place and play the catalogue, or `only` some scenarios, on all junctions of a map, or of a
    kind, or `at` some nodes, or `most` of them."""
    osm = read_map(file)
    graph = build_road_graph(osm)
    junctions = find_intersections(osm, graph)
    index = index_map(osm, graph, junctions)
    known = frozenset(node for junction in junctions for node in junction.summary.osm_nodes)
    if kind is not None:
        junctions = [junction for junction in junctions if junction.summary.kind == kind]
    if at is not None:
        junctions = [one for one in junctions if not set(at).isdisjoint(one.summary.osm_nodes)]
    if most is not None and most < len(junctions):
        junctions = tuple(random.Random(seed).sample(list(junctions), most))
    junctions = junctions[part[0] - 1 :: part[1]]
    rehearsal, played = rehearsal_stage(load_vehicle()), []
    for junction in junctions:
        world = build_world(osm, graph, junction, radius_m=RADIUS_M, index=index)
        origin = world.frame.origin
        around = Around.of(raw, origin.lat_deg, origin.lon_deg)
        played.append(played_world(world, rehearsal, around, only=only))
    return PlayedMap(tuple(played), known)


def played_world(
    world: World,
    rehearsal: BatchSimulation,
    around: Around,
    *,
    only: Collection[str] | None = None,
) -> PlayedJunction:
    """Place the catalogue at a World's junction and play a few cases of each scenario."""
    vehicle = rehearsal.vehicle
    stage, maker = BatchSimulation(world, vehicle, nsim=CASES), SceneMaker(world)
    played: list[PlayedCase] = []
    placed: list[str] = []
    unplaced: dict[str, tuple[str, bool]] = {}
    spent_s = 0.0
    for scenario in catalogue().values():
        if only and scenario.id not in only:
            continue
        start = time.perf_counter()
        found = places(scenario, world, scenes=maker, stage=rehearsal, most=1)
        spent_s += time.perf_counter() - start
        for why in found.unplaced:
            unplaced[scenario.id] = why.reason, why.applies
        for place, staged in zip(found.places, found.cases, strict=True):
            placed.append(scenario.id)
            cases = [case for case in staged if isinstance(case, StagedCase)]
            cases = cases[:: -(-len(cases) // CASES)]
            job = _heedless(job_at(place, scenario, [case.values for case in cases], world))
            result = run_job(job, stage, scenes=maker)
            for row, case in enumerate(cases):
                verdict = Verdict(bool(case.impact_with), math.nan, ("unplaced when played",))
                if row in result.future_indices:
                    at = result.future_indices.index(row)
                    verdict = judged(scenario, case, result, at, vehicle, around)
                played.append(
                    PlayedCase(scenario.id, place.junction_id, place.name, case.values, verdict)
                )
    here = world.intersection
    return PlayedJunction(here.id, here.osm_nodes, tuple(placed), tuple(played), unplaced, spent_s)


def _heedless(job: Job) -> Job:
    """Return a job driven by who looks at nobody, backwards as well, and whose impacts are told."""
    futures = job.futures
    if job.scenarios[0].ego.reverse:
        unseen = {"faults.lost_from_s": 0.0, "faults.lost_for_s": 60.0}
        futures = tuple(
            msgspec.structs.replace(one, planner="reverse_pursuit", values=one.values | unseen)
            for one in futures
        )
    return msgspec.structs.replace(job, futures=futures, accidents=True)
