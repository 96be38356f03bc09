"""The record of a run: `run.json`, written at the start and, complete, at the end."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from foretwin.contracts.cpu_use import cpu_uses
from foretwin.contracts.sensor_turns import read_turns
from foretwin.contracts.tally import read_tally, tally_file
from foretwin.contracts.versions import versions
from foretwin.orchestrator.drive.conductor import Conductor
from foretwin.orchestrator.drive.summary import failed_line
from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.record.bookkeeping import percentile
from foretwin.orchestrator.record.durable import sync_folder, whole_file
from foretwin.orchestrator.record.kept_parts import kept_record
from foretwin.orchestrator.record.ledger import Ledger, jobs_ledger, lost_rounds_line
from foretwin.orchestrator.record.run_state import RUNNING
from foretwin.orchestrator.record.telemetry_ledger import lost_telemetry_line, telemetry_ledger

RESERVED_BYTES = 65536


def run_record(
    conductor: Conductor,
    restarted: int,
    *,
    exit_word: str,
    ended_by: Sequence[str] = (),
    wall_s: float,
    mono_s: float,
    troubles: Sequence[str] = (),
) -> dict[str, Any]:
    """Return everything that run.json says; `restarted` counts processes started again.

    `troubles` are what is missing since processes died, `ended_by` how each orchestrator of this
    drive before this one ended. While the drive goes on rounds are open: no ledger need balance.
    """
    plan, mission, futures = conductor.plan, conductor.mission, conductor.rounds.futures
    tally, dispatch = conductor.rounds.tally, conductor.rounds.dispatcher.dispatch
    ledger = Ledger(rounds=tally.ledger(), jobs=jobs_ledger(dispatch.count))
    unbalanced = () if exit_word == RUNNING else ledger.unbalanced()
    junctions = mission.visits.records(mono_s=mono_s)
    # Without a word of the mirror, whether commands were recorded decides.
    independent = conductor.mirror.independent
    if independent is None:
        independent = plan.commands_recorded
    return {
        **_known_at_start(plan, exit_word),
        "intersections": junctions,
        "changes": conductor.changes.record(conductor.intake.start_stamp_ns),
        "telemetry": conductor.intake.record(),
        "tuning": conductor.tuning.record(),
        "virtual_traffic": conductor.traffic.record(),
        "free_twin": conductor.mirror.record(),
        "encounters": conductor.beside.encounters.count.record(),
        "clocks_beside": conductor.beside.clocks(),
        "futures": futures.record(
            wanted=plan.config.futures,
            missed=tally.missed,
            spared=tally.spared,
            unseeded=tally.unseeded,
        ),
        "ledger": {"telemetry": telemetry_of(conductor), **msgspec.to_builtins(ledger)},
        "sensor_turns": msgspec.to_builtins(read_turns(plan.processes_dir)),
        "state_to_result_ms_p50": percentile(futures.latencies_ms, 50),
        "state_to_result_ms_p95": percentile(futures.latencies_ms, 95),
        "comparison": conductor.rounds.comparisons.record(independent=independent),
        "calibration": conductor.rounds.forecast_count.record(),
        "plan_comparison": conductor.rounds.plans.record(),
        "side_by_side": conductor.ads.record(),
        "siblings": conductor.rounds.siblings.count.record(plan.config.siblings),
        "agreement": conductor.rounds.windows.record(conductor.intake.start_stamp_ns),
        "processor": msgspec.to_builtins(cpu_uses(plan.processes_dir)),
        "orchestrator": {"restarts": len(ended_by), "ended_by": list(ended_by)},
        "workers": {
            "started": plan.config.workers,
            "restarted": restarted,
            "requeued_jobs": dispatch.requeued,
            "late_results": dispatch.late,
            "refusals": dispatch.sickness.record(),
            "strangers": conductor.strangers.count,
            "far": conductor.fleet.record(),
            "taken_over": dispatch.far.taken_over,
        },
        "dropped": {
            "orchestrator_mailbox": conductor.mailbox.dropped,
            "result_rows": conductor.tables.dropped,
            "failed_jobs": conductor.rounds.failed_jobs,
            "given_up_rounds": tally.failed,
            "last_given_up": tally.last_failure,
        },
        **conductor.refusals.record(),
        "troubles": [
            *troubles,
            *conductor.tables.troubles,
            *(f"the ledger of {name} does not balance" for name in unbalanced),
        ],
        "off_road": [
            {
                "reason": stretch.reason,
                "name": stretch.name,
                "way_ids": list(stretch.way_ids),
                "length_m": round(stretch.length_m, 1),
            }
            for stretch in mission.way.off_road_stretches
        ],
        "kept": kept_record(plan.folder, plan.config.keep),
        "memory": conductor.context.memory.record(),
        "left_out": {
            "intersections": junctions.left_out,
            "changes": conductor.changes.made.left_out,
            "parameter_changes": conductor.tuning.parameters.made.left_out,
            "verdicts": conductor.tuning.findings.left_out,
            **conductor.ads.left_out,
        },
        "drive_time_s": round(mission.drive_time_s, 3),
        "wall_s": round(wall_s, 3),
    }


def _known_at_start(plan: DrivePlan, exit_word: str) -> dict[str, Any]:
    return {
        "run_id": plan.run_id,
        "exit": exit_word,
        "versions": versions(),
        "map": {
            "file": str(plan.map_file),
            "sha256": plan.osm.sha256,
            "attribution": plan.osm.attribution,
        },
        "seed": plan.config.seed,
        "route_source": plan.route_source,
        "anchor": msgspec.to_builtins(plan.anchor),
        "config": msgspec.to_builtins(plan.config),
    }


def telemetry_of(conductor: Conductor) -> dict[str, Any]:
    """Return the ledger of the vehicle's telemetry.

    A car that is not ours may have begun to count before the run: what was heard of it counts.
    """
    return telemetry_ledger(
        read_tally(tally_file(conductor.plan.recording)), samples_heard(conductor)
    )


def samples_heard(conductor: Conductor) -> Mapping[str, int]:
    """Return what is known by channel of what the vehicle published."""
    intake = conductor.intake
    if intake.end is not None and conductor.plan.config.resolved_source != "live":
        return intake.end.published
    return intake.counts.by_channel


def restart_troubles(plan: DrivePlan, ended_by: Sequence[str]) -> list[str]:
    """Return what a drive misses since orchestrators died; in lock step all is played again."""
    if not ended_by or plan.config.lock_step:
        return []
    times = "once" if len(ended_by) == 1 else f"{len(ended_by)} times"
    how = ", ".join(sorted(set(ended_by)))
    lost = "rounds at work then are lost, and those due before the next one was there are missed"
    return [f"the orchestrator ended {times} by {how}: {lost}"]


def lost_lines(record: dict[str, Any]) -> list[str]:
    """Return what a run says last where something of it is lost or failed."""
    lost = lost_telemetry_line(record["ledger"]["telemetry"]), lost_rounds_line(record)
    failed = failed_line(record)
    return [
        *(f"error: {trouble}" for trouble in record["troubles"]),
        *(f"lost: {line}" for line in lost if line is not None),
        *([] if failed is None else [f"failed: {failed}"]),
    ]


def reserve_record(plan: DrivePlan, file: Path) -> None:
    """Write a run.json that says that the run goes on, and of what it is, for who may have to
    complete it; it keeps room on the disk for the last.

    Whoever lists runs meanwhile sees the whole of it or nothing.
    """
    folder = None if plan.local is None else str(plan.local.folder)
    joining = {"endpoint": plan.bus.endpoint, "credentials": folder}
    begun = _known_at_start(plan, RUNNING) | joining
    text = json.dumps(begun, ensure_ascii=False)
    with whole_file(file) as partial:
        partial.write_bytes(text.encode().ljust(RESERVED_BYTES) + b"\n")
    sync_folder(file.parent)
