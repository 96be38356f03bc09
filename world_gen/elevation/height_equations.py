"""What is known of heights along roads, as linear equations: each with a standard deviation.

Unknown are the heights at samples along all roads; roads that meet share theirs.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Indices
from foretwin.geometry.polyline import arc_lengths, evenly, length, points_at
from foretwin.world_gen.elevation.crossings import Overpass
from foretwin.world_gen.roads.road_graph import RoadEdge
from foretwin.world_gen.roads.road_tags import in_tunnel, on_bridge

GRADE_CHANGE_PSQRTM = 0.05 / math.sqrt(100.0)
"""Roads change their grade by 5 % over 100 m, as a random walk does. Chosen."""
SPAN_STIFFNESS = 10.0
"""So many times less do bridges and tunnels."""
GRADE_STD, SPAN_GRADE_STD = 0.12, 0.05
"""Of 100 m of road, of bridge or tunnel, before one has looked: what keeps tunnels level whose far
end nobody sees, and stubs from jumping. Chosen; RASt 06 allows 8 to 12 % on streets."""
STRAIGHT_COS = math.cos(math.radians(45.0))
TURN_GRADE_STD = 0.15
"""How far grades differ around a corner: roads along and across a hillside meet there. Chosen."""
INCLINE_STD = 0.02
"""Of a tagged `incline`: signs round to a per cent and name the steepest part. Chosen."""
ELE_STD_M = 2.0
"""Of a tagged `ele`: read off maps and receivers. Chosen."""
_CLEAR_STD_M = 1.0
_INCLINE = re.compile(r"^\s*([+-]?\d+(?:[.,]\d+)?)\s*(%|°)\s*$")
_STEEPEST = 0.45
"""No street is steeper (Baldwin Street, Dunedin: 35 %)."""


class Samples(NamedTuple):
    """All edges cut into steps: number of each sample's unknown, by edge, and its arc length."""

    unknown: list[Indices]
    along_m: list[Array]
    xy_m: Array
    """(U, 2) of each unknown."""


class Rows(NamedTuple):
    """Linear equations: unknowns (R, K), their factors, what they come to, 1 / std²."""

    unknown: Indices
    factor: Array
    target: Array
    weight: Array


def sampled(edges: Sequence[RoadEdge], spacing_m: float) -> Samples:
    """Return all edges cut into steps of at most `spacing_m`."""
    numbers: dict[_Level, int] = {}
    places: list[Array] = []
    unknown, along = [], []
    levels = _levels(edges)
    for edge in edges:
        at = evenly(length(edge.xy_m), spacing_m=spacing_m)
        xy = points_at(edge.xy_m, at)
        ends = []
        for level, place in zip(levels(edge), (xy[0], xy[-1]), strict=True):
            if level not in numbers:
                numbers[level] = len(places)
                places.append(place)
            ends.append(numbers[level])
        between = range(len(places), len(places) + len(at) - 2)
        places.extend(xy[1:-1])
        unknown.append(np.array([ends[0], *between, ends[1]]))
        along.append(at)
    return Samples(unknown, along, np.array(places))


_Level = tuple[int, bool]
"""A node, and whether it is meant underground."""


def _levels(edges: Sequence[RoadEdge]) -> Callable[[RoadEdge], tuple[_Level, _Level]]:
    """Return what tells where an edge's ends share a height with others.

    Where a tunnel and a street both go on through a node they have a height each, though the map
    joins them.
    """
    below: Counter[int] = Counter()
    above: Counter[int] = Counter()
    for edge in edges:
        (below if in_tunnel(edge.tags) else above).update((edge.start_node, edge.end_node))
    apart = {node for node, count in below.items() if count > 1 and above[node] > 1}

    def levels(edge: RoadEdge) -> tuple[_Level, _Level]:
        under = in_tunnel(edge.tags)
        return (
            (edge.start_node, under and edge.start_node in apart),
            (edge.end_node, under and edge.end_node in apart),
        )

    return levels


def spans(edge: RoadEdge) -> bool:
    """Tell whether a road does not lie on the ground."""
    return on_bridge(edge.tags) or in_tunnel(edge.tags)


