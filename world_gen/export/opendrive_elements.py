"""Roads and junctions as elements of an OpenDRIVE file."""

from __future__ import annotations

import math
from typing import Literal

from lxml import etree

from foretwin.contracts.world import DrivingSide, Lane
from foretwin.world_gen.export.opendrive_curve import Curve
from foretwin.world_gen.export.opendrive_roads import Cubic, OdrLane, OdrRoad
from foretwin.world_gen.export.xml_text import legal

Version = Literal["1.8", "1.4"]
LANE_TYPE = {
    "1.8": {
        "driving": "driving",
        "bus": "bus",
        "bicycle": "biking",
        "parking": "parking",
        "tram": "tram",
    },
    "1.4": {
        "driving": "driving",
        "bus": "restricted",
        "bicycle": "biking",
        "parking": "parking",
        "tram": "tram",
    },
}
"""1.4 has no bus lanes."""
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
IN_1_4 = {
    "townExpressway": "town",
    "townArterial": "town",
    "townCollector": "town",
    "townLocal": "town",
    "townPrivate": "town",
}
TOWN_KMH = 70.0
LINE_M = 0.12
"""Width of a lane marking."""


def text(words: str) -> str:
    """Return words from a map with what XML 1.0 cannot hold as question marks."""
    return legal(words, instead="?")


def number(value: float) -> str:
    """Return a number with as many digits as a nanometre over a kilometre needs."""
    return f"{value + 0.0:.12g}"


def road_element(road: OdrRoad, *, side: DrivingSide, version: Version) -> etree._Element:
    """Return a `<road>` without objects and signals."""
    element = etree.Element("road", name=text(road.name), length=number(road.curve.length_m))
    element.set("id", str(road.id))
    element.set("junction", str(road.junction))
    if version == "1.8" or side == "left":
        # 1.4 does not know it, but its readers that know left-hand traffic read it there too.
        element.set("rule", "RHT" if side == "right" else "LHT")
    _add_links(element, road)
    _add_type(element, road, version)
    _add_plan_view(element, road.curve)
    profile = etree.SubElement(element, "elevationProfile")
    etree.SubElement(profile, "elevation", {"s": "0", **_coefficients(road.height)})
    _add_lanes(element, road, side=side, version=version)
    return element


def _add_links(element: etree._Element, road: OdrRoad) -> None:
    link = etree.SubElement(element, "link")
    for tag, to in (("predecessor", road.predecessor), ("successor", road.successor)):
        if to is None:
            continue
        kind, other, at_end = to
        item = etree.SubElement(link, tag, elementType=kind, elementId=str(other))
        if kind == "road":
            item.set("contactPoint", "end" if at_end else "start")


def _add_type(element: etree._Element, road: OdrRoad, version: Version) -> None:
    limits = [lane.lane.speed_limit_mps.value for lane in road.lanes if lane.lane is not None]
    kmh = round(max(limits) * 3.6) if limits else 0
    in_town, outside = ROAD_TYPE.get(road.road_class.removesuffix("_link"), ("unknown", "unknown"))
    kind = in_town if kmh <= TOWN_KMH else outside
    kind = IN_1_4.get(kind, kind) if version == "1.4" else kind
    item = etree.SubElement(element, "type", s="0", type=kind)
    if limits:
        etree.SubElement(item, "speed", max=str(kmh), unit="km/h")


def _add_plan_view(element: etree._Element, curve: Curve) -> None:
    plan = etree.SubElement(element, "planView")
    s = 0.0
    for control, straight, length in zip(
        curve.controls.tolist(), curve.straight, curve.lengths_m.tolist(), strict=True
    ):
        (x0, y0), (x1, y1), (x2, y2), (x3, y3) = control
        heading = math.atan2(y1 - y0, x1 - x0)
        item = etree.SubElement(
            plan,
            "geometry",
            s=number(s),
            x=number(x0),
            y=number(y0),
            hdg=number(heading),
            length=number(length),
        )
        s += length
        if straight:
            etree.SubElement(item, "line")
            continue
        cos, sin = math.cos(heading), math.sin(heading)
        u = [cos * (x - x0) + sin * (y - y0) for x, y in ((x1, y1), (x2, y2), (x3, y3))]
        v = [cos * (y - y0) - sin * (x - x0) for x, y in ((x1, y1), (x2, y2), (x3, y3))]
        etree.SubElement(
            item,
            "paramPoly3",
            aU="0",
            bU=number(3 * u[0]),
            cU=number(3 * u[1] - 6 * u[0]),
            dU=number(u[2] - 3 * u[1] + 3 * u[0]),
            aV="0",
            bV="0",
            cV=number(3 * v[1]),
            dV=number(v[2] - 3 * v[1]),
            pRange="normalized",
        )


