"""The command `sweep`: places scenarios, plays what is not yet played, and sums up."""

from __future__ import annotations

import functools
import shutil
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import msgspec

from foretwin.contracts.errors import UserError
from foretwin.contracts.new_folder import named_in_errors, trouble_with_folder
from foretwin.contracts.runner import Runner, answers, place_task
from foretwin.contracts.terminal import say
from foretwin.orchestrator.commands.progress_bar import progress_bar
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.record.ledger import jobs_ledger
from foretwin.orchestrator.record.run_folder import SUMMARY, keep_vehicles
from foretwin.orchestrator.runner.worker_processes import NoWorkerError
from foretwin.orchestrator.sweep.engines import LOCAL, Engine, workers_for
from foretwin.orchestrator.sweep.folder import (
    FoundPlaces,
    SweepFolder,
    fingerprint_of,
    planner_origins,
)
from foretwin.orchestrator.sweep.jobs import JobMaker, place_request
from foretwin.orchestrator.sweep.merge import merge
from foretwin.orchestrator.sweep.places import PlacedWorlds, are_kept, keep_places
from foretwin.orchestrator.sweep.plan import SweepPlan
from foretwin.orchestrator.sweep.play import jobs_left, play
from foretwin.orchestrator.sweep.rows import Parts
from foretwin.orchestrator.sweep.shard import WHOLE, Shard
from foretwin.orchestrator.sweep.spec import Loaded, load_spec
from foretwin.orchestrator.sweep.summary import print_summary, summed
from foretwin.orchestrator.sweep.worlds import Building, all_there, choose_worlds, source_digest
from foretwin.sim_worker.road_users.likeness import likenesses

SOME_FAILED = 3


def sweep(
    spec: Path,
    *,
    out: Path | None,
    engine: Engine = LOCAL,
    fresh: bool = False,
    shard: str | None = None,
) -> CommandResult:
    """Run a sweep or one `shard` of it, or go on with it; its code is 0, or 3 where futures failed,
    where none was played, or where no worker can be started.

    Raises UserError and FileNotFoundError, in one line, for a request that cannot be met.
    """
    engine.check()
    part = WHOLE if shard is None else Shard.named(shard)
    loaded = load_spec(spec)
    of_shard = "" if part == WHOLE else f"-{part.number}-of-{part.of}"
    out = out or Path("sweeps") / f"{spec.stem}{of_shard}"
    if not out.is_file() and (trouble := trouble_with_folder(out)) is not None:
        raise UserError(f"--out {out}: {trouble}")
    new = not out.exists()
    try:
        with named_in_errors(f"--out {out}"), workers_for(loaded, out, engine) as runner:
            summary = run_sweep(loaded, out, runner, fresh=fresh, shard=part)
    except OSError:
        if new and not (out / SUMMARY).is_file():  # else it goes on from there
            shutil.rmtree(out, ignore_errors=True)
        raise
    except NoWorkerError as error:
        say(f"foretwin: {error}; what is done is kept", error=True)
        return CommandResult({"failed": str(error)}, code=SOME_FAILED)
    return _told(out, summary)


def merge_shards(folders: Sequence[Path], *, out: Path | None) -> CommandResult:
    """Put the shards of a sweep together; returns what one sweep would have returned.

    Raises UserError, in one line, where they do not come to one sweep.
    """
    if out is None or not folders:
        raise UserError("--merge takes the folders of all shards, and --out FOLDER for the whole")
    with named_in_errors(f"--out {out}"):
        return _told(out, merge(folders, out))


def _told(out: Path, summary: dict[str, Any]) -> CommandResult:
    nothing = not summary["placed"] and (summary["jobs"] or "shard" not in summary)
    code = SOME_FAILED if summary["failed"] or summary["failures"] or nothing else 0
    return CommandResult(summary, lambda: print_summary(out, summary), code)


