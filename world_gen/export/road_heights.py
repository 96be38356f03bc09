"""Heights of lanes over the World's plane, so that roads over and under each other part."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import Connection, Lane, World
from foretwin.geometry.polyline import arc_lengths
from foretwin.world_gen.export.lane_borders import Borders

LAYER_HEIGHT_M = 5.0
"""From one OSM layer to the next: a lorry's 4.5 m and a bridge deck."""


class RoadHeights:
    """Heights at the ends of lanes, shared by all that meet there; ramps run between them."""

    def __init__(self, world: World, borders: Mapping[str, Borders]) -> None:
        self._at: dict[tuple[int, int], float] = {}
        parts: list[Lane | Connection] = [*world.lanes, *world.connections]
        for part in parts:
            if part.layer == 0 or part.id not in borders:
                continue
            height = part.layer * LAYER_HEIGHT_M
            for line in borders[part.id]:
                for key in _keys(line):
                    self._at[key] = max(self._at.get(key, 0.0), height, key=abs)

    def along(self, line: Array, layer: int) -> Array:
        """Return heights (N,) of a border (N, 2) in metres.

        A lane of another layer than 0 lies level; one of layer 0 rises or falls evenly between
        the heights at its ends.
        """
        if not self._at:
            return np.zeros(len(line))
        first, last = (self._at.get(key, 0.0) for key in _keys(line))
        s = arc_lengths(line)
        heights: Array = first + (last - first) * s / max(float(s[-1]), 1e-6)
        if layer != 0:
            heights[1:-1] = layer * LAYER_HEIGHT_M
        return heights


def _keys(line: Array) -> tuple[tuple[int, int], tuple[int, int]]:
    (x0, y0), (x1, y1) = np.rint(line[[0, -1]] * 1000.0).astype(np.int64).tolist()
    return (x0, y0), (x1, y1)
