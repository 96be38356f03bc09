"""Junctions of an OpenDRIVE file: connections, who waits for whom, controllers, rings."""

from __future__ import annotations

from collections.abc import Sequence

from lxml import etree

from foretwin.contracts.world import World
from foretwin.world_gen.export.opendrive_elements import Version, text
from foretwin.world_gen.export.opendrive_places import OdrJunction, OdrNetwork
from foretwin.world_gen.export.opendrive_signals import Controller

RING_KINDS = ("roundabout", "circular", "mini_roundabout")


def junction_elements(
    world: World, network: OdrNetwork, controllers: Sequence[Controller], version: Version
) -> list[etree._Element]:
    """Return a `<junction>` for each junction."""
    names = {item.summary.id: item.summary.name for item in world.junctions}
    roads = {
        item.connection.id: item.road.id
        for junction in network.junctions
        for item in junction.connections
    }
    waits: dict[int, list[tuple[int, int]]] = {}
    at = {
        item.road.id: junction.id for junction in network.junctions for item in junction.connections
    }
    for conflict in world.conflicts:
        if conflict.first_id not in roads or conflict.second_id not in roads:
            continue
        low, high = roads[conflict.yields_id], roads[conflict.goes_id]
        if at[low] == at[high]:
            waits.setdefault(at[low], []).append((high, low))
    return [
        _element(
            junction,
            names.get(junction.junction_id, ""),
            waits.get(junction.id, ()),
            [c.id for c in controllers if junction.id in c.junctions],
            version,
        )
        for junction in network.junctions
    ]


def _element(
    junction: OdrJunction,
    name: str,
    waits: Sequence[tuple[int, int]],
    controllers: Sequence[int],
    version: Version,
) -> etree._Element:
    element = etree.Element("junction", name=text(name))
    element.set("id", str(junction.id))
    if version == "1.8":
        element.set("type", "default")
    for i, item in enumerate(junction.connections):
        connection = etree.SubElement(
            element,
            "connection",
            incomingRoad=str(item.incoming),
            connectingRoad=str(item.road.id),
            contactPoint="start",
        )
        connection.set("id", str(i))
        link = etree.SubElement(connection, "laneLink")
        link.set("from", str(item.from_number))
        link.set("to", str(item.to_number))
    for high, low in waits:
        etree.SubElement(element, "priority", high=str(high), low=str(low))
    for own in controllers:
        etree.SubElement(element, "controller", type="0").set("id", str(own))
    etree.SubElement(element, "userData", code="foretwin_place", value=junction.place)
    return element


def ring_elements(world: World, network: OdrNetwork) -> list[etree._Element]:
    """Return a `<junctionGroup>` for each roundabout whose ring has several junctions."""
    kinds = {item.summary.id: item.summary.kind for item in world.junctions}
    rings: dict[str, list[int]] = {}
    for junction in network.junctions:
        if kinds.get(junction.junction_id) in RING_KINDS:
            rings.setdefault(junction.junction_id, []).append(junction.id)
    found = []
    for i, (name, members) in enumerate(rings.items(), start=1):
        group = etree.Element("junctionGroup", name=name, type="roundabout")
        group.set("id", str(i))
        for member in members:
            etree.SubElement(group, "junctionReference", junction=str(member))
        found.append(group)
    return found
