"""The command line of recorded drives: what each command takes. The work is imported when run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.commands.cli_across import ACROSS_RUNS, compare
from foretwin.orchestrator.commands.cli_options import (
    DeclarationOption,
    FirstDeclarationOption,
    OtherDeclarationOption,
    VehicleFileOption,
)
from foretwin.orchestrator.commands.told import CommandResult, told


@told
def convert(
    source: Annotated[Path, typer.Argument(metavar="SOURCE", help="recorded drive")],
    target: Annotated[
        Path,
        typer.Argument(
            metavar="TARGET", help=".mcap, .bag (ROS 1), .csv, or a folder for a ROS 2 bag"
        ),
    ],
    to: Annotated[
        str | None,
        typer.Option("--to", help="mcap, ros2, ros1, csv [default: as TARGET is called]"),
    ] = None,
    declaration: Annotated[
        Path | None,
        typer.Option(
            "--declaration",
            help="TOML that declares SOURCE [default: SOURCE.toml, where it is there]",
        ),
    ] = None,
) -> CommandResult:
    """Convert a recorded drive to MCAP, a ROS bag, or CSV.

    Example: foretwin convert DRIVE.csv DRIVE.mcap
    """
    from foretwin.orchestrator.commands.recordings import convert_log

    return convert_log(source, target, to=to, declaration=declaration)


@told
def declare(
    table: Annotated[Path, typer.Argument(metavar="FILE", help="CSV, TSV or Parquet of a drive")],
    out: Annotated[
        Path | None, typer.Option(help="the declaration [default: FILE.toml, where it is found]")
    ] = None,
    answer: Annotated[
        list[str] | None,
        typer.Option(
            help="KEY=VALUE of time, time_unit, latitude, position_unit, x, epsg, origin or "
            "reference_point"
        ),
    ] = None,
) -> CommandResult:
    """Find out what a table's columns are, prove it, and write the declaration it is read by.

    Example: foretwin declare DRIVE.csv --answer time=millis
    """
    from foretwin.orchestrator.commands.declare import declare as declare_table

    return declare_table(table, out=out, answers=tuple(answer or ()))


@told
def merge(
    first: Annotated[
        Path, typer.Argument(metavar="LOG_A", help="recorded drive, whose clock holds")
    ],
    second: Annotated[
        Path, typer.Argument(metavar="LOG_B", help="another recording of the same drive")
    ],
    target: Annotated[
        Path, typer.Argument(metavar="OUT", help=".mcap, .bag (ROS 1), .csv, or a folder")
    ],
    declaration: FirstDeclarationOption = None,
    other_declaration: OtherDeclarationOption = None,
) -> CommandResult:
    """Put two recordings of one drive on one clock, by how the car moved, and write them as one.

    Example: foretwin merge CAN.csv GNSS.gpx BOTH.mcap
    """
    asked = locals()
    from foretwin.orchestrator.commands.recordings import merge_logs

    return merge_logs(**asked)


@told
def identify(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="recorded drive")],
    vehicle: Annotated[
        str | None, typer.Option(help="parameters in force, TOML [default: the bundled BMW 320i]")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="folder for plots and a vehicle file with what was taken")
    ] = None,
    declaration: DeclarationOption = None,
) -> CommandResult:
    """Say what a recorded drive tells of its vehicle: steering, delays, gains, resistances.

    Example: foretwin identify DRIVE.mcap --out found
    """
    from foretwin.orchestrator.commands.identify import identify_log

    return identify_log(log, vehicle_file=vehicle, out=out, declaration=declaration)


@told
def judge(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="folder of a run")],
    map_file: Annotated[
        Path | None, typer.Option("--map", help="corrected map [default: the run's own]")
    ] = None,
    vehicle: Annotated[
        str | None, typer.Option(help="corrected vehicle parameters [default: the run's own]")
    ] = None,
    worlds: Annotated[
        Path | None, typer.Option(help="folder of corrected Worlds (.world), not built anew")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="folder for the runs it makes [default: RUN/judged]")
    ] = None,
) -> CommandResult:
    """Judge a run's recorded drive again with a corrected map, vehicle or Worlds: what changes?

    Example: foretwin judge runs/NAME --map FIXED.osm
    """
    asked = locals()
    from foretwin.orchestrator.commands.judge import judge as judge_run

    return judge_run(**asked)


@told
def report(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN...", help="folders of runs or sweeps")],
    out: Annotated[Path, typer.Option("--out", help="the HTML file to write")],
    redact: Annotated[
        str | None,
        typer.Option(help="coarse: no names, no positions; places: no pictures of them either"),
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option(help="another drive of this road: how far people differ, beside the gap"),
    ] = None,
) -> CommandResult:
    """Write what a run or sweep foresaw, and what came, as one HTML file that opens anywhere.

    Example: foretwin report runs/NAME --out REPORT.html
    """
    from foretwin.orchestrator.commands.report import report as write

    return write(runs, out=out, redact=redact, against=against)


@told
def repeat(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="folder of a run or sweep")],
    future: Annotated[
        str, typer.Argument(metavar="FUTURE", help="future_id of the table of futures")
    ],
    view: Annotated[bool, typer.Option("--view", help="also draw it, into RUN/repeated")] = False,
    physics: Annotated[
        str | None, typer.Option(help="on another engine (multibody, gazebo): how far apart?")
    ] = None,
) -> CommandResult:
    """Play a recorded future again, bit for bit: exit code 3 where it comes to something else.

    Example: foretwin repeat runs/NAME FUTURE --view
    """
    from foretwin.orchestrator.commands.repeat import elsewhere
    from foretwin.orchestrator.commands.repeat import repeat as repeat_future

    if physics is not None:
        if view:
            raise UserError(
                f"--view: draws what was recorded, and goes not with --physics {physics}"
            )
        return elsewhere(folder, future, physics)
    return repeat_future(folder, future, view=view)


@told
def recover(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="folder of a run")],
) -> CommandResult:
    """Make readable what a run left that was killed: exit code 3 where something of it is lost.

    Example: foretwin recover runs/NAME
    """
    from foretwin.orchestrator.commands.recover import recover_run

    return recover_run(run)


@told
def gap(
    recording: Annotated[Path, typer.Argument(metavar="LOG", help="recorded drive")],
    vehicle: VehicleFileOption = None,
    out: Annotated[Path | None, typer.Option(help="folder for plots")] = None,
    declaration: DeclarationOption = None,
    against: Annotated[
        Path | None, typer.Option(help="another drive of this road: how far people differ on it")
    ] = None,
) -> CommandResult:
    """Measure how far the model leaves a recorded drive, and say which of the two is wrong.

    Example: foretwin gap DRIVE.mcap --vehicle CAR.toml --out plots
    """
    asked = locals()
    from foretwin.orchestrator.commands.gap import report_gap

    return report_gap(**asked)


@told
def collect(
    runs: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[RUNS]...", help="folders of runs or sweeps, or of several"),
    ] = None,
    into: Annotated[
        str, typer.Option(help="the lake: a folder, s3://BUCKET/PREFIX or gs://BUCKET/PREFIX")
    ] = "lake",
    replace: Annotated[
        bool, typer.Option("--replace", help="a run that has changed since replaces what it was")
    ] = False,
    verify: Annotated[
        bool, typer.Option("--verify", help="also hold every file of the lake against its hash")
    ] = False,
) -> CommandResult:
    """Collect the tables of many runs and sweeps into one lake of partitioned Parquet.

    Example: foretwin collect runs sweeps --into lake
    """
    from foretwin.orchestrator.commands.collect import collect_runs

    return collect_runs(tuple(runs or ()), into=into, replace=replace, verify=verify)


ABOUT_LOGS = (
    declare,
    convert,
    merge,
    identify,
    gap,
    compare,
    judge,
    recover,
    repeat,
    report,
    *ACROSS_RUNS,
    collect,
)
"""In the order in which help lists them."""
