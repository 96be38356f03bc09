"""How the processes of a drive are started: which are forks, and what is imported for them."""

from __future__ import annotations

import os

from foretwin.orchestrator.drive.processes import PROCESSES, ROUTER, rows_by_id
from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.runner.fork_launch import Forks
from foretwin.orchestrator.runner.launch import FreshInterpreter, Launcher

IMPORTED_HERE = {
    "orchestrator.worlds.builder_process": ("orchestrator.worlds.builder_process",),
    "sim_worker": ("sim_worker.worker", "sim_worker.mirror.process"),
    "sim_worker.analysis.process": ("sim_worker.analysis.process",),
    "sim_worker.sensors.process": ("sim_worker.sensors.process",),
    "sim_worker.virtual_traffic": ("sim_worker.virtual_traffic.process",),
    "telemetry.processes.recorder": ("telemetry.processes.recorder",),
    "telemetry.processes.replay": ("telemetry.processes.replay",),
    "telemetry.standin": ("telemetry.standin.__main__",),
}
"""What the supervisor imports for the processes of a module. Nothing for who draws, or speaks to
ROS 2: their libraries start threads as they are imported, and none may run in who forks."""


def launcher(plan: DrivePlan) -> Launcher:
    """Return what starts the processes of a drive.

    The router is no fork: it stays small, and listens while the supervisor imports. Nor is anyone
    where orders go towards the vehicle: a fork has the orchestrator's key in its memory; or where
    linear algebra has threads here: a fork cannot do without them any more.
    """
    if plan.towards_vehicle or os.environ.get("OPENBLAS_NUM_THREADS") != "1":
        return FreshInterpreter(plan.processes_dir)
    modules = dict.fromkeys(row.module for row in rows_by_id(plan).values())
    return Forks(
        plan.processes_dir,
        fresh={row.module for row in PROCESSES if row.name == ROUTER},
        imported=[name for module in modules for name in IMPORTED_HERE.get(module, ())],
    )
