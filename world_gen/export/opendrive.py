"""A World as an OpenDRIVE file, 1.8 or, for CARLA, 1.4."""

from __future__ import annotations

from pathlib import Path

from lxml import etree

from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.world import ATTRIBUTION, World
from foretwin.world_gen.export.opendrive_elements import Version, number, road_element, text
from foretwin.world_gen.export.opendrive_junctions import junction_elements, ring_elements
from foretwin.world_gen.export.opendrive_objects import add_objects
from foretwin.world_gen.export.opendrive_places import network_of
from foretwin.world_gen.export.opendrive_signals import add_signals
from foretwin.world_gen.export.xml_text import in_comment


def write_opendrive(world: World, path: Path, *, version: Version = "1.8") -> None:
    """Write the World's roads, junctions, signals and buildings.

    Metres in the World's frame, whose PROJ string stands in `<geoReference>`. Raises ValueError
    where the World has no road with lanes.
    """
    root = opendrive_element(world, version=version)
    tree = etree.ElementTree(root)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:  # lxml would not say which file cannot be written
        tree.write(file, encoding="UTF-8", xml_declaration=True, pretty_print=True)


def opendrive_element(world: World, *, version: Version = "1.8") -> etree._Element:
    """Return the `<OpenDRIVE>` element that `write_opendrive` writes."""
    network = network_of(world)
    if not network.roads:
        raise ValueError(f"world {world.id}: no road with lanes to write as OpenDRIVE")
    root = etree.Element("OpenDRIVE")
    root.append(etree.Comment(f" Made by foretwin from map data: {in_comment(world.attribution)} "))
    root.append(_header(world, version))
    elements = {
        road.id: road_element(road, side=network.side, version=version) for road in network.roads
    }
    add_objects(world, network, elements, version)
    controllers = add_signals(world, network, elements, version)
    for road in network.roads:
        etree.SubElement(elements[road.id], "userData", code="foretwin_id", value=road.source)
        root.append(elements[road.id])
    root.extend(controller.element for controller in controllers)
    root.extend(junction_elements(world, network, controllers, version))
    root.extend(ring_elements(world, network))
    return root


def proj_of(frame: LocalFrame) -> str:
    """Return the PROJ string of a local frame (see `foretwin.contracts.frames`)."""
    return (
        f"+proj=tmerc +lat_0={frame.origin.lat_deg!r} +lon_0={frame.origin.lon_deg!r} "
        "+k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m"
    )


def _header(world: World, version: Version) -> etree._Element:
    if world.bounds_m is not None:
        west, south, east, north = world.bounds_m
    else:
        west = south = -world.radius_m
        east = north = world.radius_m
    header = etree.Element(
        "header",
        revMajor="1",
        revMinor=version.partition(".")[2],
        name=text(world.intersection.name or world.intersection.id),
        version="1.00",
        north=number(north),
        south=number(south),
        east=number(east),
        west=number(west),
        vendor="foretwin",
    )
    reference = etree.SubElement(header, "geoReference")
    reference.text = etree.CDATA(proj_of(world.frame))
    if version == "1.8" and world.attribution == ATTRIBUTION:
        etree.SubElement(
            header,
            "license",
            name="Open Data Commons Open Database License 1.0",
            spdxid="ODbL-1.0",
            resource="https://www.openstreetmap.org/copyright",
        )
    for code, value in (
        ("attribution", text(world.attribution)),
        ("foretwin_world", world.id),
        ("map_sha256", world.map_sha256),
    ):
        etree.SubElement(header, "userData", code=code, value=value)
    return header
