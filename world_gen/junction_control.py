"""Who tells drivers at a junction when to go: lights, signs, or the general rules."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from contracts.world import Control
from world_gen.chains import Chain
from world_gen.junction_arms import Approach
from world_gen.road_graph import DirectedEdge

SIGNALS_WITHIN_M, SIGNS_WITHIN_M = 40.0, 30.0
PEDESTRIAN_LIGHT_M = 15.0
"""A light at a crossing farther out than this serves pedestrians alone."""
Tags = Mapping[str, str]


def control_of(
    core: frozenset[int],
    inside: tuple[Chain, ...],
    approaches: tuple[Approach, ...],
    node_tags: Mapping[int, Tags],
    *,
    ring: bool,
) -> Control:
    """Return how the junction is controlled, from the tags in it and on its approaches.

    A light or sign counts for the nearer junction of the road it stands on, and only where it
    faces drivers who come in; signs on every road in make an all-way stop.
    """
    inner = [node_tags[node] for node in core if node in node_tags]
    inner += [node_tags[node] for chain in inside for node, _ in chain.nodes() if node in node_tags]
    incoming = [chain for item in approaches for chain in item.chains if chain.inward]
    lights = any(_is_light(tags, 0.0) for tags in inner) or any(
        _is_light(tags, distance_m)
        for chain in incoming
        for tags, distance_m in facing(chain, node_tags, SIGNALS_WITHIN_M, "traffic_signals")
    )
    if lights:
        return "signals"
    if ring:
        return "roundabout"
    stops = [_sign(chain, node_tags, "stop") for chain in incoming]
    all_way = any(
        tags.get("highway") == "stop" and tags.get("stop") == "all" for tags in inner
    ) or any(tags.get("stop") == "all" for tags in stops if tags is not None)
    if all_way or (len(incoming) >= 3 and all(tags is not None for tags in stops)):
        return "all_way_stop"
    at_inner = {tags.get("highway") for tags in inner}
    if "stop" in at_inner or any(tags is not None for tags in stops):
        return "stop"
    if "give_way" in at_inner or any(
        _sign(chain, node_tags, "give_way") is not None for chain in incoming
    ):
        return "give_way"
    return "uncontrolled"


def _sign(chain: Chain, node_tags: Mapping[int, Tags], word: str) -> Tags | None:
    for tags, _ in facing(chain, node_tags, SIGNS_WITHIN_M, word):
        if tags.get("highway") == word:
            return tags
    return None


def _is_light(tags: Tags, distance_m: float) -> bool:
    if tags.get("highway") != "traffic_signals":
        return False
    pedestrians = "crossing" in tags or tags.get("traffic_signals") == "pedestrian_crossing"
    return distance_m <= PEDESTRIAN_LIGHT_M or not pedestrians


def facing(
    chain: Chain, node_tags: Mapping[int, Tags], within_m: float, word: str
) -> Iterator[tuple[Tags, float]]:
    """Yield (tags, metres before the junction) of nodes that drivers towards it obey.

    `chain` leaves the junction; nodes of `highway=word` on it count up to `within_m` where they
    are tagged to face who comes in, else on its nearer half alone.
    """
    nearer_m = min(within_m, chain.length_m / 2.0)
    directions = _directions(chain)
    for node, distance_m in chain.nodes():
        if distance_m > within_m or node == chain.start:
            if node == chain.start:
                continue
            break
        tags = node_tags.get(node)
        if tags is None or tags.get("highway") != word or node == chain.end:
            continue
        facing = tags.get(f"{word}:direction") or tags.get("direction")
        along = directions.get(node)
        if along is not None and facing in ("forward", "backward"):
            # The chain leaves the junction: who comes in drives against it.
            towards = "forward" if along.reverse else "backward"
            if facing == towards:
                yield tags, distance_m
        elif distance_m <= nearer_m:
            yield tags, distance_m


def _directions(chain: Chain) -> dict[int, DirectedEdge]:
    return {node: item for item in chain.edges for node in item.edge.node_ids[1:-1]}
