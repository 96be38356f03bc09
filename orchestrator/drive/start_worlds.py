"""The Worlds where a drive begins on its route: made before the vehicle is told to go.

A drive that begins within a junction's radius would otherwise be late for it by as long as the
first World takes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import NamedTuple

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import local_from_geo
from foretwin.orchestrator.drive.conductor import Conductor
from foretwin.orchestrator.drive.mission import KEEP_PAST_CENTRE_M
from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.routing.junctions_ahead import encounters
from foretwin.orchestrator.routing.line_matching import NEAR_ROAD_M
from foretwin.orchestrator.routing.road_index import project
from foretwin.orchestrator.routing.route import Route
from foretwin.world_gen.junctions.intersections import Junction

WITHIN_M = 300.0
_ALIKE_M = 5.0
"""Places of a route this much farther from the car may be where it is. Chosen: a lane's width."""
TIMEOUT_S = 10.0
"""So long a drive waits for its first Worlds; then it begins without them."""


def junctions_at_start(
    route: Route, junctions: Iterable[Junction], within_m: float, *, from_m: float = 0.0
) -> tuple[Junction, ...]:
    """Return the junctions whose centres a route meets up to `within_m` from `from_m` on.

    Those just behind, whose radius a car there may still be in, count too.
    """
    junction_at = {node: junction for junction in junctions for node in junction.nodes}
    ahead_m = [
        (met.junction, met.centre_s_m - float(route.start_m[0]) - from_m)
        for met in encounters(route, junction_at)
    ]
    return tuple(one for one, at_m in ahead_m if -KEEP_PAST_CENTRE_M < at_m < within_m)


def prepare_start(
    plan: DrivePlan,
    conductor: Conductor,
    *,
    look_after: Callable[[Conductor, float], None],
    stop: Callable[[], bool],
) -> None:
    """Have the first Worlds built and loaded; nothing to do for a car that starts on no route."""
    found = start_of(plan)
    if found is None:
        return
    began_s = time.monotonic()
    first = junctions_at_start(found.route, plan.junctions, WITHIN_M, from_m=found.from_m)
    conductor.obey(conductor.mission.before_start(first, mono_s=began_s))
    while conductor.worlds.building and not stop():
        if time.monotonic() > began_s + TIMEOUT_S:
            return
        look_after(conductor, time.monotonic())
        conductor.handle(conductor.mailbox.take(0.1))


class StartOnRoute(NamedTuple):
    """The route that a car starts on, and how far along it."""

    route: Route
    from_m: float


def start_of(plan: DrivePlan) -> StartOnRoute | None:
    """Return where a drive starts on its routes; None without any, and for a log off them.

    A log's own route begins where the car does. One from a file is met where the log's first
    position is, which `--start` moves on; the drive's frame has its origin there.
    """
    if plan.log_file is None or plan.config.route == "from-log":
        return StartOnRoute(plan.routes[0], 0.0) if plan.routes else None
    origin = plan.drive_frame.origin
    return start_on(plan.routes, local_from_geo(plan.graph.frame, origin.lat_deg, origin.lon_deg))


def start_on(routes: Iterable[Route], xy_m: Array) -> StartOnRoute | None:
    """Return where on the given routes a car at (2,) `xy_m` starts, None where none is near.

    Of a road that is driven several times the first counts.
    """
    places = [
        (near.distance_m, StartOnRoute(route, float(start_m - route.start_m[0]) + near.s_m))
        for route in routes
        for edge, start_m in zip(route.edges, route.start_m, strict=False)
        if (near := project(edge, xy_m)).distance_m < NEAR_ROAD_M
    ]
    nearest_m = min((distance_m for distance_m, _ in places), default=0.0)
    return next((found for away_m, found in places if away_m <= nearest_m + _ALIKE_M), None)
