"""On which side of the road a country drives: by position, and by tags where they are many."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import DrivingSide
from foretwin.world_gen.countries.outlines import CountryPlace

CELL_DEG = 0.02
"""About two kilometres: a grid that does not depend on where a map is cut."""
LEAST_SHARE, LEAST_M = 0.1, 1000.0
"""Of the metres of road in a cell, and so many: tags on as much are taken for what holds there, on
less for what holds on their own way alone. These numbers are ours, by default: a bridge or a car
park that is driven on the other side is less, and where whole towns lie beyond an outline their
main roads are more."""

Tags = Mapping[str, str]


def driving_sides(
    tags: Sequence[Tags], places: Sequence[CountryPlace], lat_lon_deg: Array, length_m: Array
) -> tuple[DrivingSide, ...]:
    """Return the side on which each of N roads is driven.

    `lat_lon_deg` (N, 2) is where each begins, `places` the country there, `length_m` (N,) how long
    it is. A `driving_side` tag holds for its own road. Roads without one are driven as their
    country does, or as the tags of their cell say where these are on more metres than those of the
    other side, and on enough of them.
    """
    left = np.array([place.driving_side == "left" for place in places], dtype=bool)
    said = [one.get("driving_side") for one in tags]
    tagged_left = np.array([side == "left" for side in said], dtype=bool)
    tagged_right = np.array([side == "right" for side in said], dtype=bool)
    if tagged_left.any() or tagged_right.any():
        square = np.floor(lat_lon_deg / CELL_DEG).astype(np.int64)
        cell = np.unique(square, axis=0, return_inverse=True)[1].reshape(-1)
        whole_m, left_m, right_m = (
            np.bincount(cell, weights=length_m * share)
            for share in (1.0, tagged_left, tagged_right)
        )
        enough = np.maximum(left_m, right_m) >= np.maximum(LEAST_SHARE * whole_m, LEAST_M)
        by_tags = (enough & (left_m != right_m))[cell]
        left = np.where(by_tags, (left_m > right_m)[cell], left)
        left = (left | tagged_left) & ~tagged_right
    return tuple("left" if one else "right" for one in left.tolist())
