"""How far roads lie beside where the map has them, from where lanes were driven."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import msgspec
import numpy as np
import scipy.sparse
import scipy.sparse.linalg

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import arc_lengths, length, points_at
from foretwin.world_gen.driven.matching import MAP_ERROR_M
from foretwin.world_gen.driven.passes import STEP_M
from foretwin.world_gen.roads.road_graph import RoadEdge

MAP_ALIKE_M = 40.0
"""How far along a road the error of a way's place, `MAP_ERROR_M`, stays. Chosen."""
PASS_ERROR_M, PASS_ALIKE_M = 0.4, 10.0
"""The same of how a driver keeps the middle of a lane. Chosen."""
RECEIVER_ALIKE_M = 60.0
"""How far along a road the error of a receiver stays. Chosen: some seconds in a town."""
_SMOOTH_M = 10.0
"""Shorter waves of a pass are the driver's, not the road's."""
_ROBUST_M = 0.5
"""Residuals beyond this, or the receiver's own error, count linearly (Huber, 1964): swerves."""
_ROUNDS = 5
_SPACING_M = 6.0
WIDTH_ERROR = 0.1
"""Standard deviation of a lane's width by class, as a share: 0.3 m of 3 m. Chosen."""
_MOST_WIDER = 0.25
_WIDTH_ROUNDS = 3
_LANE_SEEN_M = 40.0
LEAST_M = 0.02
"""Roads that would move less stay where the map has them."""


class Seen(NamedTuple):
    """At metres along an edge, its road lies `away_m` to the side `across` (2,).

    It was seen from a lane that lies `lane_m` to that side of the road's line, by a receiver with a
    standard deviation of `std_m`.
    """

    edge: int
    at_m: float
    across: Array
    away_m: float
    lane: str = ""
    lane_m: float = 0.0
    std_m: float = 0.0


class Shifted(NamedTuple):
    """Roads that lie elsewhere, and how many times as wide lanes are, by edge index."""

    roads: dict[int, RoadEdge]
    widths: dict[int, float]


class _Grid(NamedTuple):
    """Points of all roads, those of nodes once: (P, 2); of each edge its points' numbers, and
    their OSM nodes, 0 for points of our own."""

    xy_m: Array
    of_edge: dict[int, np.ndarray]
    nodes: dict[int, tuple[int, ...]]


def moved_roads(edges: Mapping[int, RoadEdge], seen: Iterable[Seen]) -> Shifted:
    """Return, where they were driven, those roads that lie elsewhere than the map has them.

    The shift is the likeliest one: that of the passes where there are some, and smoothly less
    beyond, with the map's error a process of Ornstein and Uhlenbeck along roads and nodes common
    to their roads. Points are added to long pieces, so that they can bend. Where several lanes of
    a way were driven, what the shift leaves tells how wide they are.
    """
    seen = list(seen)
    if not seen:
        return Shifted({}, {})
    grid = _grid(edges)
    rows = _rows(grid, seen)
    away_m, lane_m, std_m = np.array([(s.away_m, s.lane_m, s.std_m) for s in seen]).T
    ways = np.array([edges[s.edge].way_id for s in seen])
    wider: dict[int, float] = {}
    for _ in range(_WIDTH_ROUNDS):
        by_width = np.array([wider.get(way, 0.0) for way in ways.tolist()]) * lane_m
        shift = _shifts(grid, rows, away_m - by_width, std_m)
        rest_m = away_m - rows @ shift.ravel()
        wider = _wider(ways, [s.lane for s in seen], rest_m, lane_m)
        if not wider:
            break
    moved = {}
    for index, points in grid.of_edge.items():
        if np.hypot(*shift[points].T).max() > LEAST_M:
            line = grid.xy_m[points] + shift[points]
            moved[index] = msgspec.structs.replace(
                edges[index], xy_m=line, node_ids=grid.nodes[index], length_m=length(line)
            )
    widths = {i: 1.0 + wider[edge.way_id] for i, edge in edges.items() if edge.way_id in wider}
    return Shifted(moved, widths)


def _wider(
    ways: np.ndarray, lanes: Sequence[str], rest_m: Array, lane_m: Array
) -> dict[int, float]:
    """Return by which share the lanes of ways are wider, of those with two lanes driven or more.

    Least squares, shrunk by what is known of widths by class.
    """
    found = {}
    for way in np.unique(ways).tolist():
        mine = ways == way
        seen_m = STEP_M * np.unique(np.array(lanes)[mine], return_counts=True)[1]
        if (seen_m >= _LANE_SEEN_M).sum() < 2:
            continue  # it is as likely the road that lies elsewhere
        weight = STEP_M / (PASS_ALIKE_M * PASS_ERROR_M**2)
        square = weight * (lane_m[mine] ** 2).sum() + 1.0 / WIDTH_ERROR**2
        share = weight * float(rest_m[mine] @ lane_m[mine]) / square
        found[way] = float(np.clip(share, -_MOST_WIDER, _MOST_WIDER))
    return found


