"""What a World's notes say of single nodes of its roads."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from foretwin.world_gen.roads.road_graph import RoadEdge

Tags = Mapping[str, str]
_GUARDED = ("crossing:barrier", "crossing:light")


def barrier_notes(
    edges: Iterable[RoadEdge], closed: frozenset[int], node_tags: Mapping[int, Tags]
) -> Iterator[str]:
    """Name the nodes `closed` to cars before which some of the edges end."""
    ends = {node for edge in edges for node in (edge.start_node, edge.end_node)}
    for node in sorted(node for node in closed if node in ends or -node in ends):
        barrier = node_tags[node]["barrier"]
        yield f"node {node}: barrier={barrier} closes the road to cars; lanes end before it"


def level_notes(edges: Iterable[RoadEdge], passed_over: frozenset[int]) -> Iterator[str]:
    """Name the nodes of some edges that a map joins though one road passes over the other."""
    if passed_over:
        nodes = {node for edge in edges for node in edge.node_ids}
        for node in sorted(passed_over & nodes):
            yield f"node {node}: in the map two roads of different levels meet; taken as apart"


def level_crossing_notes(edges: Iterable[RoadEdge], node_tags: Mapping[int, Tags]) -> Iterator[str]:
    """Name the nodes at which some edges cross a railway on its level, with what guards it."""
    nodes = {node for edge in edges for node in edge.node_ids if node in node_tags}
    for node in sorted(nodes):
        tags = node_tags[node]
        if tags.get("railway") == "level_crossing":
            told = ", ".join(f"{key}={tags[key]}" for key in _GUARDED if key in tags)
            yield (
                f"node {node}: level crossing{told and f' ({told})'}; the World holds no stop "
                "line, light or barrier before its rails"
            )
