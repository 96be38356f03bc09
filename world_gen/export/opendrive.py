"""A World as an OpenDRIVE file, 1.8 or, for CARLA, 1.4."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from lxml import etree

from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.world import ATTRIBUTION, ROUNDABOUT_KINDS, World
from foretwin.world_gen.export.choices import OpenDriveVersion
from foretwin.world_gen.export.opendrive_elements import road_element
from foretwin.world_gen.export.opendrive_objects import add_objects
from foretwin.world_gen.export.opendrive_one_ways import parted_by_direction
from foretwin.world_gen.export.opendrive_places import OdrJunction, OdrNetwork, network_of
from foretwin.world_gen.export.opendrive_signals import Controller, add_signals
from foretwin.world_gen.export.xml_tree import Element, child, document, element, in_comment

_LICENSE = {
    "name": "Open Data Commons Open Database License 1.0",
    "spdxid": "ODbL-1.0",
    "resource": "https://www.openstreetmap.org/copyright",
}


def write_opendrive(world: World, path: Path, *, version: OpenDriveVersion = "1.8") -> None:
    """Write the World's roads, junctions, signals and buildings.

    Metres in the World's frame, whose PROJ string stands in `<geoReference>`. Raises ValueError
    where the World has no road with lanes.
    """
    root = opendrive_element(world, version=version)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(document(root, pretty_print=True))


def opendrive_element(world: World, *, version: OpenDriveVersion = "1.8") -> Element:
    """Return the `<OpenDRIVE>` element that `write_opendrive` writes."""
    one_ways = version == "1.4" and world.intersection.driving_side == "left"
    world = parted_by_direction(world) if one_ways else world
    network = network_of(world, rule="right" if version == "1.4" else None)
    if not network.roads:
        raise ValueError(f"world {world.id}: no road with lanes to write as OpenDRIVE")
    root = element("OpenDRIVE")
    root.append(etree.Comment(f" Made by foretwin from map data: {in_comment(world.attribution)} "))
    root.append(_header(world, version))
    elements = {
        road.id: road_element(road, side=network.rule, version=version) for road in network.roads
    }
    add_objects(world, network, elements, version)
    controllers = add_signals(world, network, elements, version)
    for road in network.roads:
        child(elements[road.id], "userData", code="foretwin_id", value=road.source)
        root.append(elements[road.id])
    root.extend(controller.element for controller in controllers)
    root.extend(_junctions(world, network, controllers, version))
    root.extend(_rings(world, network))
    return root


def proj_of(frame: LocalFrame) -> str:
    """Return the PROJ string of a local frame (see `foretwin.contracts.frames`)."""
    return (
        f"+proj=tmerc +lat_0={frame.origin.lat_deg!r} +lon_0={frame.origin.lon_deg!r} "
        "+k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m"
    )


def _header(world: World, version: OpenDriveVersion) -> Element:
    reach = world.radius_m
    west, south, east, north = world.bounds_m or (-reach, -reach, reach, reach)
    header = element(
        "header",
        revMajor=1,
        revMinor=version.partition(".")[2],
        name=world.intersection.name or world.intersection.id,
        version="1.00",
        north=float(north),
        south=float(south),
        east=float(east),
        west=float(west),
        vendor="foretwin",
    )
    child(header, "geoReference").text = etree.CDATA(proj_of(world.frame))
    if version == "1.8" and world.attribution == ATTRIBUTION:
        child(header, "license", **_LICENSE)
    child(header, "userData", code="attribution", value=world.attribution)
    child(header, "userData", code="foretwin_world", value=world.id)
    child(header, "userData", code="map_sha256", value=world.map_sha256)
    return header


def _junctions(
    world: World, network: OdrNetwork, controllers: Sequence[Controller], version: OpenDriveVersion
) -> list[Element]:
    """Return a `<junction>` for each junction."""
    names = {item.summary.id: item.summary.name for item in world.junctions}
    at = {c.road.id: junction.id for junction in network.junctions for c in junction.connections}
    waits: dict[int, list[tuple[int, int]]] = defaultdict(list)
    for conflict in world.conflicts:
        low = network.connecting.get(conflict.yields_id)
        high = network.connecting.get(conflict.goes_id)
        if low is not None and high is not None and at[low.id] == at[high.id]:
            waits[at[low.id]].append((high.id, low.id))
    found = []
    for junction in network.junctions:
        made = _junction(junction, names.get(junction.junction_id, ""), version)
        for first, second in waits[junction.id]:
            child(made, "priority", high=first, low=second)
        for controller in controllers:
            if junction.id in controller.junctions:
                child(made, "controller", type=0, id=controller.id)
        child(made, "userData", code="foretwin_place", value=junction.place)
        found.append(made)
    return found


def _junction(junction: OdrJunction, name: str, version: OpenDriveVersion) -> Element:
    """Return a `<junction>` with its connections."""
    kind = "default" if version == "1.8" else None
    made = element("junction", name=name, id=junction.id, type=kind)
    for i, item in enumerate(junction.connections):
        roads, lane = (
            {"incomingRoad": item.incoming.id, "connectingRoad": item.road.id},
            item.road.lanes[0],
        )
        connection = child(made, "connection", **roads, contactPoint="start", id=i)
        child(connection, "laneLink", from_=lane.predecessor, to=lane.number)
    return made


def _rings(world: World, network: OdrNetwork) -> list[Element]:
    """Return a `<junctionGroup>` for each roundabout whose ring has several junctions."""
    kinds = {item.summary.id: item.summary.kind for item in world.junctions}
    rings: dict[str, Element] = {}
    for junction in network.junctions:
        name = junction.junction_id
        if kinds.get(name) in ROUNDABOUT_KINDS:
            if name not in rings:
                rings[name] = element(
                    "junctionGroup", name=name, type="roundabout", id=len(rings) + 1
                )
            child(rings[name], "junctionReference", junction=junction.id)
    return list(rings.values())
