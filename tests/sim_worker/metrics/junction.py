"""The crossroads of this folder's tests, with lights, stop lines and priorities.

The ego comes from the west on y = -1.5. From the north and south comes who has priority, unless
lights say otherwise.
"""

from __future__ import annotations

import msgspec
import numpy as np

from foretwin.contracts.provenance import Choice
from foretwin.contracts.signals import SignalGroup, SignalPhase, SignalPlan
from foretwin.contracts.world import Arm, Conflict, StopLine, World, WorldJunction
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.metrics.ground import DrivableGround
from foretwin.sim_worker.metrics.lane_areas import LaneAreas
from foretwin.sim_worker.metrics.rollout import Context
from foretwin.sim_worker.metrics.route_rules import RouteRules
from tests.sim_worker.places import crossroads, straight_path

GREEN_S, AMBER_S, ALL_RED_S = 10.0, 3.0, 2.0
STOP_X = -6.0
PLAN = SignalPlan(
    groups=(
        SignalGroup(id="ew", connection_ids=("east", "west")),
        SignalGroup(id="ns", connection_ids=("north", "south")),
    ),
    phases=(
        SignalPhase(green_s=GREEN_S, green_group_ids=("ew",)),
        SignalPhase(green_s=GREEN_S, green_group_ids=("ns",)),
    ),
    amber_s=AMBER_S,
    all_red_s=ALL_RED_S,
    source="default",
)


def junction(*, lights: bool, red_after_stop: bool = False) -> World:
    """From the west (connection `east`) one waits for `north` (driven northwards) and `south`.

    With `red_after_stop` its driver may go on red once it has stopped.
    """
    plain = crossroads()
    groups = {"east": "ew", "west": "ew", "north": "ns", "south": "ns"}
    connections = tuple(
        msgspec.structs.replace(
            c,
            signal_group_id=groups[c.id] if lights else None,
            control="signal" if lights else "none",
            red_after_stop=(red_after_stop and c.id == "east") or msgspec.UNSET,
        )
        for c in plain.connections
    )
    conflicts = tuple(
        Conflict(
            first_id=min("east", other),
            second_id=max("east", other),
            kind="crossing",
            point=np.array([x, -1.5]),
            yields_id="east",
            rule="priority_road",
            source="tagged",
            area=np.array([[x - 1, -2.5], [x + 1, -2.5], [x + 1, -0.5], [x - 1, -0.5]]),
        )
        for other, x in (("north", 1.5), ("south", -1.5))
    )
    line = StopLine(
        id="stop",
        lane_id="from_east",
        ends=np.array([[STOP_X, 0.0], [STOP_X, -3.0]]),
        control=Choice("signal" if lights else "give_way", "tagged"),
    )
    whole = WorldJunction(
        summary=plain.intersection,
        arms=(Arm(id="a", name="", osm_ways=(1,), bearing_rad=0.0, lanes_in=1, lanes_out=1),),
        area=None,
        plan=PLAN if lights else None,
    )
    return msgspec.structs.replace(
        plain, connections=connections, conflicts=conflicts, stop_lines=(line,), junctions=(whole,)
    )


def context(
    *, lights: bool = False, start_s: float = 0.0, path: FrenetPath | None = None
) -> Context:
    world = junction(lights=lights)
    way = FrenetPath(straight_path().xy_m) if path is None else path
    return Context(
        path=way,
        ground=DrivableGround(world),
        rules=RouteRules(world, way),
        lanes=LaneAreas(world),
        start_s=start_s,
    )
