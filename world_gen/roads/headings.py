"""Where roads head as they leave a node."""

from __future__ import annotations

import math

from foretwin.world_gen.roads.road_graph import DirectedEdge


def heading_out(leg: DirectedEdge, look_m: float = 8.0) -> tuple[float, float]:
    """Return the unit direction in which a leg leaves, averaged over `look_m`."""
    # Most legs need one or two points: plain floats are faster here than arrays.
    points = iter(leg.xy_m.tolist())
    x0, y0 = x, y = next(points)
    ahead, gone_m = (1.0, 0.0), 0.0
    for nx, ny in points:
        step_m = math.hypot(nx - x, ny - y)
        if step_m <= 0.01:
            continue
        if gone_m == 0.0:
            ahead = (nx - x) / step_m, (ny - y) / step_m
        share = min((look_m - gone_m) / step_m, 1.0)
        x, y = x + share * (nx - x), y + share * (ny - y)
        gone_m += step_m
        if gone_m >= look_m:
            break
    span_m = math.hypot(x - x0, y - y0)
    return ((x - x0) / span_m, (y - y0) / span_m) if span_m > 0.1 else ahead


def dot(a: tuple[float, float], b: tuple[float, float]) -> float:
    """Return the cosine between two unit directions."""
    return a[0] * b[0] + a[1] * b[1]