def run_sweep(
    loaded: Loaded, out: Path, runner: Runner, *, fresh: bool = False, shard: Shard = WHOLE
) -> dict[str, Any]:
    """Play what is not yet played of a sweep or one of its shards, and return its summary as
    `sweep.json` has it."""
    fingerprint = fingerprint_of(loaded, source_digest(loaded.spec))
    chosen = functools.cache(lambda: choose_worlds(loaded.spec))
    sweep_folder = SweepFolder(out, fingerprint, fresh=fresh, shard=shard)
    if sweep_folder.is_new() or fresh:
        chosen()  # what is wrong with them is told before anything is written
    with sweep_folder as folder:
        folder.begin(loaded)
        found = _find_places(loaded, folder, runner, chosen)
        worlds = PlacedWorlds(folder.places_dir, found.worlds)
        plan = SweepPlan(loaded, worlds)
        keep_vehicles(folder.path, loaded.vehicles.values())
        with Parts(folder.path, jobs=plan.jobs, attribution=plan.attribution) as parts:
            maker = JobMaker(loaded)
            left = jobs_left(plan, maker, parts, shard)
            started_s, before = time.monotonic(), jobs_ledger(runner.count)
            play(plan, left, maker, parts, runner, progress_bar)
            playing_s = round(time.monotonic() - started_s, 3)
            ledger = {"jobs": jobs_ledger(runner.count).since(before)}
            now = {"jobs_played": sum(left), "playing_s": playing_s, "ledger": ledger}
            return folder.summarise(_summary(loaded, plan, worlds, found, parts, shard) | now)


def _find_places(
    loaded: Loaded, folder: SweepFolder, runner: Runner, chosen: Callable[[], Building]
) -> FoundPlaces:
    """Build or read the Worlds, and find where the scenarios take place in each.

    What was found before is kept; what failed before is tried again, and Worlds that are lost are
    built or read again.
    """
    kept, at = folder.found(), folder.places_dir
    if (
        kept is not None
        and not kept.failures
        and all_there(folder.worlds_dir, kept.worlds)
        and all(are_kept(at, world_id) for world_id in kept.worlds)
    ):
        return kept
    worlds = chosen()(folder.worlds_dir, runner, progress_bar)
    failures = dict(worlds.failures)
    left = [world_id for world_id in worlds.ids if not are_kept(at, world_id)]
    tasks = [place_task(place_request(loaded, world_id)) for world_id in left]
    with progress_bar(len(tasks), "Worlds placed on") as (advance, say):
        for answer in answers(runner, tasks):
            world_id = answer.task.world_id
            if answer.message is None:
                failures[world_id] = answer.failure
                say(f"failed: world {world_id}: {answer.failure}")
            else:
                keep_places(at, answer.message)
            advance(world_id)
    return folder.save_found(tuple(one for one in worlds.ids if are_kept(at, one)), failures)


def _summary(
    loaded: Loaded,
    plan: SweepPlan,
    worlds: PlacedWorlds,
    found: FoundPlaces,
    parts: Parts,
    shard: Shard,
) -> dict[str, Any]:
    unplaced = [one for world in worlds for one in world.unplaced]
    placed = {one.scenario_id for world in worlds for one in world.placed}
    return {
        "complete": True,
        "spec": loaded.spec,
        "planners": planner_origins(loaded),
        "worlds": len(found.worlds),
        "places_sha256": worlds.sha256,
        "jobs": len(shard.numbers(plan.jobs)),
        "jobs_of_all": plan.jobs,
        **summed(loaded.spec, parts.entries()),
        "road_users": [msgspec.to_builtins(row) for row in likenesses()],
        "unplaced": [one for one in unplaced if one.applies],
        "placed_nowhere": sorted({one.id for one in loaded.scenarios} - placed),
        "does_not_apply": sum(not one.applies for one in unplaced),
        "failures": found.failures,
        "attribution": plan.attribution,
    }
