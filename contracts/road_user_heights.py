"""How high each kind of road user is: of all who draw, tell or measure one, who says its length and
width alone."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from foretwin.contracts.drive import RoadUserKind

HEIGHT_M: Mapping[RoadUserKind, float] = MappingProxyType(
    {
        "car": 1.5,
        "van": 2.6,
        "lorry": 2.8,
        "bus": 3.4,
        "tram": 3.2,
        "motorcycle": 1.5,
        "bicycle": 1.87,
        "pedestrian": 1.8,
        "unknown": 1.5,
    }
)
"""With whoever rides it; from where sizes are, `sim_worker/vehicle/road_user_kinds.py`."""
