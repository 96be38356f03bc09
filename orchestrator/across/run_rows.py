"""One row for each run and sweep, told from its folder whatever state that is in."""

from __future__ import annotations

import datetime
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from foretwin.contracts.errors import one_line
from foretwin.contracts.terminal import command_line
from foretwin.orchestrator.record.run_folder import SUMMARY
from foretwin.orchestrator.record.run_state import LOG, RECORD, RESULTS, RUNNING, is_locked
from foretwin.orchestrator.record.whereabouts import driven_s
from foretwin.orchestrator.sweep.lock import LOCK

DRIVE, SWEEP = "drive", "sweep"
KILLED, DAMAGED, STOPPED, COMPLETED = "killed", "damaged", "stopped", "completed"
_STARTED = re.compile(r"(\d{4})(\d\d)(\d\d)-(\d\d)(\d\d)(\d\d)-")


class RunRow(msgspec.Struct, frozen=True, kw_only=True):
    """A run or sweep: the view `runs`, and what `foretwin runs` lists. None: not told."""

    run: str
    """Its id; of a sweep `sweep-` and the begin of its fingerprint."""
    kind: str
    """drive or sweep"""
    time: str | None = None
    """When: a drive's begin, by its id and the clock of its computer; when a sweep last said how
    far it is, of one in a lake the day."""
    state: str
    """completed, interrupted, failed, vehicle_ended, recovered, running, killed, stopped (a sweep
    that can go on), damaged"""
    what: str = ""
    """What was driven, or which scenarios were swept."""
    map: str | None = None
    """Name of the map's file."""
    map_sha256: str | None = None
    """None of a sweep of given Worlds."""
    planner: str | None = None
    """Several of a sweep: with commas."""
    vehicle: str | None = None
    """Parameters; of a drive none where they are the bundled ones."""
    vehicle_id: str | None = None
    seed: int | None = None
    drive_time_s: float | None = None
    """When it ended, from where the log begins."""
    driven_s: float | None = None
    """How long it went: without what `--start` left out."""
    wall_s: float | None = None
    """How long it took; of a sweep, of its last start."""
    junctions: int | None = None
    """That the drive reached, or the sweep has Worlds of."""
    futures: int | None = None
    """That were played, of a sweep rows."""
    collided: int | None = None
    """Of a sweep's rows; of drives the view `futures` tells."""
    rounds: int | None = None
    rounds_late: int | None = None
    rounds_missed: int | None = None
    verdict: str | None = None
    """Of a drive, who departs and why; of a sweep how many collided or failed."""
    troubles: int | None = None
    """What the record says is lost or missing."""
    remark: str = ""
    """What is wrong with the folder."""
    foretwin: str | None = None
    """Its version."""
    folder: str
    record: str = ""
    """run.json or sweep.json, as JSON."""


def row_of_folder(folder: Path) -> RunRow:
    """Return the row of a run's or sweep's folder; never raises for what is damaged there."""
    swept = (folder / SUMMARY).exists()
    file = folder / (SUMMARY if swept else RECORD)
    try:
        data = file.read_bytes()
        record = msgspec.json.decode(data)
        if not isinstance(record, dict):
            raise ValueError("is no record")
    except (OSError, ValueError) as error:
        return _damaged(folder, SWEEP if swept else DRIVE, f"{file.name}: {one_line(error)}")
    try:
        if swept:
            from foretwin.orchestrator.lake.sources import map_of_sweep  # not wanted without sweeps

            row = sweep_row(record, folder=str(folder), record_text=data.decode())
            sha256 = map_of_sweep(folder, record) or None
            state = COMPLETED if record.get("complete") else STOPPED
            state = RUNNING if is_locked(folder / LOCK) else state
            told = datetime.datetime.fromtimestamp(file.stat().st_mtime)
            when = f"{told:%Y-%m-%d %H:%M:%S}"
            return msgspec.structs.replace(row, state=state, time=when, map_sha256=sha256)
        row = drive_row(record, folder=str(folder), record_text=data.decode().rstrip())
        if row.state == RUNNING or any((folder / RESULTS).glob("*.arrows")):
            running = is_locked(folder / LOG)
            again = command_line("recover", folder)
            how = "" if running else f"{again} makes its results readable"
            state = RUNNING if running else KILLED
            return msgspec.structs.replace(row, state=state, remark=how)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        why = f"{file.name} is of no foretwin known here: {one_line(error)}"
        return _damaged(folder, SWEEP if swept else DRIVE, why)
    return row


