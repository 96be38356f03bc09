"""`python -m tests.sim_worker.analysis.agreement.found_violations`: what of true failures is found.

A car leaves lanes of a real map to the right, by so much beyond the edge as drawn, or brakes by so
much, and is judged as a drive is: with what its source and its map leave open. Each row says, of
100 such windows, how many failed and how many were not observable; the others passed.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.provenance import Quantity
from foretwin.contracts.world import DRAWN_ATTRIBUTION, World
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.polyline import length
from foretwin.sim_worker.analysis.agreement.criteria import CRITERIA, CriteriaEvaluator, verdicts
from foretwin.sim_worker.analysis.agreement.doubt import WorldDoubt
from foretwin.sim_worker.analysis.agreement.judgement import word
from foretwin.sim_worker.analysis.agreement.window import Users, Window
from foretwin.sim_worker.metrics.ground import paved_areas, polygon_of
from foretwin.sim_worker.metrics.route_rules import RouteRules
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.sim_worker.analysis.agreement.test_jolts import braking, estimated
from tests.sim_worker.metrics.motions import LENGTH_M, VEHICLE, WIDTH_M, states_of_centre, times

MAP = "osm-berlin-moritzplatz/berlin-moritzplatz.osm"
BEYOND_M = (0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0)
DECELS_MPS2 = (3.0, 3.5, 4.5, 5.0, 5.5, 6.0, 7.0, 9.0)
SPEED_STDS_MPS = (0.02, 0.16, 0.3)
_TIME_S, _SPEED_MPS, _FINE_M = times(8.0), 7.0, 0.25
_NOISES = 50


class Known(NamedTuple):
    """What is known of a place and of the car: a World, its name, and the antenna's place."""

    name: str
    world: World
    antenna: bool


def places(data: Path) -> Iterator[Known]:
    """Yield the same Worlds, better and better known."""
    osm = read_map(data / MAP)
    graph = build_road_graph(osm)
    for junction in find_intersections(osm, graph)[:12]:
        plain = build_world(osm, graph, junction)
        counted = [msgspec.structs.replace(r, lane_count_source="tagged") for r in plain.roads]
        tagged = [
            msgspec.structs.replace(lane, width_m=Quantity(lane.width_m.value, "tagged"))
            for lane in plain.lanes
        ]
        driven = [msgspec.structs.replace(lane, position_source="driven") for lane in tagged]
        yield Known("as mapped, antenna anywhere", plain, False)
        yield Known("as mapped", plain, True)
        better = {"lanes counted": {"roads": tuple(counted)}}
        better["widths tagged"] = {"lanes": tuple(tagged)}
        better["widths tagged, lanes driven before"] = {"lanes": tuple(driven)}
        better["the very place"] = {"attribution": DRAWN_ATTRIBUTION}
        for name, values in better.items():
            yield Known(name, msgspec.structs.replace(plain, **values), True)


def leaving(world: World, beyond_m: float) -> Iterator[Array]:
    """Yield drives (81, 8) inside a World, along lanes at the right-hand edge, that leave the drawn
    ground so far."""
    reach_m = world.radius_m - 2.0 * LENGTH_M
    surface = shapely.union_all([polygon_of(area) for area in paved_areas(world)])
    shapely.prepare(surface)
    bump = np.exp(-0.5 * np.square((_TIME_S - 4.0) / 1.2))
    for lane in world.lanes:
        if lane.kind != "driving" or lane.right_id or length(lane.centerline) < 70.0:
            continue
        way = FrenetPath(np.asarray(lane.centerline))
        if np.hypot(*way.point_at(6.0 + _SPEED_MPS * _TIME_S).T).max() > reach_m:
            continue
        for aside_m in np.arange(0.0, 16.0, _FINE_M):
            xy = way.point_at(6.0 + _SPEED_MPS * _TIME_S, -aside_m * bump)
            yaw = np.unwrap(np.arctan2(*np.gradient(xy, axis=0).T[::-1]))
            along = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
            right = 0.5 * WIDTH_M * np.column_stack([along[:, 1], -along[:, 0]])
            ahead = 0.5 * LENGTH_M * along
            corners = np.concatenate([xy + right + ahead, xy + right - ahead])
            away_m = float(shapely.distance(surface, shapely.points(corners)).max())
            if abs(away_m - beyond_m) <= _FINE_M:
                yield states_of_centre(np.column_stack([xy, yaw]), _TIME_S)
                break
            if away_m > beyond_m:
                break


def said_of(known: Known, driven: Array, doubt: WorldDoubt) -> str:
    """Return the verdict of one drive on the drivable area."""
    nobody = Users(np.zeros((81, 0, 3)), np.zeros((81, 0)), np.zeros((0, 2)))
    window = Window(
        1, 0, "", known.world.id, _TIME_S, driven, nobody, driven, nobody, driven[:, :2], {}, False,
        0.05, np.full((81, 2), 0.02), 0.02, known.antenna, False,
    )  # fmt: skip
    rules = RouteRules(known.world, FrenetPath(driven[:, :2]))
    found = verdicts(window, CriteriaEvaluator(window, rules, doubt, VEHICLE)).driven
    at = CRITERIA.index("drivable_area")
    return word(bool(found.passes[at]), bool(found.fails[at]))


def print_row(name: str, told: dict[float, Counter[str]]) -> None:
    """Print one row of shares."""
    cells = []
    for counts in told.values():
        each = 100.0 / max(counts.total(), 1)
        cells.append(f"{each * counts['failed']:.0f}/{each * counts['not_observable']:.0f}")
    print(f"| {name} | " + " | ".join(cells) + " |")


def main() -> int:
    """Print the tables; exit code 2 where no map is named."""
    data = os.environ.get("FORETWIN_DATA")
    if not data:
        print("FORETWIN_DATA names no folder with maps", file=sys.stderr)
        return 2
    told: dict[str, dict[float, Counter[str]]] = {}
    for known in places(Path(data)):
        doubt = WorldDoubt(known.world)
        mine = told.setdefault(known.name, {beyond: Counter() for beyond in BEYOND_M})
        for beyond_m in BEYOND_M:
            for driven in leaving(known.world, beyond_m):
                mine[beyond_m][said_of(known, driven, doubt)] += 1
    print("| m beyond the drawn edge | " + " | ".join(f"{m:g}" for m in BEYOND_M) + " |")
    for name, counts in told.items():
        print_row(name, counts)
    print("windows: " + ", ".join(str(c.total()) for c in told["as mapped"].values()))
    print("| braking, m/s² | " + " | ".join(f"{a:g}" for a in DECELS_MPS2) + " |")
    for std_mps in SPEED_STDS_MPS:
        noise = np.random.default_rng(6).normal(0.0, std_mps, (_NOISES, 60))
        words = {a: Counter(estimated(braking(a), n, std_mps) for n in noise) for a in DECELS_MPS2}
        print_row(f"speed known to {std_mps:g} m/s", {a: Counter(w) for a, w in words.items()})
    return 0


if __name__ == "__main__":
    sys.exit(main())
