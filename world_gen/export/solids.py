"""What formats make of a World alike: heights, colours, breadths of lines, what is solid.

Apart from all, so that no writer loads another's libraries.
"""

from __future__ import annotations

from foretwin.contracts.world import Area
from foretwin.world_gen.ground.islands import RING_ISLAND

Rgba = tuple[float, float, float, float]

GROUND: Rgba = (0.55, 0.58, 0.52, 1.0)
ROAD: Rgba = (0.25, 0.25, 0.27, 1.0)
ISLAND: Rgba = (0.45, 0.55, 0.35, 1.0)
BUILDING: Rgba = (0.72, 0.68, 0.62, 1.0)
ROOF: Rgba = (0.58, 0.36, 0.29, 1.0)
OBSTACLE: Rgba = (0.38, 0.34, 0.26, 1.0)
SIDEWALK: Rgba = (0.62, 0.61, 0.58, 1.0)
PAINT: Rgba = (0.92, 0.92, 0.9, 1.0)
CROSSING: Rgba = (0.8, 0.8, 0.74, 1.0)
ROAD_TOP_M, MARKING_TOP_M, SIDEWALK_TOP_M = 0.01, 0.02, 0.03
RING_ISLAND_HEIGHT_M = 1.0
"""A roundabout's middle is a mound with plants: a car that drives straight on must hit it."""
TRAFFIC_ISLAND_HEIGHT_M = 0.12
STOP_LINE_M = 0.5
"""Breadth of a stop line (RMS-1, 1993)."""
YIELD_LINE_M = 0.3
SHORTEST_STRIPE_M = 0.05
THINNEST_M = 0.01
"""Buildings that are lower from underside to top are left out."""


def stops_cars(island: Area) -> bool:
    """Return whether a car that drives on must hit an island: a roundabout's, not a refuge."""
    return island.id.startswith(RING_ISLAND)


def island_height_m(*, solid: bool) -> float:
    """Return how high islands stand that stop cars, or those that do not."""
    return RING_ISLAND_HEIGHT_M if solid else TRAFFIC_ISLAND_HEIGHT_M