def drive_row(record: Mapping[str, Any], *, folder: str, record_text: str) -> RunRow:
    """Return the row that a drive's record comes to; KeyError and the like where it is none."""
    config, futures = record.get("config") or {}, record.get("futures") or {}
    told_map, left_out = record.get("map") or {}, record.get("left_out") or {}
    run = str(record.get("run_id") or Path(folder).resolve().name)
    junctions = record.get("intersections")
    return RunRow(
        run=run,
        kind=DRIVE,
        time=_started(run),
        state=str(record["exit"]),
        what=_driven(config),
        map=_name(told_map.get("file")),
        map_sha256=told_map.get("sha256"),
        planner=config.get("planner"),
        vehicle=_name(config.get("vehicle")),
        vehicle_id=config.get("vehicle_id"),
        seed=record.get("seed"),
        drive_time_s=record.get("drive_time_s"),
        driven_s=driven_s(record),
        wall_s=record.get("wall_s"),
        junctions=None
        if junctions is None
        else len(junctions) + (left_out.get("intersections") or 0),
        futures=futures.get("count"),
        rounds=futures.get("rounds"),
        rounds_late=futures.get("late_rounds"),
        rounds_missed=futures.get("missed_rounds"),
        verdict=_verdict(record),
        troubles=None if (troubles := record.get("troubles")) is None else len(troubles),
        foretwin=_version(record),
        folder=folder,
        record=record_text,
    )


def sweep_row(record: Mapping[str, Any], *, folder: str, record_text: str) -> RunRow:
    """Return the row that a sweep's record comes to."""
    spec = record.get("spec") or {}
    run = f"sweep-{str(record['fingerprint'])[:16]}"
    if shard := record.get("shard"):
        run += f"-{shard.replace('/', 'of')}"
    failures = record.get("failures")
    collided, failed = record.get("collided"), record.get("failed")
    played = record.get("played", record.get("placed"))  # The latter of before that was counted.
    # What a start that went on took is not what the sweep took; of shards it is the sum.
    jobs = record.get("jobs")
    at_once = "shards" in record or record.get("jobs_played", jobs) == jobs
    return RunRow(
        run=run,
        kind=SWEEP,
        state=COMPLETED if record.get("complete") else STOPPED,
        what=", ".join(str(one) for one in spec.get("scenarios") or ("all scenarios",)),
        map=_name(spec.get("map") or spec.get("worlds") or (spec.get("recorded") or {}).get("run")),
        planner=", ".join(spec.get("planners") or ()) or None,
        vehicle=", ".join(_name(one) or "" for one in spec.get("vehicles") or ()) or None,
        seed=spec.get("seed"),
        wall_s=record.get("playing_s") if at_once else None,
        junctions=record.get("worlds"),
        futures=record.get("rows"),
        collided=collided,
        verdict=None if collided is None else f"{collided} of {played} collided, {failed} failed",
        troubles=None if failures is None else len(failures) + (failed or 0),
        foretwin=_version(record),
        folder=folder,
        record=record_text,
    )


def _damaged(folder: Path, kind: str, why: str) -> RunRow:
    name = folder.resolve().name
    return RunRow(
        run=name, kind=kind, time=_started(name), state=DAMAGED, remark=why, folder=str(folder)
    )


def _started(run: str) -> str | None:
    named = _STARTED.match(run)
    return None if named is None else "{}-{}-{} {}:{}:{}".format(*named.groups())


def _driven(config: Mapping[str, Any]) -> str:
    if config.get("log"):
        return f"log {_name(config['log'])}"
    return "live car" if config.get("source") == "live" else "stand-in car"


def _verdict(record: Mapping[str, Any]) -> str | None:
    tuning = record.get("tuning")
    if tuning is None:
        return None
    found = dict.fromkeys(f"{one['culprit']}: {one['cause']}" for one in tuning["verdicts"])
    return ", ".join(found) or "none"


def _version(record: Mapping[str, Any]) -> str | None:
    return (record.get("versions") or {}).get("foretwin")


def _name(path: str | None) -> str | None:
    return None if path is None else Path(path).name
