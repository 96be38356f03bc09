"""Maps that say the same in another way, or its mirror image: their Worlds are known."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping

import msgspec
import numpy as np

from foretwin.contracts.world import DrivingSide
from foretwin.world_gen.osm.osm_map import NodeLocations, OsmMap, OsmWay

OTHER = {
    "left": "right",
    "right": "left",
    "clockwise": "counter-clockwise",
    "counter-clockwise": "clockwise",
    "anticlockwise": "clockwise",
}
SIDES = re.compile(r"left|right|(?:anti|counter-)?clockwise")
PLACEMENT = re.compile(r"(left|right|middle)_of:(\d+)")
_OTHER_WAY = {"left": "right", "right": "left", "forward": "backward", "backward": "forward"}
_BY_SIDE = ("sidewalk", "shoulder", "verge")


def mirrored_tags(tags: Mapping[str, str]) -> dict[str, str]:
    """Swap the sides in keys and values, the order of lanes, and what is counted from the left."""
    image = {}
    for key, value in tags.items():
        new = value
        if key.startswith("placement") and (found := PLACEMENT.fullmatch(value)):
            new = f"{found[1]}_of:{_lanes_of(key, tags) + 1 - int(found[2])}"
        if key != "name":
            new = "|".join(reversed(SIDES.sub(lambda m: OTHER[m[0]], new).split("|")))
        image[SIDES.sub(lambda m: OTHER[m[0]], key)] = new
    return image


def _lanes_of(key: str, tags: Mapping[str, str]) -> int:
    if key != "placement":
        return int(tags[key.replace("placement", "lanes")])
    both_ways = "motorway" not in tags["highway"] and tags.get("oneway", "no") == "no"
    return int(tags.get("lanes:forward", 0)) or int(tags["lanes"]) // (1 + both_ways)


def mirrored_map(osm: OsmMap, driven: DrivingSide) -> OsmMap:
    """Return a map east for west about its middle, whose roads are driven on the side given."""
    lat_lon_deg = osm.locations.lat_lon_deg * [1.0, -1.0] + [0.0, 2.0 * osm.frame.origin.lon_deg]
    ways = {}
    for key, way in osm.ways.items():
        side = {"driving_side": driven} if "highway" in way.tags else {}
        ways[key] = OsmWay(key, way.nodes, {**mirrored_tags(way.tags), **side})
    return msgspec.structs.replace(
        osm,
        locations=NodeLocations(osm.locations.ids, np.round(lat_lon_deg, 7)),
        ways=ways,
        node_tags={node: _turned(tags) for node, tags in osm.node_tags.items()},
        relations={
            key: msgspec.structs.replace(one, tags=mirrored_tags(one.tags))
            for key, one in osm.relations.items()
        },
    )


def _turned(tags: Mapping[str, str]) -> dict[str, str]:
    image = mirrored_tags(tags)
    if image.get("direction", "").isdecimal():
        image["direction"] = str(-int(image["direction"]) % 360)
    return image


def reversed_map(osm: OsmMap) -> OsmMap:
    """Return a map that says the same, but its roads, rings left out, run the other way."""
    turned = {
        key: way
        for key, way in osm.ways.items()
        if "highway" in way.tags and "junction" not in way.tags
    }
    on_rings = {n for w in osm.ways.values() if "junction" in w.tags for n in w.nodes}
    ways = {key: OsmWay(key, w.nodes[::-1], _reversed_tags(w.tags)) for key, w in turned.items()}
    nodes = {
        node: tags
        if node in on_rings
        else {
            key: _OTHER_WAY.get(value, value) if key.endswith("direction") else value
            for key, value in tags.items()
        }
        for node, tags in osm.node_tags.items()
    }
    return msgspec.structs.replace(osm, ways={**osm.ways, **ways}, node_tags=nodes)


def _reversed_tags(tags: Mapping[str, str]) -> dict[str, str]:
    image = {}
    for key, value in tags.items():
        new = ":".join(_OTHER_WAY.get(word, word) for word in key.split(":"))
        image[new] = _OTHER_WAY.get(value, value) if key in _BY_SIDE else value
    implied = "yes" if tags.get("highway") in ("motorway", "motorway_link") else "no"
    oneway = tags.get("oneway", implied)
    if oneway in ("yes", "-1"):
        image["oneway"] = "-1" if oneway == "yes" else "yes"
    along = "backward" if image.get("oneway") == "-1" else "forward"
    for key in [key for key in image if key.endswith(":lanes") or key == "placement"]:
        image[f"{key}:{along}"] = image.pop(key)
    return image


def split_map(osm: OsmMap, share: float) -> OsmMap:
    """Return a map that says the same, each of whose ways is parted at a node of its own, so far
    along its nodes; what relations name stays whole."""
    roads = {key: way for key, way in osm.ways.items() if "highway" in way.tags}
    uses = Counter(node for way in roads.values() for node in set(way.nodes))
    named = {way for relation in osm.relations.values() for way in relation.way_ids}
    ways = dict(osm.ways)
    for new, (key, way) in enumerate(roads.items(), start=max(osm.ways) + 1):
        own = [i for i in range(1, len(way.nodes) - 1) if uses[way.nodes[i]] == 1]
        if own and key not in named and way.nodes[0] != way.nodes[-1]:
            at = own[round(share * (len(own) - 1))]
            ways[key] = OsmWay(key, way.nodes[: at + 1], way.tags)
            ways[new] = OsmWay(new, way.nodes[at:], way.tags)
    return msgspec.structs.replace(osm, ways=ways)


def renumbered_map(osm: OsmMap, seed: int) -> OsmMap:
    """Return a map that says the same, whose nodes and ways have each other's ids."""
    rng = np.random.default_rng(seed)
    ids = osm.locations.ids
    new_ids = rng.permutation(ids)
    order = np.argsort(new_ids)
    nodes = dict(zip(ids.tolist(), new_ids.tolist(), strict=True))
    ways = dict(zip(osm.ways, rng.permutation(list(osm.ways)).tolist(), strict=True))
    new_of = {"n": nodes, "w": ways, "r": {}}
    renumbered = {
        ways[key]: OsmWay(ways[key], tuple(nodes[n] for n in way.nodes), way.tags)
        for key, way in osm.ways.items()
    }
    return msgspec.structs.replace(
        osm,
        locations=NodeLocations(new_ids[order], osm.locations.lat_lon_deg[order]),
        ways=dict(sorted(renumbered.items())),
        node_tags={nodes.get(node, node): tags for node, tags in osm.node_tags.items()},
        relations={
            key: msgspec.structs.replace(
                one,
                members=tuple(
                    msgspec.structs.replace(m, ref=new_of[m.kind].get(m.ref, m.ref))
                    for m in one.members
                ),
            )
            for key, one in osm.relations.items()
        },
    )
