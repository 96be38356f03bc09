"""Classes of roads, and what is usual of each where a map has no tag."""

from __future__ import annotations

from typing import NamedTuple


class RoadClass(NamedTuple):
    """One class of `highway`; `importance` ranks roads that meet, lane widths may be unknown."""

    kmph: float = 50.0
    lane_width_m: float | None = None
    importance: float = 2.0
    public: bool = True
    """Whether it is made for cars; others are where a tag allows cars."""


ROAD_CLASSES = {
    "motorway": RoadClass(120.0, 3.75, 8.0),
    "motorway_link": RoadClass(60.0, 3.75, 2.8),
    "trunk": RoadClass(100.0, 3.5, 7.0),
    "trunk_link": RoadClass(60.0, 3.5, 2.7),
    "primary": RoadClass(50.0, 3.5, 6.0),
    "primary_link": RoadClass(50.0, 3.5, 2.6),
    "secondary": RoadClass(50.0, 3.25, 5.0),
    "secondary_link": RoadClass(50.0, 3.5, 2.5),
    "tertiary": RoadClass(50.0, 3.25, 4.0),
    "tertiary_link": RoadClass(50.0, 3.25, 2.4),
    "unclassified": RoadClass(50.0, 3.0, 3.0),
    "residential": RoadClass(30.0, 3.0, 3.0),
    "living_street": RoadClass(10.0, 2.75, 1.0),
    "road": RoadClass(50.0, None, 3.0),
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
