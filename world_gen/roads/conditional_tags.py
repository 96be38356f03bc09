"""What a map forbids cars under a condition (a time, an engine), which a World does not hold."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from foretwin.world_gen.roads.road_graph import RoadEdge
from foretwin.world_gen.roads.road_tags import ACCESS_KEYS, FORBIDDEN, ONEWAY_KEYS

_WAYS = ("", ":forward", ":backward")


def condition_notes(edges: Iterable[RoadEdge]) -> Iterator[str]:
    """Name the tags by which cars may not, or only one way, drive some of the roads at times.

    A World knows no time and no engine, so that they do not hold in it.
    """
    for edge in edges:
        for key in (*ACCESS_KEYS, *ONEWAY_KEYS):
            for way in _WAYS:
                name = f"{key}{way}:conditional"
                told = edge.tags.get(name, "")
                if told and (key in ONEWAY_KEYS or told.partition("@")[0].strip() in FORBIDDEN):
                    yield (
                        f"way {edge.way_id}: {name}={told}: whether that holds is not known; "
                        "here it does not"
                    )
