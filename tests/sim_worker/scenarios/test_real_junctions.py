"""The catalogue on a sample of real junctions; `tests.placed` judges whole maps."""

from __future__ import annotations

import collections
import random
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from foretwin.contracts.world import World
from foretwin.sim_worker.futures.ego_dry_run import rehearsal_stage
from foretwin.sim_worker.futures.playable import places
from foretwin.sim_worker.futures.scene import SceneMaker
from foretwin.sim_worker.scenarios.casting import StagedCase, cast
from foretwin.sim_worker.scenarios.drawing import draw_cases
from foretwin.sim_worker.scenarios.reading import catalogue
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.sim_worker.scenarios.test_casting import check_impact

pytestmark = pytest.mark.real_data

SMALL = {
    "berlin-mitte": "osm-berlin-mitte/berlin-mitte.osm",
    "moritzplatz": "osm-berlin-moritzplatz/berlin-moritzplatz.osm",
    "kingsway": "osm-kingsway/kingsway_junction.osm",
}
LEAST_SHARE = 0.95
Counts = dict[str, collections.Counter[str]]


def worlds_of(file: Path, *, most: int | None = None) -> Iterator[World]:
    osm = read_map(file)
    graph = build_road_graph(osm)
    junctions: Sequence = find_intersections(osm, graph)
    index = index_map(osm, graph, junctions)
    if most is not None:
        junctions = random.Random(4).sample(junctions, min(most, len(junctions)))
    for junction in junctions:
        yield build_world(osm, graph, junction, index=index)


def count(
    world: World, counts: Counts, reasons: Counts, *, check: bool, most_cases: int = 3
) -> None:
    """Place the whole catalogue on a World's junction; `check` plays its cases as well."""
    vehicle, scenes = load_vehicle(), SceneMaker(world)
    stage = rehearsal_stage(vehicle)
    for id_, scenario in catalogue().items():
        result = places(scenario, world, scenes=scenes, stage=stage, most=1)
        counts[id_]["placed"] += len(result.places)
        for unplaced in result.unplaced:
            counts[id_]["unplaced" if unplaced.applies else "elsewhere"] += 1
            reasons[id_][unplaced.reason] += 1
            assert unplaced.reason
        for place in result.places if check else ():
            cases = draw_cases(scenario)
            for values in cases[:: -(-len(cases) // most_cases)]:
                case = cast(scenario, values, place, vehicle=vehicle)
                counts[id_]["cases"] += 1
                counts[id_]["cast"] += isinstance(case, StagedCase)
                if isinstance(case, StagedCase) and case.impact_with:
                    check_impact(case)


def test_the_catalogue_is_placed_on_a_sample_of_real_junctions(data_dir: Path) -> None:
    counts: Counts = collections.defaultdict(collections.Counter)
    reasons: Counts = collections.defaultdict(collections.Counter)
    for file in SMALL.values():
        for world in worlds_of(data_dir / file, most=2):
            count(world, counts, reasons, check=True, most_cases=1)
    placed = sum(c["placed"] for c in counts.values())
    unplaced = sum(c["unplaced"] for c in counts.values())
    assert placed >= 55
    assert placed >= LEAST_SHARE * (placed + unplaced), dict(reasons)
    assert sum(c["cast"] for c in counts.values()) >= 0.95 * sum(
        c["cases"] for c in counts.values()
    )
