"""The junctions that a route meets, once per passage, and where on the route their centres are."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.orchestrator.routing.road_index import project
from foretwin.orchestrator.routing.route import Route
from foretwin.world_gen.junctions.intersections import Junction


class UpcomingJunction(NamedTuple):
    """A junction ahead; distances run along the route to the junction's centre."""

    junction: Junction
    distance_m: float


class PassedJunction(NamedTuple):
    """A junction on the route: where its centre is passed, its first node and its last."""

    junction: Junction
    centre_s_m: float
    from_m: float
    to_m: float


def same_passage_m(junction: Junction) -> float:
    """Return how far apart two of a junction's nodes may lie on a way that passes it once."""
    return max(40.0, 2.0 * junction.radius_m)


def encounters(route: Route, junction_at: Mapping[int, Junction]) -> Iterator[PassedJunction]:
    """Yield the junctions on a route with the position s of their centres, once per passage."""
    nodes = [route.edges[0].start_node, *(directed.end_node for directed in route.edges)]
    current: Junction | None = None
    first = last = 0
    for number, node in enumerate(nodes):
        junction = junction_at.get(node)
        if junction is None:
            continue
        if current is not None:
            gap_m = float(route.start_m[number] - route.start_m[last])
            same = junction.summary.id == current.summary.id
            if same and gap_m <= same_passage_m(current):
                last = number
                continue
            yield _passage(route, current, first, last)
        current, first, last = junction, number, number
    if current is not None:
        yield _passage(route, current, first, last)


def _passage(route: Route, junction: Junction, first: int, last: int) -> PassedJunction:
    from_m, to_m = float(route.start_m[first]), float(route.start_m[last])
    return PassedJunction(junction, _centre_s(route, junction, first, last), from_m, to_m)


def _centre_s(route: Route, junction: Junction, first: int, last: int) -> float:
    """Return where the route between two of a junction's nodes is nearest to its centre."""
    best = (math.inf, float(route.start_m[first]))
    centre: Array = np.asarray(junction.centre_xy_m, dtype=np.float64)
    for place in range(first, last):
        near = project(route.edges[place], centre)
        best = min(best, (near.distance_m, float(route.start_m[place]) + near.s_m))
    return best[1]
