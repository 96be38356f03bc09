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
from typing import TYPE_CHECKING

from foretwin.contracts.did_you_mean import one_of
from foretwin.contracts.errors import UserError
from foretwin.sim_worker.planners.origin import PlannerOrigin, files_digest, origin_of

if TYPE_CHECKING:
    from foretwin.sim_worker.planner_interface import Planner
    from foretwin.sim_worker.planners.hosted import HostedPlanner

GROUP = "foretwin.planners"
REMOTE, AS_PLANNED = "remote", "as_planned"
_IN_DRIVES = {
    REMOTE: "asks a stack over the bus of a drive",
    AS_PLANNED: "drives the plan that the car of a drive publishes",
}
"""Planners that need a drive, and what for."""

_OWN: dict[str, bool] = {
    "pure_pursuit_idm": False,
    "constant_speed": False,
    "gap_acceptance": False,
    "frenet_lattice": False,
    AS_PLANNED: False,
    "reverse_pursuit": True,
    REMOTE: False,
}
"""Those of foretwin, and whether cars are driven in reverse. Their classes stand in `built_in.py`:
who only asks for names, as the command of a sweep does, loads nothing that plans."""


def planner_names() -> tuple[str, ...]:
    """Return all known names, the built-in ones first."""
    offered = {point.name for point in entry_points(group=GROUP)}
    return (*_OWN, *sorted(offered - _OWN.keys()))


@functools.cache
def load_planner(name: str) -> Planner:
    """Return the planner of that name; raises UserError naming the known ones."""
    if name in _OWN:
        from foretwin.sim_worker.planners.built_in import BUILT_IN

        return BUILT_IN[name]()
    return _hosted(name)


def _hosted(name: str) -> HostedPlanner:
    from foretwin.sim_worker.planners.hosted import HostedPlanner

    return HostedPlanner(name, _entry_point(name).value)


def _entry_point(name: str) -> EntryPoint:
    """Return who offers a planner; raises UserError where nobody, or more than one does."""
    points = _offering(name)
    if len(points) > 1:
        who = " and ".join(sorted(_package(point) for point in points))
        raise UserError(f"planner {name!r}: {who} offer one; uninstall one, or rename its entry")
    if not points:
        raise UserError(f"unknown planner {name!r}; {one_of(name, planner_names())}")
    return points[0]


def _offering(name: str) -> tuple[EntryPoint, ...]:
    """Return the entry points of that name, but for foretwin's own."""
    points = entry_points(group=GROUP, name=name)
    return tuple(point for point in points if not point.value.startswith("foretwin."))


def _package(point: EntryPoint) -> str:
    return point.value if point.dist is None else point.dist.name


def check_planner(name: str, *, in_drive: bool = True) -> None:
    """Raise UserError where no planner of that name loads, or it needs a drive where there is none.

    Leaves no process behind.
    """
    if not in_drive and name in _IN_DRIVES:
        raise UserError(f"planner {name} {_IN_DRIVES[name]}; there is none here")
    if name not in _OWN:
        _hosted(name).close()
    elif also := _offering(name):
        who = _package(also[0])
        raise UserError(f"planner {name!r} is one of foretwin; rename the entry of {who}")


def in_another_process(name: str) -> bool:
    """Return whether a planner answers from a process that is not foretwin's own."""
    return name == REMOTE or name not in _OWN


def planner_origin(name: str) -> PlannerOrigin:
    """Return what a planner is made of; raises UserError naming the known ones."""
    if name in _OWN:
        # Those of foretwin share most of their modules: a change of one counts for all.
        version = importlib.metadata.version("foretwin")
        return PlannerOrigin("foretwin", version, files_digest([Path(__file__).parent]))
    return origin_of(_entry_point(name))


def drives_backwards(name: str) -> bool:
    """Return whether a planner has its cars driven in reverse: of foretwin's own, some do."""
    return _OWN.get(name, False)
