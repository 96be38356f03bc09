"""The command line of scenarios: what each command takes. The work is where it is imported from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foretwin.orchestrator.commands.cli_help import CommandGroup
from foretwin.orchestrator.commands.cli_options import MapArgument, ServiceRoadsOption
from foretwin.orchestrator.commands.told import CommandResult, told

scenarios = CommandGroup(name="scenarios", help="List, check, place, draw and export scenarios.")


@scenarios.callback(invoke_without_command=True)
@told
def list_scenarios(context: typer.Context) -> CommandResult | None:
    """List the scenarios that come with foretwin, or check and place scenarios."""
    if context.invoked_subcommand is not None:
        return None
    from foretwin.orchestrator.commands.scenario_catalogue import list_scenarios as list_them

    return list_them()


@scenarios.command("check")
@told
def check_scenario(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="scenario, TOML")],
) -> CommandResult:
    """Say whether a scenario file is sound, and how many cases it has.

    Example: foretwin scenarios check SCENARIO.toml
    """
    from foretwin.orchestrator.commands.scenario_catalogue import check_scenario_file

    return check_scenario_file(file)


@scenarios.command("place")
@told
def place_scenarios(
    map_file: MapArgument,
    scenario: Annotated[
        list[str] | None, typer.Option(help="id or TOML file; may be repeated [default: all]")
    ] = None,
    junction_id: Annotated[str | None, typer.Option("--id", help="only this junction")] = None,
    at: Annotated[str | None, typer.Option(help="LAT,LON: only the junction nearest to it")] = None,
    service_roads: ServiceRoadsOption = False,
) -> CommandResult:
    """Say which junctions of a map take which scenarios, and why not elsewhere.

    Example: foretwin scenarios place MAP.osm --scenario ccftap
    """
    from foretwin.orchestrator.commands.scenarios import PlacesAsked
    from foretwin.orchestrator.commands.scenarios import place_scenarios as place_them

    request = PlacesAsked(map_file, scenario or (), junction_id, at, service_roads)
    return place_them(request)


MapOption = Annotated[Path, typer.Option("--map", help="map: .osm, .osm.gz, .osm.bz2 or .osm.pbf")]
IdOption = Annotated[str | None, typer.Option("--id", help="the junction's id")]
AtOption = Annotated[str | None, typer.Option("--at", help="LAT,LON: the junction nearest to it")]
CaseOption = Annotated[int, typer.Option("--case", help="which of its cases, from 1")]
VehicleOption = Annotated[
    Path | None, typer.Option("--vehicle", help="vehicle parameters, TOML [default: bmw_320i]")
]
ScenarioArgument = Annotated[str, typer.Argument(metavar="SCENARIO", help="id or TOML file")]


@scenarios.command("export")
@told
def export_scenario(
    scenario: ScenarioArgument,
    map_file: MapOption,
    out: Annotated[Path, typer.Option("--out", help=".xosc file to write; .xodr goes beside it")],
    junction_id: IdOption = None,
    at: AtOption = None,
    case: CaseOption = 1,
    vehicle: VehicleOption = None,
    service_roads: ServiceRoadsOption = False,
) -> CommandResult:
    """Write one case at one junction as OpenSCENARIO 1.2, with its roads as OpenDRIVE.

    Example: foretwin scenarios export ccftap --map MAP.osm --out CASE.xosc
    """
    from foretwin.orchestrator.commands.scenario_export import CaseRequest
    from foretwin.orchestrator.commands.scenario_export import export_scenario as export
    from foretwin.orchestrator.commands.scenarios import PlacesAsked

    where = PlacesAsked(map_file, (scenario,), junction_id, at, service_roads)
    return export(CaseRequest(scenario, where, case, vehicle), out)


@scenarios.command("draw")
@told
def draw_scenario(
    scenario: ScenarioArgument,
    map_file: MapOption,
    out: Annotated[Path, typer.Option("--out", help=".png file to write")],
    junction_id: IdOption = None,
    at: AtOption = None,
    case: CaseOption = 1,
    planner: Annotated[str, typer.Option(help="who drives the ego")] = "pure_pursuit_idm",
    vehicle: VehicleOption = None,
    service_roads: ServiceRoadsOption = False,
) -> CommandResult:
    """Draw one case at one junction from above: as planned, and as a planner drives it.

    Example: foretwin scenarios draw ccftap --map MAP.osm --out CASE.png
    """
    from foretwin.orchestrator.commands.scenario_export import CaseRequest
    from foretwin.orchestrator.commands.scenario_export import draw_scenario as draw
    from foretwin.orchestrator.commands.scenarios import PlacesAsked

    where = PlacesAsked(map_file, (scenario,), junction_id, at, service_roads)
    return draw(CaseRequest(scenario, where, case, vehicle), out, planner=planner)
