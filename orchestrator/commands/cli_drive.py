"""The command line of a drive. The work is imported when run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foretwin.orchestrator.commands.cli_options import (
    AnchorOption,
    DemOption,
    EndpointOption,
    InsecureOption,
    KeepOption,
    LeastFuturesOption,
    MapAidingOption,
    MetricsOption,
    ProgressTableOption,
    SecureOption,
    SiblingsOption,
    TracksOption,
    TuningOption,
    VehicleFileOption,
    VirtualTrafficOption,
)
from foretwin.orchestrator.commands.cli_view import LayoutOption
from foretwin.orchestrator.commands.told import CommandResult, told


@told
def drive(
    config: Annotated[Path | None, typer.Option(help="TOML file with these settings")] = None,
    map_file: Annotated[
        str | None, typer.Option("--map", help="map of the place [default: a drawn town]")
    ] = None,
    dem: DemOption = None,
    tracks: TracksOption = None,
    route: Annotated[
        str | None, typer.Option(help="GPX or GeoJSON file, from-log, or live [default: predicted]")
    ] = None,
    log: Annotated[
        str | None, typer.Option(help="recorded drive to replay [default: a stand-in car drives]")
    ] = None,
    source: Annotated[
        str | None,
        typer.Option(help="log, standin, live (a car on the bus), or auto [default: auto]"),
    ] = None,
    start_s: Annotated[
        float | None, typer.Option("--start", help="seconds into the log [default: 0]")
    ] = None,
    end_s: Annotated[
        float | None, typer.Option("--end", help="seconds into the log [default: its end]")
    ] = None,
    speed: Annotated[
        str | None, typer.Option(help="replay speed, or max for lock step [default: 1]")
    ] = None,
    workers: Annotated[int | None, typer.Option(help="worker processes [default: 2]")] = None,
    futures: Annotated[int | None, typer.Option(help="futures per round [default: 64]")] = None,
    least_futures: LeastFuturesOption = None,
    rate_hz: Annotated[
        float | None, typer.Option("--rate", help="rounds per wall second [default: 2]")
    ] = None,
    horizon_s: Annotated[
        float | None, typer.Option("--horizon", help="seconds ahead [default: 8]")
    ] = None,
    planner: Annotated[
        str | None, typer.Option(help="planner under test [default: pure_pursuit_idm]")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="seed of the futures [default: 0]")] = None,
    vehicle: VehicleFileOption = None,
    tuning: TuningOption = None,
    progress_table: ProgressTableOption = None,
    map_aiding: MapAidingOption = None,
    virtual_traffic: VirtualTrafficOption = None,
    siblings: SiblingsOption = None,
    view: Annotated[
        str | None, typer.Option(help="auto, native, web, copilot or none [default: auto]")
    ] = None,
    layout: LayoutOption = None,
    out: Annotated[str | None, typer.Option(help="folder of the runs [default: runs]")] = None,
    keep: KeepOption = None,
    metrics: MetricsOption = None,
    endpoint: EndpointOption = None,
    insecure: InsecureOption = False,
    trace: Annotated[
        bool, typer.Option("--trace", help="what each process does when, as RUN/trace.json")
    ] = False,
    secure: SecureOption = None,
    ros2: Annotated[
        str | None, typer.Option(help="mapping of the live car's ROS 2 topics, TOML, or autoware")
    ] = None,
    anchor: AnchorOption = None,
    towards_vehicle: Annotated[
        bool,
        typer.Option(
            "--towards-vehicle", help="second switch for what goes to the car; see docs/ros2.md"
        ),
    ] = False,
) -> CommandResult:
    """Drive ahead of a car: worlds for the coming junctions, futures, live comparison.

    Example: foretwin drive --map MAP.osm --log DRIVE.mcap --route from-log
    """
    settings = locals()  # named as the fields of DriveConfig, but for two
    settings["map"] = settings.pop("map_file")
    settings["dem"] = None if dem is None else str(dem)
    switches = {"towards_vehicle": towards_vehicle, "trace": trace, "insecure": insecure}
    settings |= {name: given or None for name, given in switches.items()}
    from foretwin.orchestrator.commands.drive import drive as run_drive
    from foretwin.orchestrator.config_file import load_config

    return run_drive(load_config(settings.pop("config"), settings))
