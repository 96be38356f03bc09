"""How high a route's roads lie."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.orchestrator.routing.edge_parts import begins_m, whole
from foretwin.orchestrator.routing.route import Route
from foretwin.world_gen.elevation.profiles import RoadProfiles


def heights_along(route: Route, at_m: Array, profiles: RoadProfiles) -> Array:
    """Return heights (N,) above the sea at positions s (N,) of a route.

    Where a road has no heights it climbs evenly from what is known before to what is known after.
    """
    edges, start_m = route.edges, route.start_m
    heights = np.full(len(at_m), np.nan)
    place = np.clip(np.searchsorted(start_m, at_m, side="right") - 1, 0, len(edges) - 1)
    for i, directed in enumerate(edges):
        profile = profiles.of_edge.get(directed.edge.index)
        mine = place == i
        if profile is not None and mine.any():
            along = at_m[mine] - start_m[i] + begins_m(directed)
            length = whole(directed).edge.length_m
            heights[mine] = profile.height_at(length - along if directed.reverse else along)
    known = ~np.isnan(heights)
    return np.interp(at_m, at_m[known], heights[known]) if known.any() else np.zeros(len(at_m))
