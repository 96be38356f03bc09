"""A straight stretch of road with tags, for tests of what tags mean."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from foretwin.contracts.provenance import Provenance, Quantity
from foretwin.contracts.world import DrivingSide
from foretwin.world_gen.roads.road_graph import RoadEdge


def road(
    tags: Mapping[str, str] | None = None,
    *,
    forward: int = 1,
    backward: int = 1,
    road_class: str = "residential",
    side: DrivingSide = "right",
    counts: Provenance = "tagged",
) -> RoadEdge:
    """Return an edge of way 7 with so many lanes each way, a number that comes from `counts`."""
    return RoadEdge(
        index=0,
        way_id=7,
        start_node=1,
        end_node=2,
        node_ids=(1, 2),
        xy_m=np.array([[0.0, 0.0], [50.0, 0.0]]),
        length_m=50.0,
        forward=forward > 0,
        backward=backward > 0,
        car=True,
        road_class=road_class,
        name="",
        limit_forward_mps=Quantity(8.3, "default"),
        limit_backward_mps=Quantity(8.3, "default"),
        lanes_forward=Quantity(forward, counts),
        lanes_backward=Quantity(backward, counts),
        layer=0,
        driving_side=side,
        tags=tags or {},
    )