def _grid(edges: Mapping[int, RoadEdge]) -> _Grid:
    points: list[Array] = []
    node_at: dict[int, int] = {}
    of_edge, nodes = {}, {}
    for index, edge in edges.items():
        line, nodes[index] = _with_points(edge)
        numbers = np.arange(len(points), len(points) + len(line))
        for end, node in ((0, edge.start_node), (-1, edge.end_node)):
            numbers[end] = node_at.setdefault(node, int(numbers[end]))
        points.extend(line)
        of_edge[index] = numbers
    return _Grid(np.array(points), of_edge, nodes)


def _with_points(edge: RoadEdge) -> tuple[Array, tuple[int, ...]]:
    """Return an edge's points with others between those that are far apart, and their nodes."""
    at_m = arc_lengths(edge.xy_m)
    pieces = [
        np.linspace(a, b, max(int((b - a) / _SPACING_M), 1), endpoint=False)
        for a, b in pairwise(at_m.tolist())
    ]
    nodes: list[int] = []
    for node, piece in zip(edge.node_ids, pieces, strict=False):
        nodes += [node, *[0] * (len(piece) - 1)]
    every_m = np.concatenate([*pieces, at_m[-1:]])
    return points_at(edge.xy_m, every_m), (*nodes, edge.node_ids[-1])


def _rows(grid: _Grid, seen: list[Seen]) -> scipy.sparse.csr_matrix:
    """Return (S, 2 P): what of the points' shifts is seen."""
    rows, columns, values = [], [], []
    for row, one in enumerate(seen):
        points = grid.of_edge[one.edge]
        at_m = arc_lengths(grid.xy_m[points])
        i = int(np.clip(np.searchsorted(at_m, one.at_m) - 1, 0, len(points) - 2))
        share = float(np.clip((one.at_m - at_m[i]) / max(at_m[i + 1] - at_m[i], 1e-9), 0.0, 1.0))
        for point, part in ((points[i], 1.0 - share), (points[i + 1], share)):
            rows += [row, row]
            columns += [2 * point, 2 * point + 1]
            values += [part * one.across[0], part * one.across[1]]
    return scipy.sparse.csr_matrix((values, (rows, columns)), (len(seen), 2 * len(grid.xy_m)))


def _shifts(grid: _Grid, seen: scipy.sparse.csr_matrix, away_m: Array, std_m: Array) -> Array:
    """Return (P, 2) how far the points lie from where the map has them."""
    stiff = scipy.sparse.kron(_stiffness(grid), scipy.sparse.eye(2), format="csc")
    each = STEP_M / (PASS_ALIKE_M * PASS_ERROR_M**2 + RECEIVER_ALIKE_M * std_m**2)
    weight = each
    shift = np.zeros(seen.shape[1])
    for _ in range(_ROUNDS):
        scaled = seen.T.multiply(weight[None, :]).tocsr()
        shift = scipy.sparse.linalg.spsolve((scaled @ seen + stiff).tocsc(), scaled @ away_m)
        rest = np.abs(seen @ shift - away_m)
        weight = each * np.minimum(1.0, np.maximum(_ROBUST_M, std_m) / np.maximum(rest, 1e-9))
    return np.asarray(shift.reshape(-1, 2))


def _stiffness(grid: _Grid) -> scipy.sparse.csc_matrix:
    """Return (P, P) the energy of shifts: of the map's error, and of bends that no road has."""
    count = len(grid.xy_m)
    following: dict[int, list[int]] = {}
    pairs = []
    for points in grid.of_edge.values():
        for a, b in pairwise(points.tolist()):
            if a != b:
                pairs.append((a, b))
                following.setdefault(a, []).append(b)
                following.setdefault(b, []).append(a)
    first, second = np.array(pairs).T
    step = np.maximum(np.hypot(*(grid.xy_m[second] - grid.xy_m[first]).T), 0.5)
    differ = _differences(count, [(first, -1.0), (second, 1.0)])
    half = np.bincount(first, step / 2.0, count) + np.bincount(second, step / 2.0, count)
    error = 2.0 * MAP_ERROR_M**2
    energy = scipy.sparse.diags(np.maximum(half, 0.5) / (error * MAP_ALIKE_M))
    energy = energy + differ.T @ scipy.sparse.diags(MAP_ALIKE_M / (error * step)) @ differ
    # Where a road goes on with one other, or along itself, its shift does not bend at once.
    middle = [(a, two[0], two[1]) for a, two in following.items() if len(two) == 2]
    if middle:
        at, before, behind = np.array(middle).T
        bend = _differences(count, [(before, 1.0), (at, -2.0), (behind, 1.0)])
        apart = np.hypot(*(grid.xy_m[behind] - grid.xy_m[before]).T) / 2.0
        far_m = np.maximum(apart, _SPACING_M / 4.0)
        stiff = _SMOOTH_M**4 / (PASS_ALIKE_M * PASS_ERROR_M**2) / far_m**3
        energy = energy + bend.T @ scipy.sparse.diags(stiff) @ bend
    return energy.tocsc()


def _differences(count: int, parts: list[tuple[np.ndarray, float]]) -> scipy.sparse.csr_matrix:
    rows = np.concatenate([np.arange(len(columns)) for columns, _ in parts])
    columns = np.concatenate([columns for columns, _ in parts])
    values = np.concatenate([np.full(len(columns), value) for columns, value in parts])
    return scipy.sparse.csr_matrix((values, (rows, columns)), (len(parts[0][0]), count))
