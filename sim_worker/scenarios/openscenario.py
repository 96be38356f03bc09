"""A case of a scenario as an OpenSCENARIO 1.2 file, for other simulators to play.

Positions are those of the World, which the OpenDRIVE file of the same World shares. The ego
follows its path at its speed until another driver is put in its place; others move as the case
says. Who keeps its speed follows a timed trajectory, so that the planned impact happens; who
stops follows a path and is told to brake, so that its numbers may be changed.
"""

from __future__ import annotations

import datetime
from pathlib import Path

from lxml import etree

from foretwin.contracts.numbers import FUTURE_NUMBERS
from foretwin.contracts.scenario import FAULTS, Scenario
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import ATTRIBUTION, World
from foretwin.sim_worker.scenarios.openscenario_entities import actor_object, ego_object
from foretwin.sim_worker.scenarios.openscenario_motion import (
    Motion,
    actor_motion,
    after,
    ego_motion,
    maneuver_group,
    starts,
)
from foretwin.sim_worker.scenarios.roles import Cast
from foretwin.world_gen.export.opendrive import write_opendrive
from foretwin.world_gen.export.xml_tree import in_comment, legal, number

UNSAID = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)


def write_openscenario(
    played: Cast,
    scenario: Scenario,
    world: World,
    path: Path,
    *,
    vehicle: VehicleParameters,
    written_at: datetime.datetime = UNSAID,
) -> Path:
    """Write a case, and the roads it refers to beside it as OpenDRIVE; returns that file.

    Both in metres in the World's frame. Raises ValueError where the World has no road with lanes.
    """
    roads = path.with_suffix(".xodr")
    root = openscenario_element(
        played, scenario, world, vehicle=vehicle, logic_file=roads.name, written_at=written_at
    )
    write_opendrive(world, roads)
    with path.open("wb") as file:  # lxml would not say which file cannot be written
        etree.ElementTree(root).write(
            file, encoding="UTF-8", xml_declaration=True, pretty_print=True
        )
    return roads


def openscenario_element(
    played: Cast,
    scenario: Scenario,
    world: World,
    *,
    vehicle: VehicleParameters,
    logic_file: str,
    written_at: datetime.datetime = UNSAID,
) -> etree._Element:
    """Return the `<OpenSCENARIO>` element that `write_openscenario` writes.

    `logic_file` is where the OpenDRIVE file lies, as seen from this one.
    """
    motions = [ego_motion(played, horizon_s=scenario.horizon_s)]
    motions += [actor_motion(actor, horizon_s=scenario.horizon_s) for actor in played.actors]
    root = etree.Element("OpenSCENARIO")
    root.append(etree.Comment(f" Made by foretwin from map data: {in_comment(world.attribution)} "))
    root.append(_header(played, scenario, world, written_at))
    parameters = {"horizon_s": scenario.horizon_s}
    if (friction := _friction_factor(played)) != 1.0:
        parameters["friction_factor"] = friction
    for motion in motions:
        parameters |= motion.parameters
    declared = etree.SubElement(root, "ParameterDeclarations")
    for name, value in parameters.items():
        etree.SubElement(
            declared, "ParameterDeclaration", name=name, parameterType="double",
            value=number(value),
        )  # fmt: skip
    etree.SubElement(root, "CatalogLocations")
    network = etree.SubElement(root, "RoadNetwork")
    etree.SubElement(network, "LogicFile", filepath=logic_file)
    entities = etree.SubElement(root, "Entities")
    entities.append(ego_object(vehicle))
    entities.extend(actor_object(actor) for actor in played.actors)
    root.append(_storyboard(played, motions))
    return root


def _header(
    played: Cast, scenario: Scenario, world: World, written_at: datetime.datetime
) -> etree._Element:
    place = played.place
    header = etree.Element(
        "FileHeader", revMajor="1", revMinor="2", author="foretwin",
        date=written_at.astimezone(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        description=legal(f"{scenario.title}: {scenario.shows} Map: {world.attribution}"),
    )  # fmt: skip
    if world.attribution == ATTRIBUTION:
        etree.SubElement(
            header, "License", name="Open Data Commons Open Database License 1.0",
            spdxId="ODbL-1.0", resource="https://www.openstreetmap.org/copyright",
        ).text = world.attribution  # fmt: skip
    said = {
        "attribution": world.attribution,
        "scenario": scenario.id,
        "source": scenario.source,
        "world": world.id,
        "map_sha256": world.map_sha256,
        "junction": place.junction_id,
        "place": place.name,
        "driving_side": place.driving_side,
    }
    if played.impact_with:
        x, y = played.impact_point_m
        said |= {
            "impact_with": played.impact_with,
            "impact_time_s": number(played.impact_time_s),
            "impact_x_m": number(x),
            "impact_y_m": number(y),
        }
    said |= {name: number(value) for name, value in played.values.items()}
    properties = etree.SubElement(header, "Properties")
    for name, words in said.items():
        etree.SubElement(properties, "Property", name=name, value=legal(words))
    return header


def _friction_factor(played: Cast) -> float:
    """Return what the case's numbers make of the ground's friction: all that OpenSCENARIO takes."""
    factor = 1.0
    for name, row in FUTURE_NUMBERS.items():
        if row.acts_on == "ground.friction_factor":
            factor = row.joined(factor, played.values.get(f"{FAULTS}.{name}", row.neutral))
    return factor


def _storyboard(played: Cast, motions: list[Motion]) -> etree._Element:
    board = etree.Element("Storyboard")
    init = etree.SubElement(etree.SubElement(board, "Init"), "Actions")
    if _friction_factor(played) != 1.0:
        action = etree.SubElement(init, "GlobalAction")
        action = etree.SubElement(action, "EnvironmentAction")
        road = etree.SubElement(action, "Environment", name="road surface")
        etree.SubElement(road, "RoadCondition", frictionScaleFactor="$friction_factor")
    for motion in motions:
        init.append(starts(motion))
    story = etree.SubElement(board, "Story", name=played.scenario_id)
    act = etree.SubElement(story, "Act", name=f"{played.scenario_id} as cast")
    act.extend(maneuver_group(motion) for motion in motions if motion.moves)
    act.append(after("0", tag="StartTrigger", name="from the beginning"))
    board.append(after("$horizon_s", tag="StopTrigger", name="end of the case"))
    return board
