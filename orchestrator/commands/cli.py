"""The command line: what every command takes. The work is in the modules they import when run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foretwin.contracts.errors import UserError
from foretwin.contracts.exit_codes import DONE, INTERRUPTED, USER
from foretwin.contracts.terminal import say
from foretwin.orchestrator.commands.cli_config import config as config_files
from foretwin.orchestrator.commands.cli_drive import drive
from foretwin.orchestrator.commands.cli_help import SETTINGS, CommandGroup, VersionOption
from foretwin.orchestrator.commands.cli_join import join
from foretwin.orchestrator.commands.cli_logs import ABOUT_LOGS
from foretwin.orchestrator.commands.cli_maps import maps
from foretwin.orchestrator.commands.cli_options import (
    DemOption,
    DialectOption,
    MapArgument,
    ServiceRoadsOption,
    TracksOption,
)
from foretwin.orchestrator.commands.cli_progress import learn_progress
from foretwin.orchestrator.commands.cli_scenarios import scenarios
from foretwin.orchestrator.commands.cli_secure import doctor
from foretwin.orchestrator.commands.cli_secure import secure as secure_commands
from foretwin.orchestrator.commands.cli_set import set_value
from foretwin.orchestrator.commands.cli_standin import anchor as anchor_poses
from foretwin.orchestrator.commands.cli_standin import lights, standin
from foretwin.orchestrator.commands.cli_sweep import sweep
from foretwin.orchestrator.commands.cli_tracks import tracks as tracks_commands
from foretwin.orchestrator.commands.cli_view import view as view_run
from foretwin.orchestrator.commands.cli_watch import watch
from foretwin.orchestrator.commands.cli_worker import worker
from foretwin.orchestrator.commands.error_lines import (
    NO_PLACE,
    drop_output,
    flush_output,
    one_line,
    report,
    usage_line,
)
from foretwin.orchestrator.commands.told import CommandResult, told
from foretwin.world_gen.export.formats import DEFAULT_FORMAT, FORMATS

EXIT_USER, EXIT_INTERRUPTED = USER, INTERRUPTED
_NO_FOLDER = IsADirectoryError, NotADirectoryError
PATH_ERRORS = (FileNotFoundError, FileExistsError, *_NO_FOLDER, PermissionError)
"""What is wrong with a path is the user's to mend."""

app = CommandGroup(
    name="foretwin",
    no_args_is_help=True,
    rich_markup_mode=None,  # Else [default: 2] is taken for markup, and not shown.
    context_settings=SETTINGS,
    pretty_exceptions_enable=False,
)

app.add_typer(maps)

app.add_typer(scenarios)
app.add_typer(tracks_commands, name="tracks")


@app.callback()
def begin(version: VersionOption = False) -> None:
    """Drive ahead of a real car, in a low-fidelity digital twin.

    Example: foretwin COMMAND --help
    """


app.command()(drive)


@app.command()
@told
def intersections(
    map_file: MapArgument,
    route: Annotated[
        Path | None, typer.Option(help="only those along this GPX or GeoJSON line")
    ] = None,
    service_roads: ServiceRoadsOption = False,
) -> CommandResult:
    """List the junctions of a map, each one as a driver sees it.

    Example: foretwin intersections MAP.osm --route ROUTE.gpx --json
    """
    from foretwin.orchestrator.commands.intersections import list_intersections

    return list_intersections(map_file, route=route, service_roads=service_roads)


@app.command()
@told
def world(
    map_file: MapArgument,
    out: Annotated[
        Path, typer.Option("--out", help="file to write; a folder with --route and --all")
    ],
    at: Annotated[str | None, typer.Option(help="LAT,LON: the junction nearest to it")] = None,
    junction_id: Annotated[str | None, typer.Option("--id", help="the junction's id")] = None,
    bbox: Annotated[
        str | None, typer.Option(help="W,S,E,N in degrees: one World of the whole region")
    ] = None,
    route: Annotated[
        Path | None, typer.Option(help="each junction along this GPX or GeoJSON line")
    ] = None,
    everything: Annotated[bool, typer.Option("--all", help="each junction of the map")] = False,
    service_roads: ServiceRoadsOption = False,
    dem: DemOption = None,
    tracks: TracksOption = None,
    file_format: Annotated[
        str | None,
        typer.Option(
            "--format",
            help=f"{', '.join(FORMATS)} "
            f"[default: as the suffix of --out says; {DEFAULT_FORMAT} for .xml and in a folder]",
        ),
    ] = None,
    radius_m: Annotated[
        float | None, typer.Option("--radius", help="metres around a junction [default: 150]")
    ] = None,
    opendrive_version: Annotated[
        str | None, typer.Option(help="opendrive: 1.8, or 1.4 for CARLA [default: 1.8]")
    ] = None,
    lanelet2_dialect: DialectOption = None,
    simulator: Annotated[
        str | None,
        typer.Option(
            help="sdf: classic (Gazebo Classic with ROS 2) or gazebo (gz-sim) [default: classic]"
        ),
    ] = None,
    vehicles: Annotated[
        str | None,
        typer.Option(
            help="sdf: NAME:KIND,… (twin, shadow, ghost), or none "
            "[default: twin:twin,shadow:shadow,ghost:ghost]"
        ),
    ] = None,
    vehicle: Annotated[
        Path | None, typer.Option(help="sdf: vehicle parameters, TOML [default: bmw_320i]")
    ] = None,
    report: Annotated[
        bool, typer.Option("--report", help="also say what was tagged and what was guessed")
    ] = False,
) -> CommandResult:
    """Write Worlds of a map: models, road networks for other simulators, or pictures.

    Example: foretwin world MAP.osm --at 52.511,13.390 --out junction.png
    """
    asked = locals()  # named as the fields of WorldRequest
    from foretwin.orchestrator.commands.world import WorldRequest, write_worlds

    return write_worlds(WorldRequest(**asked))


for command in (sweep, *ABOUT_LOGS, view_run, watch, learn_progress, doctor, worker, standin, join):
    app.command()(command)

app.command("config")(config_files)
app.command("anchor")(anchor_poses)
app.command()(lights)
app.command("set")(set_value)
app.add_typer(secure_commands, name="secure")


def run(arguments: list[str]) -> int:
    """Run one command; returns 0 done, 1 internal error, 2 the user's input, 130 Ctrl-C."""
    try:
        result = app(arguments, prog_name="foretwin", standalone_mode=False)
        flush_output()
    except (UserError, *PATH_ERRORS) as error:
        say(f"foretwin: {one_line(error)}", error=True)
        return EXIT_USER
    except OSError as error:
        if error.errno not in NO_PLACE:
            return report(error)
        say(f"foretwin: {one_line(error)}", error=True)
        drop_output()
        return EXIT_USER
    except (KeyboardInterrupt, typer.Abort):
        result = EXIT_INTERRUPTED
    except SystemExit as left:  # of typer, where nobody reads the help to its end
        if not isinstance(left.__context__, BrokenPipeError):
            raise
        drop_output()
        return DONE
    except Exception as error:
        if hasattr(error, "format_message") and hasattr(error, "exit_code"):  # of typer's own
            if line := usage_line(error, arguments):
                say(line, error=True)
            return int(error.exit_code)
        return report(error)
    if result == EXIT_INTERRUPTED:  # as typer, too, answers Ctrl-C
        say("foretwin: interrupted", error=True)
    return result if isinstance(result, int) else 0
