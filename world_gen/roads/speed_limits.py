"""How fast one may drive: by signs, by zones, else by the country's rules for the class of road."""

from __future__ import annotations

import re
from collections.abc import Mapping

from foretwin.contracts.provenance import Quantity
from foretwin.world_gen.countries.rules import CountryRules, rules_of
from foretwin.world_gen.roads.road_classes import road_class

_ZONE_KMPH = {
    "bicycle_road": 30.0,
    "pedestrian_zone": 7.0,
    "walk": 7.0,
    "nsl_restricted": 48.28,
    "nsl_single": 96.56,
    "nsl_dual": 112.65,
}
"""Zones that mean the same wherever they are signed; others are their country's."""
_KMPH_FROM_UNIT = {"": 1.0, "kmh": 1.0, "km/h": 1.0, "kph": 1.0, "mph": 1.609344, "knots": 1.852}
_SPEED = re.compile(r"^\s*(\d+(?:\.\d+)?)\s*([a-z/]*)\s*$")
_ZONE_KEYS = ("maxspeed", "maxspeed:type", "source:maxspeed", "zone:maxspeed", "zone:traffic")
_UNLIMITED_KMPH = 130.0
"""What a German motorway without a limit recommends."""
_THROUGH = frozenset({"primary", "secondary", "tertiary"})
"""Classes whose roads lead through towns and between them."""
_FAST = frozenset({"motorway", "trunk"})


def speed_limit(tags: Mapping[str, str], country: str = "", *, reverse: bool = False) -> Quantity:
    """Return the speed limit in m/s: a sign's number is tagged, a zone's inferred, else default.

    It is that along the way's nodes, with `reverse` that against them. A direction of which nothing
    is told has the other's sign, inferred. An unlimited motorway gets the recommended 130 km/h.
    """
    own, other = ("backward", "forward") if reverse else ("forward", "backward")
    for key in (f"maxspeed:{own}", "maxspeed"):
        if (posted := posted_limit(tags.get(key))) is not None:
            return posted
    for key in (zone for one in _ZONE_KEYS for zone in (f"{one}:{own}", one)):
        if (speed := _zone_kmph(tags.get(key), country)) is not None:
            return Quantity(speed / 3.6, "inferred")
    if (posted := posted_limit(tags.get(f"maxspeed:{other}"))) is not None:
        return Quantity(posted.value, "inferred")
    return Quantity(_usual_kmph(tags, rules_of(country)) / 3.6, "default")


def posted_limit(text: str | None) -> Quantity | None:
    """Return what a sign says, in m/s; None where it is none of a number, or of no limit."""
    speed = _signed_kmph(text)
    if speed is not None:
        return Quantity(speed / 3.6, "tagged")
    return Quantity(_UNLIMITED_KMPH / 3.6, "inferred") if text == "none" else None


def in_town(tags: Mapping[str, str]) -> bool:
    """Tell whether a road without a sign lies in a town.

    Between towns a road for through traffic has a number but no name, or is said to have no lamps.
    Of the metres with a sign, up to 65 km/h being a town's, this tells 85 % right in a German map
    of main roads (42 % are in towns), in Liechtenstein, which names its roads, 69 %: no more than
    a guess.
    """
    name, lit = tags.get("highway", ""), tags.get("lit", "")
    if lit and lit != "no":
        return True
    if name in _THROUGH and "junction" not in tags:
        return not lit and "name" in tags
    return name not in _FAST


def _usual_kmph(tags: Mapping[str, str], rules: CountryRules) -> float:
    name = tags.get("highway", "")
    known = road_class(name).kmph
    if known is not None:
        return known
    of_class = {
        "motorway": rules.motorway_kmph,
        "living_street": rules.living_street_kmph,
        "residential": rules.local_kmph,
    }
    if name in of_class:
        return of_class[name]
    if in_town(tags):
        return rules.town_kmph
    apart = tags.get("motorroad") == "yes" or (name == "trunk" and tags.get("oneway") == "yes")
    return rules.dual_kmph if apart else rules.rural_kmph


def _signed_kmph(text: str | None) -> float | None:
    if text is None:
        return None
    match = _SPEED.match(text.split(";")[0].lower())
    if match is None or match[2] not in _KMPH_FROM_UNIT:
        return None
    speed = float(match[1]) * _KMPH_FROM_UNIT[match[2]]
    return speed if speed > 0.0 else None


def _zone_kmph(text: str | None, country: str) -> float | None:
    """Return the speed of a zone such as `DE:urban`, by the country it names, else that of here."""
    if text is None or text.startswith("http"):
        return None
    named, _, zone = text.rpartition(":") if ":" in text else ("", "", text)
    zone, rules = zone.lower(), rules_of(named.upper()[:2] or country)
    of_country = {
        "urban": rules.town_kmph,
        "rural": rules.rural_kmph,
        "motorway": rules.motorway_kmph,
        "trunk": rules.dual_kmph,
        "living_street": rules.living_street_kmph,
    }
    if zone in of_country:
        return of_country[zone]
    if zone in _ZONE_KMPH:
        return _ZONE_KMPH[zone]
    number = re.fullmatch(r"(?:zone)?(\d{1,3})", zone)
    return float(number[1]) if number is not None and int(number[1]) > 0 else None
