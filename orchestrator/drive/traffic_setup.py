"""What virtual traffic is started with, in drives that have it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from foretwin.contracts.errors import UserError
from foretwin.contracts.setup import TrafficSetup
from foretwin.contracts.virtual_traffic import VirtualTraffic
from foretwin.orchestrator.plan import DrivePlan
from foretwin.sim_worker.scenarios.reading import find_scenario
from foretwin.sim_worker.virtual_traffic.staged import check_going
from foretwin.sim_worker.virtual_traffic.sumo import NEEDS_SUMO, check_network, is_there

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


def check(chosen: VirtualTraffic) -> None:
    """Raise UserError for a scenario, a network or a SUMO that is not there, before a drive."""
    if chosen.source == "scenario":
        check_going(find_scenario(chosen.scenario))
    if chosen.source == "sumo":
        if not is_there():
            raise UserError(NEEDS_SUMO)
        check_network(Path(chosen.network or ""))
