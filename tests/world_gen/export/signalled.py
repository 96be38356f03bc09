"""A crossing with lights, told in full: groups, a plan, and who waits for whom."""

from __future__ import annotations

import msgspec
import numpy as np

from foretwin.contracts.signals import SignalGroup, SignalPhase, SignalPlan
from foretwin.contracts.world import Conflict, World, WorldJunction
from tests.world_gen.drawn_maps import crossing, world_of


def signalled_crossing() -> World:
    """A crossing of two streets with lights: one group for each, and what waits for what."""
    plain = world_of(crossing(node_tags={0: {"highway": "traffic_signals"}}))
    junction = plain.intersection.id

    def group(lane_id: str) -> str:
        return "street" if lane_id.startswith(("w11", "w13")) else "avenue"

    connections = [
        msgspec.structs.replace(c, junction_id=junction, signal_group_id=group(c.from_lane_id))
        for c in plain.connections
    ]
    signals = [msgspec.structs.replace(s, group_id=group(s.lane_ids[0])) for s in plain.signals]
    plan = SignalPlan(
        groups=tuple(
            SignalGroup(
                id=name,
                connection_ids=tuple(c.id for c in connections if c.signal_group_id == name),
            )
            for name in ("street", "avenue")
        ),
        phases=(
            SignalPhase(green_s=30.0, green_group_ids=("street",)),
            SignalPhase(green_s=20.0, green_group_ids=("avenue",)),
        ),
        amber_s=3.0,
        all_red_s=2.0,
        source="default",
    )
    conflicts = tuple(
        Conflict(
            first_id=c.id,
            second_id=other,
            kind="crossing",
            point=np.zeros(2),
            area=np.zeros((0, 2)),
            yields_id=c.id,
            rule="order",
            source="default",
        )
        for c in connections
        for other in c.yields_to
    )
    return msgspec.structs.replace(
        plain,
        connections=tuple(connections),
        signals=tuple(signals),
        conflicts=conflicts,
        junctions=(WorldJunction(summary=plain.intersection, arms=(), area=None, plan=plan),),
    )
