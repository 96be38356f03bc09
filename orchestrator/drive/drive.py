"""One drive from its inputs to its files: who supervises it, and who is its orchestrator."""

from __future__ import annotations

import dataclasses
import datetime
import functools
import logging
import shutil
import time
from pathlib import Path
from typing import NamedTuple

from foretwin.contracts import trace
from foretwin.contracts.errors import UserError, one_line
from foretwin.contracts.new_folder import named_in_errors, new_folder
from foretwin.contracts.process import log_to_file
from foretwin.contracts.setup import ProcessSetup
from foretwin.contracts.signing import OrderSigner
from foretwin.contracts.versions import versions
from foretwin.orchestrator.config import DriveConfig
from foretwin.orchestrator.drive.exit_words import EXIT_FAILED
from foretwin.orchestrator.drive.foreground import Foreground, start_all
from foretwin.orchestrator.drive.in_charge import SwornIn, sworn_in
from foretwin.orchestrator.drive.launching import launcher
from foretwin.orchestrator.drive.metrics_server import listening
from foretwin.orchestrator.drive.orchestrator import CrashError, Orchestrator
from foretwin.orchestrator.drive.plan import make_plan, read_inputs
from foretwin.orchestrator.drive.processes import ORCHESTRATOR, SUPERVISOR
from foretwin.orchestrator.drive.router_start import on_local_bus
from foretwin.orchestrator.drive.supervision import CRASHED, DriveError, Life, OwnProcesses
from foretwin.orchestrator.drive.supervisor_link import SupervisorLink
from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.record.run_state import LOG, RECORD, run_lock
from foretwin.orchestrator.rounds.jobs import RoundPlanner
from foretwin.orchestrator.runner.launch import FreshInterpreter
from foretwin.orchestrator.runner.supervisor import Supervisor
from foretwin.orchestrator.runner.warm_fork import trouble_with_forking

log = logging.getLogger(ORCHESTRATOR)


class EndedDrive(NamedTuple):
    """How a drive ended, and the folder of its run."""

    code: int
    folder: Path


def drive(config: DriveConfig) -> EndedDrive:
    """Run one drive. Raises UserError before anything is written."""
    inputs = read_inputs(config)
    out = f"--out {config.out}"
    with listening(config.metrics) as metrics, named_in_errors(out), new_folder(Path(config.out)):
        plan = make_plan(inputs, datetime.datetime.now())
        code = carry_out(dataclasses.replace(plan, metrics=metrics))
        return EndedDrive(code, plan.folder)


def carry_out(plan: DrivePlan) -> int:
    """Run a drive whose folder is made; returns its exit code.

    This process becomes the supervisor, and forks the orchestrator. Where it cannot be forked,
    since threads run in it, it is both, and nobody starts the orchestrator again. What cannot even
    begin, as on a full disk, leaves no folder.
    """
    try:
        return _carry_out(plan)
    except OSError:
        if not (plan.folder / RECORD).exists():
            shutil.rmtree(plan.folder, ignore_errors=True)
        raise


def _carry_out(plan: DrivePlan) -> int:
    with run_lock(plan.folder), sworn_in(plan) as sworn:
        _log_as(SUPERVISOR, plan)
        log.info("run %s in %s, versions %s", plan.run_id, plan.folder, versions())
        plan = on_local_bus(sworn.plan)
        try:
            return _supervise(SwornIn(plan, sworn.signer))
        finally:
            _take_passwords_away(plan)


def _supervise(sworn: SwornIn) -> int:
    plan = sworn.plan
    planner = RoundPlanner(plan.config, plan.vehicle)
    trouble = trouble_with_forking()
    if trouble is None:
        work = functools.partial(orchestrate, signer=sworn.signer)
        foreground = Foreground(plan, work, launch=launcher(plan))
        return foreground.run(meanwhile=planner.draw_cases)
    log.info("nobody will start the orchestrator again: %s", trouble)
    supervisor = Supervisor(FreshInterpreter(plan.processes_dir))
    try:
        start_all(supervisor, plan)
        planner.draw_cases()
        with trace.whole_run(plan.trace_dir, ORCHESTRATOR):
            life = Life(time.monotonic())
            return Orchestrator(
                plan, OwnProcesses(plan, supervisor), life, signer=sworn.signer
            ).run()
    finally:
        supervisor.stop(grace_s=0.0)


def _take_passwords_away(plan: DrivePlan) -> None:
    if plan.local is not None:
        plan.local.remove()


def orchestrate(
    plan: DrivePlan, link: SupervisorLink, life: Life, *, signer: OrderSigner | None = None
) -> int:
    """Be the orchestrator of a drive, forked by its supervisor; returns the exit code."""
    _log_as(ORCHESTRATOR, plan)
    try:
        with trace.whole_run(plan.trace_dir, ORCHESTRATOR):
            return Orchestrator(plan, link, life, signer=signer).run()
    except CrashError:
        return CRASHED
    except UserError as error:
        link.refuse(str(error), by_user=True)
    except Exception as error:
        told = str(error) if isinstance(error, DriveError) else one_line(error)
        link.refuse(told, by_user=False)
    finally:
        if link.alone:
            _take_passwords_away(plan)
    return EXIT_FAILED


def _log_as(process_id: str, plan: DrivePlan) -> None:
    log_to_file(
        ProcessSetup(
            run_id=plan.run_id,
            process_id=process_id,
            vehicle_id=plan.config.vehicle_id,
            bus=plan.bus,
            log_file=str(plan.folder / LOG),
        )
    )
