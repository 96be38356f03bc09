"""Heights along all roads of a map, from an elevation model that is noisy.

SRTM errs by 4 m from cell to cell, 6 % of grade between two of them. So a road's height is not
what the raster says, but the smoothest line through it: the height h along the way, with white
noise of density q in its curvature, is seen through white noise of density r = noise² · cell. Of
such a process the best estimate is a smoothing spline of width (r / q)^¼ (Wahba 1978; Kimeldorf,
Wahba 1970), 84 m for SRTM and 8 m for laser scans, and it says how far its own grade is off. All
roads are solved for at once: they share their heights where they meet, and keep their grade where
they go on. Bridges and tunnels do not see the ground, and hardly bend.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from foretwin.contracts.arrays import Array
from foretwin.contracts.elevation import HeightProfile
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import geo_from_local
from foretwin.world_gen.elevation.crossings import crossings_of
from foretwin.world_gen.elevation.dem import DemSet
from foretwin.world_gen.elevation.height_equations import (
    GRADE_CHANGE_PSQRTM,
    STRAIGHT_COS,
    Rows,
    Samples,
    as_steep_as_roads,
    bend_little,
    clearances,
    go_on_over_nodes,
    sampled,
    seen_heights,
    stacked,
    tagged_heights,
    tagged_inclines,
)
from foretwin.world_gen.elevation.profiles import RoadProfiles
from foretwin.world_gen.roads.road_graph import RoadEdge, RoadGraph

_LEAST_SPACING_M, _MOST_SPACING_M = 5.0, 20.0
_ROUNDS = 4
_HUBER = 1.5
"""Heights farther off, in standard deviations, weigh less: roofs and cliffs are no noise."""


def filter_width_m(dem: DemSet) -> float:
    """Return the width of the smoothing spline in metres."""
    return float((_seen_through(dem) / GRADE_CHANGE_PSQRTM**2) ** 0.25)


def grade_std(dem: DemSet) -> float:
    """Return how far the grade of a long road is off: the spline's own posterior.

    The integral of ω² q r / (q + r ω⁴) over all frequencies is q^¾ r^¼ / √8.
    """
    q, r = GRADE_CHANGE_PSQRTM**2, _seen_through(dem)
    return math.sqrt(q**0.75 * r**0.25 / math.sqrt(8.0))


def _seen_through(dem: DemSet) -> float:
    return dem.noise_m**2 * dem.cell_m


def road_profiles(
    graph: RoadGraph,
    edges: Sequence[int],
    dem: DemSet,
    node_tags: Mapping[int, Mapping[str, str]] | None = None,
) -> RoadProfiles:
    """Return heights along these edges of a graph.

    Raises UserError where the elevation model knows no height along any of them.
    """
    mine = [graph.edges[i] for i in edges]
    samples = sampled(mine, min(max(filter_width_m(dem) / 4, _LEAST_SPACING_M), _MOST_SPACING_M))
    lat, lon = geo_from_local(graph.frame, samples.xy_m).T
    ground = dem.at(lat, lon)
    if np.isnan(ground).all():
        raise UserError(f"dem {dem.name}: knows no height along the roads of the map")
    bends = stacked(
        [
            bend_little(mine, samples),
            go_on_over_nodes(mine, samples),
            as_steep_as_roads(mine, samples),
        ]
    )
    tagged = stacked(
        [tagged_inclines(mine, samples), tagged_heights(mine, samples, node_tags or {})]
    )
    seen = seen_heights(mine, samples, ground, _seen_through(dem))
    crossed = crossings_of(mine)
    weight, clear = seen.weight, clearances([], samples)
    heights = np.zeros(len(samples.xy_m))
    for _ in range(_ROUNDS):
        heights = _solved(
            stacked([bends, tagged, clear, seen._replace(weight=weight)]), len(heights), ground
        )
        off = np.abs(heights[seen.unknown[:, 0]] - seen.target) / dem.noise_m
        weight = seen.weight * np.minimum(1.0, _HUBER / np.maximum(off, 1e-9))
        clear = clearances(crossed, samples, heights)
    return RoadProfiles(dem, _profiles(mine, samples, heights), grade_std(dem))


def _solved(rows: Rows, count: int, ground: Array) -> Array:
    """Return the heights (U,) that fit all equations best."""
    root = np.sqrt(rows.weight)
    place = np.repeat(np.arange(len(root)), 4), rows.unknown.ravel()
    equations = sparse.csr_matrix(
        ((rows.factor * root[:, None]).ravel(), place), shape=(len(root), count)
    )
    # What no height reaches lies as high as all the rest: a tunnel without an end, say.
    faint, mean = 1e-9, float(np.nanmean(ground))
    normal = (equations.T @ equations + faint * sparse.identity(count)).tocsc()
    right = equations.T @ (rows.target * root - equations @ np.full(count, mean))
    return np.asarray(spsolve(normal, right, permc_spec="MMD_AT_PLUS_A")) + mean


def _profiles(
    edges: Sequence[RoadEdge], samples: Samples, heights: Array
) -> dict[int, HeightProfile]:
    """Return the profile of each edge; where one road goes on, both have the same grade there."""
    slopes = [
        np.diff(heights[unknown]) / np.diff(at)
        for unknown, at in zip(samples.unknown, samples.along_m, strict=True)
    ]
    leaving: dict[int, list[tuple[int, bool, Array]]] = {}
    for place, unknown in enumerate(samples.unknown):
        for turned in (False, True):
            near, further = (unknown[-1], unknown[-2]) if turned else (unknown[0], unknown[1])
            ahead = samples.xy_m[further] - samples.xy_m[near]
            ahead /= max(float(np.hypot(*ahead)), 1e-9)
            leaving.setdefault(int(near), []).append((place, turned, ahead))
    grades = []
    for at, slope in zip(samples.along_m, slopes, strict=True):
        step = np.diff(at)
        inner = (slope[:-1] * step[1:] + slope[1:] * step[:-1]) / (step[:-1] + step[1:])
        grades.append(np.concatenate([slope[:1], inner, slope[-1:]]))
    for those in leaving.values():
        for (one, turned, ahead), (other, other_turned, its) in combinations(those, 2):
            if len(those) > 2 and -ahead @ its <= STRAIGHT_COS:
                continue
            mine = -slopes[one][-1] if turned else slopes[one][0]
            theirs = -slopes[other][-1] if other_turned else slopes[other][0]
            out = (mine - theirs) / 2.0
            grades[one][-1 if turned else 0] = -out if turned else out
            grades[other][-1 if other_turned else 0] = out if other_turned else -out
    return {
        edge.index: HeightProfile(
            id=str(edge.index), along_m=at, height_m=heights[unknown], grade=grade
        )
        for edge, unknown, at, grade in zip(
            edges, samples.unknown, samples.along_m, grades, strict=True
        )
    }
