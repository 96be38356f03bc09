"""Starts a run's router before anything else, and joins its bus."""

from __future__ import annotations

import contextlib
import logging
import re
import shutil
import time
from dataclasses import replace

from foretwin.contracts.bus import BusUnreachable, ZenohBus
from foretwin.contracts.errors import UserError
from foretwin.contracts.local_bus import make_local_bus
from foretwin.contracts.router import LISTENS
from foretwin.contracts.terminal import say
from foretwin.contracts.zenoh_config import read_by_one_thread
from foretwin.orchestrator.drive.processes import ORCHESTRATOR, PROCESSES, ROUTER, members, row_of
from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.runner.supervisor import Supervisor

log = logging.getLogger(ORCHESTRATOR)

LISTENS_WITHIN_S = 30.0
"""Long: a busy machine is no fault of the router's."""
_LOOK_S = 0.005


def on_local_bus(plan: DrivePlan) -> DrivePlan:
    """Return a drive with its bus: as it is where an endpoint is given, else one of this host."""
    if plan.bus.endpoint:
        return plan
    everybody = members(plan)
    local = make_local_bus(
        plan.run_id,
        everybody,
        run_id=plan.run_id,
        lossless=plan.bus.lossless,
        instead=plan.processes_dir,
    )
    if local.trouble:
        text = f"no socket for the bus ({local.trouble}): it is on the loopback, with passwords"
        log.warning("%s", text)
        say(f"warning: {text}", error=True)
    return replace(plan, local=local, bus=local.setup_of(ORCHESTRATOR))


def start_router(plan: DrivePlan, supervisor: Supervisor) -> None:
    """Start the router, and wait until it listens.

    UserError, with no folder left, where it cannot. Nobody connects before it listens: where the
    port is another's, that would be a stranger's bus.
    """
    row = next(row for row in PROCESSES if row.name == ROUTER)
    plan.router_word_file.unlink(missing_ok=True)
    supervisor.start(row_of(row, plan), row.setup(plan, ROUTER))
    word = _word(plan, supervisor)
    if word != LISTENS:
        supervisor.stop(grace_s=0.0)
        shutil.rmtree(plan.folder, ignore_errors=True)
        raise UserError(cannot_listen_text(plan.bus.endpoint, word))


def join_bus(plan: DrivePlan) -> ZenohBus:
    """Return a session of the run's bus; raises BusUnreachable where its router stays away."""
    deadline_s = time.monotonic() + LISTENS_WITHIN_S
    while True:
        try:
            with contextlib.nullcontext() if plan.bus.lossless else read_by_one_thread():
                return ZenohBus(plan.bus)
        except BusUnreachable:  # it has died and is started again
            if time.monotonic() > deadline_s:
                raise


def _word(plan: DrivePlan, supervisor: Supervisor) -> str:
    """Return what the router says; empty where it ends or hangs without a word."""
    deadline_s = time.monotonic() + LISTENS_WITHIN_S
    while True:
        running = ROUTER in supervisor.running()
        if plan.router_word_file.exists():
            return plan.router_word_file.read_text(encoding="utf-8")
        if not running or time.monotonic() > deadline_s:
            return ""
        time.sleep(_LOOK_S)


def cannot_listen_text(endpoint: str, word: str) -> str:
    """Say why a router cannot listen at an endpoint; `word` is Zenoh's own."""
    port = re.search(r":(\d+)(?=[?#]|$)", endpoint)
    if "in use" in word and port is not None:
        return (
            f"endpoint {endpoint}: port {port[1]} is taken; end what listens on it, or give "
            "another one"
        )
    return (
        f"endpoint {endpoint}: cannot be listened on here; it must be an address of this machine "
        "with a free port"
    )
