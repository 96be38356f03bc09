"""How much of each road's lanes gives way to the places where roads meet."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import shapely
import shapely.ops

from contracts.arrays import Array
from world_gen.cross_section import CrossSection
from world_gen.legs import heading_out, is_ring_edge, lateral_positions
from world_gen.polyline import without_repeats
from world_gen.road_graph import DirectedEdge, RoadEdge
from world_gen.turn_curves import LEAD_M, WANTED_RADIUS_M

if TYPE_CHECKING:
    from world_gen.clusters import Cluster

CORNER_M = 3.5
"""Room between the kerb of the other road and a lane's end: makes turns wider than 4 m radius."""
RING_CORNER_M = 1.5
MAX_TRIM_M = 22.0
_LEG_LOOK_M = 45.0
TAPER_M = 6.0
"""Lanes end so far before, and begin so far behind, a place where their number changes."""
SHARPEST_BEND_COS = math.cos(math.radians(75.0))
"""Lanes run on through bends; sharper ones are driven as turns."""
SOFTEST_TURN_RAD, SHARPEST_TURN_RAD = math.radians(20.0), math.radians(150.0)
SHARPEST_ARC_RAD = math.radians(140.0)
"""Sharper turns begin with a swing to the other side instead of farther back."""


def trims(
    clusters: tuple[Cluster, ...],
    edges: Mapping[int, RoadEdge],
    sections: Mapping[int, CrossSection],
    shifts_m: Mapping[int, tuple[float, float]],
) -> dict[tuple[int, bool], float]:
    """Return metres cut off an edge's lanes by (edge index, at its end node)."""
    found: dict[tuple[int, bool], float] = {}
    for cluster in clusters:
        if cluster.plain:
            values = _plain_trims(cluster, sections, shifts_m)
        elif len(cluster.nodes) == 1:
            values = _node_trims(cluster, sections)
        else:
            values = _area_trims(cluster, edges, sections)
        for leg, value in zip(cluster.legs, values, strict=True):
            found[leg.edge.index, leg.reverse] = min(value, MAX_TRIM_M)
    for index, edge in edges.items():
        start, end = found.get((index, False), 0.0), found.get((index, True), 0.0)
        room = 0.8 * edge.length_m
        if start + end > room:
            # What is left is shared in proportion, so that a lane of some length remains.
            found[index, False] = start * room / (start + end)
            found[index, True] = end * room / (start + end)
    return found


def _plain_trims(
    cluster: Cluster,
    sections: Mapping[int, CrossSection],
    shifts_m: Mapping[int, tuple[float, float]],
) -> list[float]:
    """Lanes of one road run on where they fit; where lanes change they get room for a taper."""
    a, b = (sections[leg.edge.index] for leg in cluster.legs)
    first, second = cluster.legs
    by_first, by_second = (
        shifts_m.get(leg.edge.index, (0.0, 0.0))[int(leg.reverse)] for leg in cluster.legs
    )
    fits = lateral_positions(first, a, outward=False, shift_m=by_first) == lateral_positions(
        second, b, outward=True, shift_m=by_second
    )
    heads = np.array([heading_out(first), heading_out(second)])
    if fits and -heads[0] @ heads[1] > SHARPEST_BEND_COS:
        return [0.0, 0.0]
    room = [0.0 if fits else min(TAPER_M, 0.3 * leg.edge.length_m) for leg in cluster.legs]
    turning = _turning_trims(cluster.legs, heads, sections)
    return [max(a, float(b)) for a, b in zip(room, turning, strict=True)]


def _node_trims(cluster: Cluster, sections: Mapping[int, CrossSection]) -> list[float]:
    """Cut each leg where the kerbs of straight legs from one point cross, and a corner more."""
    heads = np.array([heading_out(leg) for leg in cluster.legs])
    half = np.array([sections[leg.edge.index].half_width_m for leg in cluster.legs])
    on_ring = np.array([is_ring_edge(leg.edge) for leg in cluster.legs])
    cos = np.clip(heads @ heads.T, -1.0, 1.0)
    sin = np.sqrt(1.0 - cos * cos)
    reach = (half[None, :] + half[:, None] * cos) / np.maximum(sin, 0.2)
    reach = np.where(cos < -0.94, 0.0, reach)  # the road goes straight on
    np.fill_diagonal(reach, 0.0)
    corner = np.where(on_ring, RING_CORNER_M, CORNER_M)
    trims = np.maximum(reach.max(axis=1), 0.0) + corner
    return [float(v) for v in np.maximum(trims, _turning_trims(cluster.legs, heads, sections))]


