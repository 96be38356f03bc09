"""Classes of roads, and what is usual of each where neither a map nor its country says it."""

from __future__ import annotations

from typing import NamedTuple


class RoadClass(NamedTuple):
    """One class of `highway`; `importance` ranks roads that meet, lane widths may be unknown."""

    kmph: float | None = 50.0
    """None where the country's rules say it, see `speed_limits.py`."""
    lane_width_m: float | None = None
    importance: float = 2.0
    public: bool = True
    """Whether it is made for cars; others are where a tag allows cars."""


ROAD_CLASSES = {
    "motorway": RoadClass(None, 3.75, 8.0),
    "motorway_link": RoadClass(60.0, 3.75, 2.8),
    "trunk": RoadClass(None, 3.5, 7.0),
    "trunk_link": RoadClass(60.0, 3.5, 2.7),
    "primary": RoadClass(None, 3.5, 6.0),
    "primary_link": RoadClass(None, 3.5, 2.6),
    "secondary": RoadClass(None, 3.25, 5.0),
    "secondary_link": RoadClass(None, 3.5, 2.5),
    "tertiary": RoadClass(None, 3.25, 4.0),
    "tertiary_link": RoadClass(None, 3.25, 2.4),
    "unclassified": RoadClass(None, 3.0, 3.0),
    "residential": RoadClass(None, 3.0, 3.0),
    "living_street": RoadClass(None, 2.75, 1.0),
    "road": RoadClass(None, None, 3.0),
    "raceway": RoadClass(100.0, 5.0, 3.0),
    "pedestrian": RoadClass(7.0, None, 1.0, public=False),
    "service": RoadClass(10.0, None, 1.0, public=False),
    "track": RoadClass(20.0, None, 0.5, public=False),
    "busway": RoadClass(50.0, None, 3.0, public=False),
}
"""Links rank below every street but a yard."""
CAR_CLASSES = frozenset(name for name, known in ROAD_CLASSES.items() if known.public)
OTHER_CLASSES = frozenset(ROAD_CLASSES) - CAR_CLASSES


def road_class(name: str) -> RoadClass:
    """Return what is usual of a class, or of roads of which nothing is known."""
    return ROAD_CLASSES.get(name, RoadClass())
