"""What the process of digital siblings is started with, in drives that have them."""

from __future__ import annotations

from typing import Any

from foretwin.contracts.errors import UserError
from foretwin.contracts.setup import WorkerSetup
from foretwin.contracts.siblings import SiblingEngine
from foretwin.orchestrator.config import DriveConfig
from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.rounds.jobs import planners_of
from foretwin.orchestrator.rounds.siblings import SIBLING as SIBLING
from foretwin.sim_worker.engines.registry import trouble_with_engine
from foretwin.sim_worker.planners.registry import in_another_process

KEPT_WORLDS = 3


def runs(plan: DrivePlan) -> bool:
    """Whether a drive has digital siblings."""
    return plan.config.siblings.on


def made(plan: DrivePlan, base: dict[str, Any]) -> WorkerSetup:
    """Return how the process is set: a worker for the two futures of a round."""
    return WorkerSetup(
        **base,
        role="futures",
        worlds_dir=str(plan.worlds_dir),
        vehicle=plan.vehicle,
        gives_way=not plan.config.lock_step,
        simulations=2,
        kept_worlds=KEPT_WORLDS,
        planners=tuple(planners_of(plan.config.planner)),
    )


def check(config: DriveConfig) -> None:
    """Raise UserError for siblings that this machine, or this planner, cannot have."""
    engine: SiblingEngine = config.siblings.engine
    if engine == "off":
        return
    if (trouble := trouble_with_engine(engine)) is not None:
        raise UserError(f"siblings, engine {engine}: {trouble}")
    if in_another_process(config.planner):
        raise UserError(f"siblings: --planner {config.planner} is a process that drives one engine")
