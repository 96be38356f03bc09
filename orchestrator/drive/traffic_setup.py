"""What virtual traffic is started with, in drives that have it."""

from __future__ import annotations

from typing import Any

from foretwin.contracts.setup import TrafficSetup
from foretwin.orchestrator.plan import DrivePlan

TRAFFIC, MODULE = "traffic", "sim_worker.virtual_traffic"


def runs(plan: DrivePlan) -> bool:
    """Whether a drive has virtual traffic."""
    return plan.config.virtual_traffic.source != "off"


def made(plan: DrivePlan, base: dict[str, Any]) -> TrafficSetup:
    """Return how the process is set that lets virtual road users go on."""
    chosen = plan.config.virtual_traffic
    return TrafficSetup(
        **base,
        vehicle=plan.vehicle,
        worlds_dir=str(plan.worlds_dir),
        traffic=chosen,
        seed=plan.config.seed if chosen.seed is None else chosen.seed,
    )