def _bend(edge: RoadEdge) -> float:
    """Return the variance by which an edge's grade changes along a metre."""
    return (GRADE_CHANGE_PSQRTM / (SPAN_STIFFNESS if spans(edge) else 1.0)) ** 2


def as_steep_as_roads(edges: Sequence[RoadEdge], samples: Samples) -> Rows:
    """Return that roads are as steep as roads are."""
    found = []
    for edge, unknown, at in zip(edges, samples.unknown, samples.along_m, strict=True):
        step, std = np.diff(at), SPAN_GRADE_STD if spans(edge) else GRADE_STD
        ends = np.column_stack([unknown[:-1], unknown[1:]])
        factor = np.column_stack([-1.0 / step, 1.0 / step])
        found.append(Rows(ends, factor, np.zeros(len(step)), step / 100.0 / std**2))
    return stacked(found)


def _change(
    first: Indices, second: Indices, before_m: Array, after_m: Array, variance: Array
) -> Rows:
    """Return that grades before and after samples are alike; first (R, 2), second (R, 2)."""
    factor = np.column_stack([1.0 / before_m, -1.0 / before_m, -1.0 / after_m, 1.0 / after_m])
    return Rows(np.column_stack([first, second]), factor, np.zeros(len(first)), 1.0 / variance)


def bend_little(edges: Sequence[RoadEdge], samples: Samples) -> Rows:
    """Return that grades change little along each edge."""
    found = []
    for edge, unknown, at in zip(edges, samples.unknown, samples.along_m, strict=True):
        if len(at) > 2:
            step = np.diff(at)
            first = np.column_stack([unknown[:-2], unknown[1:-1]])
            second = np.column_stack([unknown[1:-1], unknown[2:]])
            apart = (step[:-1] + step[1:]) / 2.0
            found.append(_change(first, second, step[:-1], step[1:], _bend(edge) * apart))
    return stacked(found)


class _End(NamedTuple):
    """An edge as it leaves a node: its first two unknowns, the step between, where it heads."""

    near: int
    next: int
    step_m: float
    heading: Array
    bend: float


def go_on_over_nodes(edges: Sequence[RoadEdge], samples: Samples) -> Rows:
    """Return that roads keep their grade where they go on, and nearly so around corners."""
    ends: dict[int, list[_End]] = {}
    for edge, unknown, at in zip(edges, samples.unknown, samples.along_m, strict=True):
        for turned in (False, True):
            u, step = (unknown[::-1], at[-1] - at[-2]) if turned else (unknown, at[1] - at[0])
            ahead = samples.xy_m[u[1]] - samples.xy_m[u[0]]
            heading = ahead / max(float(np.hypot(*ahead)), 1e-9)
            ends.setdefault(u[0], []).append(_End(u[0], u[1], step, heading, _bend(edge)))
    pairs = [pair for those in ends.values() for pair in combinations(those, 2)]
    if not pairs:
        return stacked([])
    before, after = zip(*pairs, strict=True)
    straight = np.array([-a.heading @ b.heading > STRAIGHT_COS for a, b in pairs])
    plain = np.array([len(those) == 2 for those in ends.values() for _ in combinations(those, 2)])
    before_m, after_m = (np.array([end.step_m for end in those]) for those in (before, after))
    variance = np.array([(a.bend * a.step_m + b.bend * b.step_m) / 2.0 for a, b in pairs])
    return _change(
        np.array([(a.next, a.near) for a in before]),
        np.array([(b.near, b.next) for b in after]),
        before_m,
        after_m,
        np.where(straight | plain, variance, variance + TURN_GRADE_STD**2),
    )


def seen_heights(
    edges: Sequence[RoadEdge], samples: Samples, ground: Array, density: float
) -> Rows:
    """Return that heights are those of the ground: each stretch of road counts by its length."""
    reach_m = np.zeros(len(ground))
    for edge, unknown, at in zip(edges, samples.unknown, samples.along_m, strict=True):
        if spans(edge):
            continue
        half = np.diff(at) / 2.0
        np.add.at(reach_m, unknown[:-1], half)
        np.add.at(reach_m, unknown[1:], half)
    known = np.flatnonzero(~np.isnan(ground) & (reach_m > 0.0))
    factor = np.ones((len(known), 1))
    return Rows(known[:, None], factor, ground[known], reach_m[known] / density)


