"""What the tags of a road mean to a driver: access, one-way, lanes, level."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from foretwin.contracts.provenance import Quantity
from foretwin.world_gen.roads.road_classes import CAR_CLASSES, OTHER_CLASSES

_MOTOR_SPORTS = frozenset({"motor", "motor_sports", "motor_racing", "autocross", "rallycross"})
"""What races on a track for cars; kart, horse, bicycle and motocross tracks are none."""
RING_TAGS = frozenset({"roundabout", "circular"})

FORBIDDEN = frozenset(
    {
        *("no", "private", "permit", "agricultural", "forestry", "emergency", "official"),
        *("military", "bus", "psv", "taxi", "hgv", "bicycle", "foot"),
    }
)
"""Values that leave the public's cars out; those of kinds of traffic let these alone through."""
ACCESS_KEYS = ("motorcar", "motor_vehicle", "vehicle", "access")
ONEWAY_KEYS = ("oneway:motor_vehicle", "oneway:vehicle", "oneway")
"""Tags that open roads to cars, and one way round, the most specific first."""


class Directions(NamedTuple):
    """Whether cars may drive along (`forward`) and against the order of a way's nodes."""

    forward: bool
    backward: bool


ONEWAY: Mapping[str, Directions] = {
    **dict.fromkeys(("yes", "true", "1"), Directions(True, False)),
    **dict.fromkeys(("-1", "reverse"), Directions(False, True)),
    **dict.fromkeys(("no", "false", "0", "reversible", "alternating"), Directions(True, True)),
}
"""Tidal roads are open both ways until it is known which one holds (`tidal_roads`)."""


def is_car_road(tags: Mapping[str, str]) -> bool:
    """Tell whether the tags describe a public road for cars, closed to them or not."""
    highway = tags.get("highway")
    if highway == "raceway" and tags.get("sport", "motor") not in _MOTOR_SPORTS:
        return False
    return highway in CAR_CLASSES and tags.get("area") != "yes"


def is_kept_road(tags: Mapping[str, str]) -> bool:
    """Tell whether a way belongs into the road graph: anything a car's wheels might follow."""
    highway = tags.get("highway")
    return (highway in CAR_CLASSES or highway in OTHER_CLASSES) and tags.get("area") != "yes"


def open_to_cars(tags: Mapping[str, str]) -> bool:
    """Tell whether cars of the public may use the road, by its most specific access tag."""
    for key in ACCESS_KEYS:
        value = tags.get(key)
        if value is not None and value != "unknown":
            return any(part.strip() not in FORBIDDEN for part in value.split(";"))
    return tags.get("highway") not in ("pedestrian", "busway")


def directions(tags: Mapping[str, str]) -> Directions:
    """Return which ways round cars may drive: one-way signs, implied one-way, access."""
    if not open_to_cars(tags):
        return Directions(False, False)
    oneway = _oneway(tags)
    implied = tags.get("junction") in RING_TAGS or tags.get("highway") == "motorway"
    forward, backward = ONEWAY.get(oneway, Directions(True, not implied))
    for key in ("motor_vehicle", "vehicle"):
        forward = forward and tags.get(f"{key}:forward") != "no"
        backward = backward and tags.get(f"{key}:backward") != "no"
    return Directions(forward, backward)


def is_tidal(tags: Mapping[str, str]) -> bool:
    """Tell whether all lanes of a road are driven one way, now this one and now the other."""
    lanes_each_way = "lanes:forward" in tags and "lanes:backward" in tags
    return _oneway(tags) == "reversible" and not lanes_each_way


def _oneway(tags: Mapping[str, str]) -> str:
    return next((tags[key] for key in ONEWAY_KEYS if tags.get(key)), "")


class LaneCounts(NamedTuple):
    """Lanes along and against the order of the nodes; 0 where no car may drive."""

    forward: Quantity
    backward: Quantity


def lane_counts(tags: Mapping[str, str], allowed: Directions) -> LaneCounts:
    """Return lanes each way: tagged, inferred from the total or from turn lanes, or a default.

    A closed road keeps the lanes it would have with traffic both ways, since it has a width.
    """
    if not any(allowed):
        allowed = Directions(True, True)
    total = _count(tags.get("lanes"))
    sides: list[Quantity | None] = [None, None]
    one_way = allowed.forward != allowed.backward
    for side, word in enumerate(("forward", "backward")):
        turns = tags.get(f"turn:lanes:{word}")
        if not allowed[side]:
            sides[side] = Quantity(0.0, "inferred")
        elif (tagged := _count(tags.get(f"lanes:{word}"))) is not None:
            sides[side] = Quantity(float(tagged), "tagged")
        elif one_way and total is not None:
            sides[side] = Quantity(float(total), "tagged")
        elif turns or (one_way and (turns := tags.get("turn:lanes"))):
            sides[side] = Quantity(float(turns.count("|") + 1), "inferred")
    forward, backward = sides
    middle = _count(tags.get("lanes:both_ways")) or 0
    if forward is None and backward is None and total is not None:
        # An odd lane cannot be shared out; along the way's own direction is as good a guess.
        backward = Quantity(float(max(1, (total - middle) // 2)), "inferred")
    if forward is None:
        forward = _rest(total, middle, backward, tags)
    if backward is None:
        backward = _rest(total, middle, forward, tags)
    return LaneCounts(forward, backward)


def _rest(
    total: int | None, middle: int, other: Quantity | None, tags: Mapping[str, str]
) -> Quantity:
    if total is not None and other is not None:
        return Quantity(float(max(1, total - middle - int(other.value))), "inferred")
    return Quantity(2.0 if tags.get("highway") in ("motorway", "trunk") else 1.0, "default")


def _count(text: str | None) -> int | None:
    if text is None:
        return None
    try:
        return max(1, int(float(text.split(";")[0])))
    except (ValueError, OverflowError):
        return None


def road_layer(tags: Mapping[str, str]) -> int:
    """Return the level of the road: the `layer` tag, else 1 for a bridge, -1 for a tunnel."""
    try:
        return int(tags["layer"])
    except (KeyError, ValueError):
        pass
    return 1 if on_bridge(tags) else -int(in_tunnel(tags))


def on_bridge(tags: Mapping[str, str]) -> bool:
    """Tell whether the road runs over a bridge."""
    return tags.get("bridge", "no") != "no"


def below_buildings(tags: Mapping[str, str]) -> bool:
    """Tell whether the road runs below ground, or through or under what is built."""
    told = tags.get("tunnel", "no") != "no" or tags.get("covered", "no") != "no"
    return told or road_layer(tags) < 0


def in_tunnel(tags: Mapping[str, str]) -> bool:
    """Tell whether the road runs below ground, which the way through a house does not."""
    return tags.get("tunnel", "no") not in ("no", "building_passage")


def is_crossed(tags: Mapping[str, str]) -> bool:
    """Tell whether people cross the road on foot at a node; `crossing=no` is how to deny it."""
    if "crossing" in tags:
        return tags["crossing"] != "no"
    return tags.get("highway") == "crossing"
