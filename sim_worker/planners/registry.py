"""Planners by name: those of foretwin, and any that an installed package offers.

A package adds one with an entry point in the group `foretwin.planners` whose object is a class
without arguments that follows `foretwin.sim_worker.planner_interface.Planner`, or
`foretwin.sim_worker.planners.one_at_a_time.CarPlanner`. It lives in a process of its own.
"""

from __future__ import annotations

import functools
import importlib.metadata
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

from foretwin.contracts.did_you_mean import one_of
from foretwin.contracts.errors import UserError
from foretwin.sim_worker.planner_interface import Planner
from foretwin.sim_worker.planners.as_planned import AsPlanned
from foretwin.sim_worker.planners.constant_speed import ConstantSpeed
from foretwin.sim_worker.planners.frenet_lattice import FrenetLattice
from foretwin.sim_worker.planners.gap_acceptance import GapAcceptance
from foretwin.sim_worker.planners.hosted import HostedPlanner
from foretwin.sim_worker.planners.origin import PlannerOrigin, files_digest, origin_of
from foretwin.sim_worker.planners.pure_pursuit_idm import PurePursuitIdm
from foretwin.sim_worker.planners.remote import RemotePlanner
from foretwin.sim_worker.planners.reverse_pursuit import ReversePursuit

GROUP = "foretwin.planners"
REMOTE, AS_PLANNED = "remote", "as_planned"
_IN_DRIVES = {
    REMOTE: "asks a stack over the bus of a drive",
    AS_PLANNED: "drives the plan that the car of a drive publishes",
}
"""Planners that need a drive, and what for."""

_BUILT_IN: dict[str, type[Planner]] = {
    "pure_pursuit_idm": PurePursuitIdm,
    "constant_speed": ConstantSpeed,
    "gap_acceptance": GapAcceptance,
    "frenet_lattice": FrenetLattice,
    AS_PLANNED: AsPlanned,
    "reverse_pursuit": ReversePursuit,
    REMOTE: RemotePlanner,
}


def planner_names() -> tuple[str, ...]:
    """Return all known names, the built-in ones first."""
    offered = {point.name for point in entry_points(group=GROUP)}
    return (*_BUILT_IN, *sorted(offered - _BUILT_IN.keys()))


@functools.cache
def load_planner(name: str) -> Planner:
    """Return the planner of that name; raises UserError naming the known ones."""
    if name in _BUILT_IN:
        return _BUILT_IN[name]()
    return HostedPlanner(name, _entry_point(name).value)


def _entry_point(name: str) -> EntryPoint:
    for point in entry_points(group=GROUP):
        if point.name == name:
            return point
    raise UserError(f"unknown planner {name!r}; {one_of(name, planner_names())}")


def check_planner(name: str, *, in_drive: bool = True) -> None:
    """Raise UserError where no planner of that name loads, or it needs a drive where there is none.

    Leaves no process behind.
    """
    if not in_drive and name in _IN_DRIVES:
        raise UserError(f"planner {name} {_IN_DRIVES[name]}; there is none here")
    planner = load_planner.__wrapped__(name)
    if isinstance(planner, HostedPlanner):
        planner.close()


def in_another_process(name: str) -> bool:
    """Return whether a planner answers from a process that is not foretwin's own."""
    return name == REMOTE or name not in _BUILT_IN


def planner_origin(name: str) -> PlannerOrigin:
    """Return what a planner is made of; raises UserError naming the known ones."""
    if name in _BUILT_IN:
        # Those of foretwin share most of their modules: a change of one counts for all.
        version = importlib.metadata.version("foretwin")
        return PlannerOrigin("foretwin", version, files_digest([Path(__file__).parent]))
    return origin_of(_entry_point(name))


def drives_backwards(name: str) -> bool:
    """Return whether a planner has its cars driven in reverse: of foretwin's own, some do."""
    return bool(getattr(_BUILT_IN.get(name), "drives_backwards", False))