def incline_of(tags: Mapping[str, str]) -> float | None:
    """Return the grade along a way's nodes where its `incline` is tagged as a number.

    `up` and `down` say no more than the sign, and are not used.
    """
    match = _INCLINE.match(tags.get("incline", ""))
    if match is None:
        return None
    value = float(match[1].replace(",", "."))
    grade = value / 100.0 if match[2] == "%" else math.tan(math.radians(min(abs(value), 60.0)))
    grade = math.copysign(abs(grade), value)
    return grade if abs(grade) <= _STEEPEST else None


def tagged_inclines(edges: Sequence[RoadEdge], samples: Samples) -> Rows:
    """Return that edges climb as their ways' tags say."""
    found = []
    for edge, unknown, at in zip(edges, samples.unknown, samples.along_m, strict=True):
        if (grade := incline_of(edge.tags)) is not None and at[-1] > 1.0:
            ends = np.array([[unknown[0], unknown[-1]]])
            factor = np.array([[-1.0, 1.0]]) / at[-1]
            found.append(Rows(ends, factor, np.array([grade]), np.array([INCLINE_STD**-2])))
    return stacked(found)


def tagged_heights(
    edges: Sequence[RoadEdge], samples: Samples, node_tags: Mapping[int, Mapping[str, str]]
) -> Rows:
    """Return that roads pass their nodes as high as these are tagged."""
    found = []
    for edge, unknown, at in zip(edges, samples.unknown, samples.along_m, strict=True):
        arc = arc_lengths(edge.xy_m)
        for node, along in zip(edge.node_ids, arc, strict=True):
            text = node_tags.get(node, {}).get("ele", "").removesuffix("m").strip()
            try:
                height = float(text)
            except ValueError:
                continue
            if math.isfinite(height):
                near = unknown[[int(np.argmin(np.abs(at - along)))]]
                weight = np.array([ELE_STD_M**-2])
                found.append(Rows(near[None], np.ones((1, 1)), np.array([height]), weight))
    return stacked(found)


def clearances(crossed: Sequence[Overpass], samples: Samples, heights: Array | None = None) -> Rows:
    """Return that roads pass over others as high as a lorry is, where they do not by themselves."""
    found = []
    for crossing in crossed:
        unknown, factor = [], []
        for place, along, sign in (
            (crossing.above, crossing.above_m, 1.0),
            (crossing.below, crossing.below_m, -1.0),
        ):
            at = samples.along_m[place]
            i = int(np.clip(np.searchsorted(at, along, side="right") - 1, 0, len(at) - 2))
            share = (along - at[i]) / max(at[i + 1] - at[i], 1e-9)
            unknown += samples.unknown[place][i : i + 2].tolist()
            factor += [sign * (1.0 - share), sign * share]
        if heights is not None and np.dot(heights[unknown], factor) < crossing.clear_m - 1e-3:
            row = np.array([unknown]), np.array([factor])
            target = np.array([crossing.clear_m])
            found.append(Rows(*row, target, np.array([_CLEAR_STD_M**-2])))
    return stacked(found)


def stacked(rows: Sequence[Rows]) -> Rows:
    """Return all equations as ones of four unknowns, those that are not needed with factor 0."""
    wide = [
        row._replace(
            unknown=np.pad(row.unknown, ((0, 0), (0, 4 - row.unknown.shape[1]))),
            factor=np.pad(row.factor, ((0, 0), (0, 4 - row.factor.shape[1]))),
        )
        for row in rows
        if len(row.target)
    ]
    if not wide:
        return Rows(np.zeros((0, 4), dtype=np.intp), np.zeros((0, 4)), np.zeros(0), np.zeros(0))
    return Rows(*(np.concatenate(column) for column in zip(*wide, strict=True)))
