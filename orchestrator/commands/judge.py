"""`foretwin judge`: a recorded drive again, with map, vehicle or Worlds corrected: what changes?"""

from __future__ import annotations

import contextlib
import json
from pathlib import Path
from typing import Any

import msgspec

from foretwin.contracts.codec import SchemaMismatch, read_message
from foretwin.contracts.errors import UserError, one_line
from foretwin.contracts.segments import DRIVE_FILE, first_left
from foretwin.contracts.terminal import say
from foretwin.contracts.versions import versions
from foretwin.contracts.world import World
from foretwin.orchestrator.agreement.difference import difference_lines, difference_of, read_judged
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.config import DriveConfig
from foretwin.orchestrator.drive.drive import EndedDrive, drive
from foretwin.orchestrator.drive.plan import read_inputs
from foretwin.orchestrator.embedded import ROUTE_FILE
from foretwin.orchestrator.processors import most_workers
from foretwin.orchestrator.record.recovery import RECOVERED
from foretwin.orchestrator.record.run_state import RECORD, check_finished
from foretwin.orchestrator.worlds.given_worlds import read_given_worlds

JUDGED = "judged"


def judge(
    run: Path,
    *,
    map_file: Path | None = None,
    vehicle: str | None = None,
    worlds: Path | None = None,
    out: Path | None = None,
) -> CommandResult:
    """Drive a run's recorded drive again in lock step: what changes? Its code is 0, or that of the
    drive that did not come to its end.

    What it is compared with is the run itself where that was in lock step and of this version;
    else the drive is first driven again as it was, so that nothing but the correction differs.
    """
    record = _record(run)
    again = _again(run, record, out=out or run / JUDGED)
    if map_file is None and vehicle is None and worlds is None:
        raise UserError(
            f"judge {run}: name what is corrected, by --map FILE, --vehicle FILE or --worlds FOLDER"
        )
    corrected = msgspec.structs.replace(
        again,
        map=again.map if map_file is None else str(map_file),
        vehicle=vehicle or again.vehicle,
        worlds=again.worlds if worlds is None else str(worlds),
    )
    if worlds is not None:
        _check_on_way(worlds, run, record)
    read_inputs(corrected)  # what is wrong with them is told before anything long begins
    before = run
    if not _stands_for_itself(record):
        _say(f"{run}: driven again as it was, in lock step, to compare with")
        driven = drive(again)
        if driven.code:
            return _ended_early(driven)
        before = driven.folder
    _say("driven again with what is corrected")
    driven = drive(corrected)
    if driven.code:
        return _ended_early(driven)
    found = difference_of(read_judged(before), read_judged(driven.folder))
    return CommandResult(found, "\n".join(difference_lines(found)))


def _stands_for_itself(record: dict[str, Any]) -> bool:
    """Whether a run need not be driven again to be compared with: in lock step, of this version,
    and to an end of its own."""
    in_lock_step = record["config"].get("speed") is None
    ended = record.get("exit") != RECOVERED
    return in_lock_step and ended and record.get("versions") == versions()


def _ended_early(driven: EndedDrive) -> CommandResult:
    return CommandResult({"run": driven.folder, "exit_code": driven.code}, code=driven.code)


def _record(run: Path) -> dict[str, Any]:
    check_finished(run)
    for part in (run / RECORD, first_left(run / DRIVE_FILE)):
        if not part.is_file():
            raise FileNotFoundError(f"run {run}: no {part.name} in it")
    try:
        record: dict[str, Any] = json.loads((run / RECORD).read_text(encoding="utf-8"))
    except ValueError as error:
        raise UserError(f"{run / RECORD}: not JSON: {error}") from error
    if not isinstance(record, dict):
        raise UserError(f"{run / RECORD}: not the record of a run: must be a JSON object")
    if "config" not in record:
        exit_word = record.get("exit", "not told")
        raise UserError(f"{run / RECORD}: the drive never came to its end (exit: {exit_word})")
    return record


def _again(run: Path, record: dict[str, Any], *, out: Path) -> DriveConfig:
    """Return the configuration of a run, for its recorded drive in lock step."""
    try:
        was = msgspec.convert(record["config"], DriveConfig)
        map_file = record["map"]["file"]
    except (msgspec.ValidationError, KeyError, TypeError) as error:
        raise UserError(
            f"{run / RECORD}: of another version of foretwin: {one_line(error)}"
        ) from error
    route = was.route or (str(ROUTE_FILE) if was.map is None else None)
    if was.route == "live":
        _say(f"{run}: what it said of its route is not recorded; the way ahead is predicted")
        route = None
    kept = tuple(one for one in was.vehicles if not one.live)
    if len(kept) < len(was.vehicles):
        gone = ", ".join(one.id for one in was.vehicles if one.live)
        _say(f"{run}: without {gone}: what live vehicles beside the car sent is not recorded")
    inputs = {
        "log": str(first_left(run / DRIVE_FILE)),
        "source": "log",
        "map": map_file,
        "route": route,
    }
    alone = {"speed": None, "view": "none", "out": str(out), "vehicles": kept, "metrics": None}
    workers = {"workers": min(was.workers, most_workers())}  # it may come from a larger machine
    no_bus = {"endpoint": None, "insecure": False, "secure": None}
    no_car = no_bus | {"ros2": None, "towards_vehicle": False}
    return msgspec.structs.replace(was, **inputs, **alone, **workers, **no_car).validate()


def _check_on_way(folder: Path, run: Path, record: dict[str, Any]) -> None:
    """Raise UserError for a World that the run never asked for: nothing would change by it."""
    reached = record.get("intersections") or ()
    asked = {str(one["id"]) for one in reached if isinstance(one, dict) and "id" in one}
    for file in run.glob("worlds/*.world"):
        with contextlib.suppress(SchemaMismatch):
            asked.add(read_message(file, World).intersection.id)
    for name in read_given_worlds(folder):
        if name not in asked:
            known = ", ".join(sorted(asked)) or "none"
            raise UserError(
                f"worlds {folder}: that of junction {name} does not belong to the way of {run}: "
                f"its junctions are {known}"
            )


def _say(text: str) -> None:
    say(text, error=True)
