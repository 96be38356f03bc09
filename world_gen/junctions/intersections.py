"""Junctions as a driver sees them, found in the road graph."""

from __future__ import annotations

import msgspec

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import IntersectionSummary
from foretwin.world_gen.roads.road_graph import DirectedEdge


class JunctionArm(msgspec.Struct, frozen=True, kw_only=True):
    """One road that meets a junction.

    `outward` are the directed edges that leave the junction's nodes along this road, whichever
    way cars may drive them: one for a street, two for a dual carriageway.
    """

    name: str
    bearing_rad: float
    outward: tuple[DirectedEdge, ...]


class Junction(msgspec.Struct, frozen=True, kw_only=True):
    """One junction: `nodes` are all OSM graph nodes inside it, `inner` the edges between them."""

    summary: IntersectionSummary
    centre_xy_m: Array
    nodes: frozenset[int]
    inner: tuple[int, ...]
    """Indices of the edges inside the junction (ring, short links between carriageways)."""
    arms: tuple[JunctionArm, ...]
    radius_m: float
    """Distance from the centre to the farthest node of the junction."""
    lights: frozenset[int] = frozenset()
    """OSM nodes of the traffic lights that stop who comes in or drives within."""
