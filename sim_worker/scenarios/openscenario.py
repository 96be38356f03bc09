"""A case of a scenario as an OpenSCENARIO 1.2 file, for other simulators to play.

Positions are those of the World, which the OpenDRIVE file of the same World shares. The ego
follows its path at its speed until another driver is put in its place; others move as the case
says. Who keeps its speed follows a timed trajectory, so that the planned impact happens; who
stops follows a path and gets an event to brake, so that its numbers may be changed.
"""

from __future__ import annotations

import datetime
from pathlib import Path

from lxml import etree

from foretwin.contracts.numbers import FUTURE_NUMBERS
from foretwin.contracts.scenario import FAULTS, Scenario
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import ATTRIBUTION, World
from foretwin.geometry.frenet_path import PathPose
from foretwin.sim_worker.scenarios.openscenario_entities import (
    actor_object,
    ego_object,
    make,
    properties,
)
from foretwin.sim_worker.scenarios.openscenario_motion import (
    EntityMotion,
    actor_motion,
    after,
    ego_motion,
    maneuver_group,
    starts,
)
from foretwin.sim_worker.scenarios.roles import StagedCase
from foretwin.world_gen.export.opendrive import write_opendrive
from foretwin.world_gen.export.xml_tree import in_comment, legal

AUTHOR = "foretwin"
EXPORT_MARK = f'author="{AUTHOR}"'
"""What stands in each file that was written here."""
UNSAID = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)


def write_openscenario(
    played: StagedCase,
    scenario: Scenario,
    world: World,
    path: Path,
    *,
    vehicle: VehicleParameters,
    alone: PathPose | None = None,
    written_at: datetime.datetime = UNSAID,
) -> Path:
    """Write a case, and the roads it refers to beside it as OpenDRIVE; returns that file.

    Both in metres in the World's frame. `alone` is where the ego really drives at the `instants` of
    trajectories, if that is known. Raises ValueError where the World has no road with lanes.
    """
    roads = path.with_suffix(".xodr")
    root = openscenario_element(
        played,
        scenario,
        world,
        vehicle=vehicle,
        logic_file=roads.name,
        alone=alone,
        written_at=written_at,
    )
    write_opendrive(world, roads)
    with path.open("wb") as file:  # lxml would not say which file cannot be written
        etree.ElementTree(root).write(
            file, encoding="UTF-8", xml_declaration=True, pretty_print=True
        )
    return roads


def openscenario_element(
    played: StagedCase,
    scenario: Scenario,
    world: World,
    *,
    vehicle: VehicleParameters,
    logic_file: str,
    alone: PathPose | None = None,
    written_at: datetime.datetime = UNSAID,
) -> etree._Element:
    """Return the `<OpenSCENARIO>` element that `write_openscenario` writes.

    `logic_file` is where the OpenDRIVE file lies, as seen from this one.
    """
    motions = [ego_motion(played, horizon_s=scenario.horizon_s, alone=alone)]
    motions += [actor_motion(actor, horizon_s=scenario.horizon_s) for actor in played.actors]
    parameters = {"horizon_s": scenario.horizon_s}
    if (friction := _friction_factor(played)) != 1.0:
        parameters["friction_factor"] = friction
    for motion in motions:
        parameters |= motion.parameters
    declared = [
        make.ParameterDeclaration(name=name, parameterType="double", value=value)
        for name, value in parameters.items()
    ]
    return make.OpenSCENARIO(
        etree.Comment(f" Made by foretwin from map data: {in_comment(world.attribution)} "),
        _header(played, scenario, world, written_at),
        make.ParameterDeclarations(*declared),
        make.CatalogLocations(),
        make.RoadNetwork(make.LogicFile(filepath=logic_file)),
        make.Entities(
            ego_object(vehicle, speed_mps=played.ego_speed_mps),
            *(actor_object(actor) for actor in played.actors),
        ),
        _storyboard(played, motions),
    )


def _header(
    played: StagedCase, scenario: Scenario, world: World, written_at: datetime.datetime
) -> etree._Element:
    place, licences = played.place, []
    if world.attribution == ATTRIBUTION:
        licences = [
            make.License(
                words=world.attribution,
                name="Open Data Commons Open Database License 1.0",
                spdxId="ODbL-1.0",
                resource="https://www.openstreetmap.org/copyright",
            )
        ]
    said: dict[str, str | float] = {
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
        impact = {"time_s": played.impact_time_s, "x_m": x, "y_m": y, "share": played.impact_share}
        said["impact_with"] = played.impact_with
        said |= {f"impact_{name}": value for name, value in impact.items()}
    return make.FileHeader(
        *licences,
        properties(said | played.values),
        revMajor="1",
        revMinor="2",
        author=AUTHOR,
        date=written_at.astimezone(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        description=legal(f"{scenario.title}: {scenario.shows} Map: {world.attribution}"),
    )


def _friction_factor(played: StagedCase) -> float:
    """Return what the case's numbers make of the ground's friction: all that OpenSCENARIO takes."""
    factor = 1.0
    for name, row in FUTURE_NUMBERS.items():
        if row.acts_on == "ground.friction_factor":
            factor = row.joined(factor, played.values.get(f"{FAULTS}.{name}", row.neutral))
    return factor


def _storyboard(played: StagedCase, motions: list[EntityMotion]) -> etree._Element:
    actions = []
    if _friction_factor(played) != 1.0:
        road = make.RoadCondition(frictionScaleFactor="$friction_factor")
        action = make.EnvironmentAction(make.Environment(road, name="road surface"))
        actions.append(make.GlobalAction(action))
    actions += [starts(motion) for motion in motions]
    act = make.Act(
        *(maneuver_group(motion) for motion in motions if motion.moves),
        after("0", tag="StartTrigger", name="from the beginning"),
        name=f"{played.place.scenario_id} as cast",
    )
    return make.Storyboard(
        make.Init(make.Actions(*actions)),
        make.Story(act, name=played.place.scenario_id),
        after("$horizon_s", tag="StopTrigger", name="end of the case"),
    )
