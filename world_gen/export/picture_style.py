"""Colours and patterns of a World's picture, and the stretch of ground that a drawing shows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.provenance import Provenance
from foretwin.contracts.world import Turn

Look = dict[str, Any]
"""How an artist is drawn, in matplotlib's words."""
GROUND, ROAD, JUNCTION, KERB, SIDEWALK = "#e9ece4", "#c9ccd1", "#b9bdc4", "#7c828a", "#d9d3c7"
LANE_EDGE, LANE, BUS, BICYCLE, TRAM, RING = (
    "#ffffff",
    "#4c5560",
    "#a8326e",
    "#00857a",
    "#6d4c41",
    "#2b6f9e",
)
ISLAND, ISLAND_EDGE = "#b7cfa1", "#6f8f56"
OPAQUE, SEEN_PAST = "#4a2f1b", "#2f6b3a"
"""What hides who stands behind it, and trees, posts and fences."""
DECK_EDGE, TUNNEL, PARKING = "#20262d", "#8d7fa8", "#aebfd4"
TURN_COLOUR: Mapping[Turn, str] = {
    "straight": "#2a7f3f",
    "left": "#1f5fd0",
    "right": "#d8781a",
    "u_turn": "#8a3fb0",
}
LINE_COLOUR: Mapping[str, str] = {
    "signal": "#d62728",
    "stop": "#8b0000",
    "give_way": "#e3a100",
    "none": "#6b7280",
}
SIGNAL, CROSSING_CONFLICT, MERGING_CONFLICT, WAITS = "#d62728", "#c2185b", "#7b1fa2", "#b26a00"
HATCH: Mapping[Provenance, str | None] = {
    "driven": None,
    "tagged": None,
    "inferred": "//",
    "default": "xxx",
}
DASH: Mapping[Provenance, Any] = {
    "driven": "-",
    "tagged": "-",
    "inferred": (0, (5, 2.5)),
    "default": (0, (1, 1.6)),
}
"""Solid what the map says, dashed what follows from it, dotted what is a default."""
HEIGHT_COLOURS = "YlOrBr"


@dataclass(frozen=True, slots=True)
class View:
    """A rectangle of ground in metres; `close` drawings show every mark."""

    west_m: float
    south_m: float
    east_m: float
    north_m: float
    close: bool

    def holds(self, xy_m: Array) -> bool:
        """Return whether any point of (N, 2), or (2,), lies in the rectangle."""
        x, y = np.atleast_2d(xy_m).T
        inside = (x > self.west_m) & (x < self.east_m) & (y > self.south_m) & (y < self.north_m)
        return bool(inside.any())

    def meets(self, xy_m: Array) -> bool:
        """Return whether the box around points (N, 2) meets the rectangle."""
        (x0, y0), (x1, y1) = xy_m.min(axis=0), xy_m.max(axis=0)
        return bool(
            x0 < self.east_m and x1 > self.west_m and y0 < self.north_m and y1 > self.south_m
        )

    @property
    def width_m(self) -> float:
        """How much ground it shows from west to east."""
        return self.east_m - self.west_m


def view_around(middle: Array, half_height_m: float, aspect: float, *, close: bool) -> View:
    """Return a view of the given half height whose width is `aspect` times its height."""
    x, y = float(middle[0]), float(middle[1])
    across = half_height_m * aspect
    return View(x - across, y - half_height_m, x + across, y + half_height_m, close)
