"""Roads as elements of an OpenDRIVE file, without the objects and signals beside them."""

from __future__ import annotations

import math

from foretwin.contracts.world import DrivingSide, Lane
from foretwin.world_gen.export.choices import OpenDriveVersion
from foretwin.world_gen.export.opendrive_curve import Curve
from foretwin.world_gen.export.opendrive_roads import OdrLane, OdrRoad
from foretwin.world_gen.export.xml_tree import Element, child, element

LANE_TYPE = {"bicycle": "biking", "closed": "restricted"}
"""What OpenDRIVE calls kinds of lanes that it does not call as the World does."""
ROAD_TYPE = {
    "motorway": ("motorway", "motorway"),
    "trunk": ("townExpressway", "rural"),
    "primary": ("townArterial", "rural"),
    "secondary": ("townArterial", "rural"),
    "tertiary": ("townCollector", "rural"),
    "unclassified": ("townLocal", "rural"),
    "residential": ("townLocal", "townLocal"),
    "living_street": ("lowSpeed", "lowSpeed"),
    "service": ("townPrivate", "townPrivate"),
}
"""Type of a road by OSM's class in towns and, where faster is allowed, in the open country."""
TOWN_KMH = 70.0
LINE_M = 0.12
"""Width of a lane marking."""


def road_element(road: OdrRoad, *, side: DrivingSide, version: OpenDriveVersion) -> Element:
    """Return a `<road>` without objects and signals."""
    # 1.4 knows right-hand traffic alone, and has no word for it.
    rule = None if version == "1.4" else "RHT" if side == "right" else "LHT"
    made = element(
        "road",
        name=road.name,
        length=road.curve.length_m,
        id=road.id,
        junction=road.junction,
        rule=rule,
    )
    _add_links(made, road)
    _add_type(made, road, version)
    _add_plan_view(made, road.curve)
    profile = child(made, "elevationProfile")
    for s, height in road.height.pieces:
        child(profile, "elevation", s=s, **height._asdict())
    _add_lanes(made, road, version=version)
    return made


def _add_links(made: Element, road: OdrRoad) -> None:
    link = child(made, "link")
    for tag, to in (("predecessor", road.predecessor), ("successor", road.successor)):
        if to is not None:
            kind, other, at_end = to
            contact = None if kind == "junction" else "end" if at_end else "start"
            child(link, tag, elementType=kind, elementId=other, contactPoint=contact)


def _add_type(made: Element, road: OdrRoad, version: OpenDriveVersion) -> None:
    limits = [lane.lane.speed_limit_mps.value for lane in road.lanes if lane.lane is not None]
    kmh = round(max(limits) * 3.6) if limits else 0
    in_town, outside = ROAD_TYPE.get(road.road_class.removesuffix("_link"), ("unknown", "unknown"))
    kind = in_town if kmh <= TOWN_KMH else outside
    if version == "1.4" and kind.startswith("town"):
        kind = "town"  # 1.4 has one type for all roads in towns
    item = child(made, "type", s=0, type=kind)
    if limits:
        child(item, "speed", max=kmh, unit="km/h")


def _add_plan_view(made: Element, curve: Curve) -> None:
    plan = child(made, "planView")
    s = 0.0
    for control, straight, length in zip(
        curve.controls.tolist(), curve.straight, curve.lengths_m.tolist(), strict=True
    ):
        (x0, y0), (x1, y1), *_ = control
        heading = math.atan2(y1 - y0, x1 - x0)
        item = child(plan, "geometry", s=s, x=x0, y=y0, hdg=heading, length=length)
        s += length
        if straight:
            child(item, "line")
            continue
        cos, sin = math.cos(heading), math.sin(heading)
        u1, u2, u3 = (cos * (x - x0) + sin * (y - y0) for x, y in control[1:])
        v2, v3 = (cos * (y - y0) - sin * (x - x0) for x, y in control[2:])
        along = {"aU": 0, "bU": 3 * u1, "cU": 3 * u2 - 6 * u1, "dU": u3 - 3 * u2 + 3 * u1}
        # The first handle lies on the heading: nothing of it is aside.
        aside = {"aV": 0, "bV": 0, "cV": 3 * v2, "dV": v3 - 3 * v2}
        child(item, "paramPoly3", **along, **aside, pRange="normalized")


def _add_lanes(made: Element, road: OdrRoad, *, version: OpenDriveVersion) -> None:
    lanes = child(made, "lanes")
    if any(road.offset):
        child(lanes, "laneOffset", s=0, **road.offset._asdict())
    section = child(lanes, "laneSection", s=0)
    left = [lane for lane in road.lanes if lane.number > 0]
    right = [lane for lane in road.lanes if lane.number < 0]
    if left:
        group = child(section, "left")
        for lane, beyond in zip(left, [None, *left[:-1]], strict=True):
            _add_lane(group, lane, beyond, road, version)
    centre = child(child(section, "center"), "lane", type="none", level="false", id=0)
    kind = "broken" if left and right and road.junction < 0 else "solid"
    _add_mark(centre, "none" if road.junction >= 0 else kind, "none")
    if right:
        group = child(section, "right")
        for lane, beyond in zip(right, [*right[1:], None], strict=True):
            _add_lane(group, lane, beyond, road, version)


def _add_lane(
    group: Element, strip: OdrLane, beyond: OdrLane | None, road: OdrRoad, version: OpenDriveVersion
) -> None:
    kind, lane = "sidewalk" if strip.sidewalk else "none", strip.lane
    if lane is not None:
        kind = LANE_TYPE.get(lane.kind, lane.kind)
    direction = "reversed" if strip.reversed else None
    if version == "1.4" and (direction or kind == "bus"):
        # 1.4 has no bus lanes, and cannot say that a lane is driven the other way.
        kind, direction = "restricted", None
    item = child(group, "lane", type=kind, level="false", id=strip.number, direction=direction)
    link = child(item, "link")
    for tag, number in (("predecessor", strip.predecessor), ("successor", strip.successor)):
        if number is not None:
            child(link, tag, id=number)
    child(item, "width", sOffset=0, **strip.width._asdict())
    if road.junction >= 0:
        _add_mark(item, "none", "none")
    elif beyond is None or beyond.lane is None or lane is None:
        _add_mark(item, "solid", "none")
    else:
        _add_mark(item, *_between(lane, beyond.lane, leftward=strip.number > 0))
    if lane is not None:
        limit = round(lane.speed_limit_mps.value, 3)
        child(item, "speed", sOffset=0, unit="m/s", max=limit)


def _between(inner: Lane, outer: Lane, *, leftward: bool) -> tuple[str, str]:
    """Return the marking between two lanes, and to which side it may be crossed."""
    outward, inward = _may_leave(inner, outer), _may_leave(outer, inner)
    if inner.reverse != outer.reverse or not (outward or inward):
        return "solid", "none"
    if outward and inward:
        return "broken", "both"
    # To the left of lane 0 numbers grow outward, to the right inward.
    grows = outward == leftward
    return ("broken solid" if outward else "solid broken"), "increase" if grows else "decrease"


def _may_leave(lane: Lane, toward: Lane) -> bool:
    if lane.left_id == toward.id:
        return lane.change in ("both", "left")
    return lane.right_id == toward.id and lane.change in ("both", "right")


def _add_mark(item: Element, kind: str, change: str) -> None:
    width = None if kind == "none" else LINE_M
    style = {"type": kind, "weight": "standard", "color": "white", "width": width}
    child(item, "roadMark", sOffset=0, **style, laneChange=change)