def _add_lanes(
    element: etree._Element, road: OdrRoad, *, side: DrivingSide, version: Version
) -> None:
    lanes = etree.SubElement(element, "lanes")
    if any(road.offset):
        etree.SubElement(lanes, "laneOffset", {"s": "0", **_coefficients(road.offset)})
    section = etree.SubElement(lanes, "laneSection", s="0")
    left = [lane for lane in road.lanes if lane.number > 0]
    right = [lane for lane in road.lanes if lane.number < 0]
    if left:
        group = etree.SubElement(section, "left")
        for i, lane in enumerate(left):
            _add_lane(group, lane, left[i - 1] if i else None, road, version)
    centre = etree.SubElement(
        etree.SubElement(section, "center"), "lane", type="none", level="false"
    )
    centre.set("id", "0")
    kind = "broken" if left and right and road.junction < 0 else "solid"
    _add_mark(centre, "none" if road.junction >= 0 else kind, "none", version)
    if right:
        group = etree.SubElement(section, "right")
        for i, lane in enumerate(right):
            beyond = right[i + 1] if i + 1 < len(right) else None
            _add_lane(group, lane, beyond, road, version)


def _add_lane(
    group: etree._Element, lane: OdrLane, beyond: OdrLane | None, road: OdrRoad, version: Version
) -> None:
    kind = "sidewalk" if lane.sidewalk else "none"
    kind = kind if lane.lane is None else LANE_TYPE[version][lane.lane.kind]
    if lane.reversed and version == "1.4":
        kind = "restricted"  # 1.4 cannot tell that it is driven the other way
    item = etree.SubElement(group, "lane", type=kind, level="false")
    item.set("id", str(lane.number))
    if lane.reversed and version == "1.8":
        item.set("direction", "reversed")
    link = etree.SubElement(item, "link")
    if lane.predecessor is not None:
        etree.SubElement(link, "predecessor").set("id", str(lane.predecessor))
    if lane.successor is not None:
        etree.SubElement(link, "successor").set("id", str(lane.successor))
    etree.SubElement(item, "width", {"sOffset": "0", **_coefficients(lane.width)})
    if road.junction >= 0:
        _add_mark(item, "none", "none", version)
    elif beyond is None or beyond.lane is None or lane.lane is None:
        _add_mark(item, "solid", "none", version)
    else:
        _add_mark(item, *_between(lane, beyond), version)
    if lane.lane is not None:
        speed = etree.SubElement(item, "speed", sOffset="0", unit="m/s")
        speed.set("max", number(round(lane.lane.speed_limit_mps.value, 3)))


def _between(inner: OdrLane, outer: OdrLane) -> tuple[str, str]:
    """Return the marking between two lanes, and to which side it may be crossed."""
    a, b = inner.lane, outer.lane
    assert a is not None
    assert b is not None
    if a.reverse != b.reverse:
        return "solid", "none"
    outward, inward = _may_leave(a, b), _may_leave(b, a)
    if outward and inward:
        return "broken", "both"
    if not outward and not inward:
        return "solid", "none"
    # To the left of lane 0 numbers grow outward, to the right inward.
    grows = outward == (inner.number > 0)
    return ("broken solid" if outward else "solid broken"), "increase" if grows else "decrease"


def _may_leave(lane: Lane, toward: Lane) -> bool:
    if lane.left_id == toward.id:
        return lane.change in ("both", "left")
    return lane.right_id == toward.id and lane.change in ("both", "right")


def _add_mark(item: etree._Element, kind: str, change: str, version: Version) -> None:
    mark = etree.SubElement(
        item, "roadMark", sOffset="0", type=kind, weight="standard", color="white"
    )
    if kind != "none":
        mark.set("width", number(LINE_M))
    mark.set("laneChange", change)


def _coefficients(cubic: Cubic) -> dict[str, str]:
    return {key: number(value) for key, value in zip("abcd", cubic, strict=True)}
