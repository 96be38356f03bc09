"""Decode OPL, osmium's text form with one object per line, into plain Python objects.

Reading a way's nodes one by one out of osmium's objects takes several times longer than osmium
needs to decode the whole file; letting it write what passes its filters as text and splitting
that is the quickest way across. The format: https://osmcode.org/opl-file-format/
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from world_gen.osm_map import OsmMember, OsmRelation, OsmWay

_ESCAPE = re.compile("%([0-9a-f]+)%")


@dataclass(slots=True)
class OplObjects:
    """Objects by id; `locations` are (lat, lon) of the nodes and of the nodes of the ways."""

    node_tags: dict[int, dict[str, str]] = field(default_factory=dict)
    ways: dict[int, OsmWay] = field(default_factory=dict)
    relations: dict[int, OsmRelation] = field(default_factory=dict)
    locations: dict[int, tuple[float, float]] = field(default_factory=dict)


def add_opl(
    objects: OplObjects,
    lines: Iterable[str],
    keeps_relation: Callable[[Mapping[str, str]], bool],
) -> None:
    """Add what lines of OPL hold; ways need their nodes' locations written with them.

    Of relations only those whose tags `keeps_relation` accepts, since routes have many members.
    """
    for line in lines:
        parts = line.rstrip("\n").split(" ")
        head = parts[0]
        if not head:
            continue
        fields = {part[0]: part[1:] for part in parts[1:] if part}
        key = int(head[1:])
        if head[0] == "w":
            nodes = _way_nodes(fields.get("N", ""), objects.locations)
            objects.ways[key] = OsmWay(key, nodes, _tags(fields.get("T", "")))
        elif head[0] == "n":
            objects.node_tags[key] = _tags(fields.get("T", ""))
            if fields.get("x"):
                objects.locations[key] = (float(fields["y"]), float(fields["x"]))
        elif head[0] == "r":
            tags = _tags(fields.get("T", ""))
            if keeps_relation(tags):
                members = tuple(_member(text) for text in fields.get("M", "").split(",") if text)
                objects.relations[key] = OsmRelation(key, members, tags)


def _way_nodes(text: str, locations: dict[int, tuple[float, float]]) -> tuple[int, ...]:
    nodes = []
    for item in text.split(",") if text else ():
        node_text, _, position = item.partition("x")
        node = int(node_text[1:])
        nodes.append(node)
        if position and node not in locations:
            x_deg, _, y_deg = position.partition("y")
            if x_deg:
                locations[node] = (float(y_deg), float(x_deg))
    return tuple(nodes)


def _tags(text: str) -> dict[str, str]:
    if not text:
        return {}
    pairs = [item.split("=", 1) for item in text.split(",")]
    if "%" in text:
        return {_plain(key): _plain(value) for key, value in pairs}
    return {key: value for key, value in pairs}  # noqa: C416


def _member(text: str) -> OsmMember:
    target, _, role = text.partition("@")
    return OsmMember(target[0], int(target[1:]), _plain(role) if "%" in role else role)


def _plain(text: str) -> str:
    return _ESCAPE.sub(lambda match: chr(int(match[1], 16)), text)