def _turning_trims(
    legs: tuple[DirectedEdge, ...], heads: Array, sections: Mapping[int, CrossSection]
) -> Array:
    """Return (legs,) how far from their node lanes must end for every turn to have its radius.

    A turn by an angle with radius R ends R tan(angle / 2) from where the lanes' lines cross.
    """
    into = np.full((len(legs), 2), np.nan)
    out = into.copy()
    for row, leg in enumerate(legs):
        section = sections[leg.edge.index]
        into[row], out[row] = section.reach_m(not leg.reverse), section.reach_m(leg.reverse)
    # From leg i into leg j; an angle above 0 is a turn to the left.
    cos = np.clip(heads @ heads.T, -1.0, 1.0)
    sin = np.outer(heads[:, 1], heads[:, 0]) - np.outer(heads[:, 0], heads[:, 1])
    angle = np.arctan2(sin, -cos)
    size = np.abs(angle)
    left = angle > 0.0
    start = np.where(left, -into[:, None, 0], into[:, None, 1])
    end = np.where(left, -out[None, :, 0], out[None, :, 1])
    # To the right of who drives in, and of who drives out.
    right_in = np.stack([-heads[:, 1], heads[:, 0]], axis=-1)
    at = np.array([leg.xy_m[0] for leg in legs])
    gap = at[None, :] - at[:, None]
    gap = gap - end[..., None] * right_in[None, :] - start[..., None] * right_in[:, None]
    across = np.where(np.abs(sin) < 0.2, np.copysign(0.2, sin), sin)
    x, y = heads[:, 0], heads[:, 1]
    from_start = (gap[..., 1] * x[None, :] - gap[..., 0] * y[None, :]) / across
    from_end = (gap[..., 1] * x[:, None] - gap[..., 0] * y[:, None]) / across
    room = WANTED_RADIUS_M * np.tan(np.minimum(size, SHARPEST_ARC_RAD) / 2.0) + LEAD_M
    turns = (size > SOFTEST_TURN_RAD) & (size < SHARPEST_TURN_RAD)
    from_start = np.where(turns & np.isfinite(from_start), from_start + room, 0.0)
    from_end = np.where(turns & np.isfinite(from_end), from_end + room, 0.0)
    return np.asarray(np.maximum(from_start.max(axis=1), from_end.max(axis=0)))


def _area_trims(
    cluster: Cluster, edges: Mapping[int, RoadEdge], sections: Mapping[int, CrossSection]
) -> list[float]:
    """Cut each leg where it has left the carriageways of all other roads of the cluster."""
    near = [shapely.LineString(without_repeats(leg.xy_m)) for leg in cluster.legs]
    near = [shapely.ops.substring(line, 0.0, _LEG_LOOK_M) for line in near]
    widths = [sections[leg.edge.index].half_width_m for leg in cluster.legs]
    legs = shapely.buffer(near, widths, cap_style="flat")
    inside = [
        shapely.buffer(shapely.LineString(edges[i].xy_m), sections[i].half_width_m)
        for i in sorted(cluster.inner)
        if i in edges
    ]
    heads = [heading_out(leg, 15.0) for leg in cluster.legs]
    values = []
    for i, leg in enumerate(legs):
        # A leg beside this one, going the same way, is the other carriageway of the same road.
        others = [
            legs[j]
            for j in range(len(legs))
            if j != i
            and not (
                heads[i] @ heads[j] > 0.85
                and cluster.legs[i].start_node != cluster.legs[j].start_node
            )
        ]
        overlap = shapely.intersection(leg, shapely.union_all([*others, *inside]))
        reach = 0.0
        for part in shapely.get_parts(overlap):
            if part.area > 0.05 and shapely.distance(part, shapely.Point(near[i].coords[0])) < 15.0:
                at = shapely.line_locate_point(
                    near[i], shapely.points(shapely.get_coordinates(part))
                )
                reach = max(reach, float(at.max()))
        values.append(reach + CORNER_M)
    turning = _turning_trims(
        cluster.legs, np.array([heading_out(leg) for leg in cluster.legs]), sections
    )
    return [float(v) for v in np.maximum(values, turning)]
