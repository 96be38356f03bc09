"""The Worlds where a given route begins: made before the vehicle is told to go.

A drive that begins within a junction's radius would otherwise be late for it by as long as the
first World takes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

from foretwin.orchestrator.drive.conductor import Conductor
from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.routing.junctions_ahead import encounters
from foretwin.orchestrator.routing.route import Route
from foretwin.world_gen.junctions.intersections import Junction

WITHIN_M = 300.0
TIMEOUT_S = 10.0
"""So long a drive waits for its first Worlds; then it begins without them."""


def junctions_at_start(
    route: Route, junctions: Iterable[Junction], within_m: float
) -> tuple[Junction, ...]:
    """Return the junctions whose centres a route meets on its first `within_m`."""
    junction_at = {node: junction for junction in junctions for node in junction.nodes}
    until_m = float(route.start_m[0]) + within_m
    return tuple(met.junction for met in encounters(route, junction_at) if met.centre_s_m < until_m)


def prepare_start(
    plan: DrivePlan,
    conductor: Conductor,
    *,
    look_after: Callable[[Conductor, float], None],
    stop: Callable[[], bool],
) -> None:
    """Have the first Worlds built and loaded; nothing to do where no route's start is known."""
    if not _begins_at_route(plan):
        return
    began_s = time.monotonic()
    first = junctions_at_start(plan.routes[0], plan.junctions, WITHIN_M)
    conductor.obey(conductor.mission.before_start(first, mono_s=began_s))
    while conductor.worlds.building and not stop():
        if time.monotonic() > began_s + TIMEOUT_S:
            return
        look_after(conductor, time.monotonic())
        conductor.handle(conductor.mailbox.take(0.1))


def _begins_at_route(plan: DrivePlan) -> bool:
    """Whether the car starts where the route does; a file's route may begin before `--start`."""
    config = plan.config
    return bool(plan.routes) and (config.route == "from-log" or config.start_s == 0.0)
