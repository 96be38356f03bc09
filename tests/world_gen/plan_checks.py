"""Checks that hold for the signal plans of any World."""

from __future__ import annotations

from foretwin.contracts.signals import SignalPlan
from foretwin.contracts.world import World
from foretwin.world_gen.rules.signal_plan import LEAST_GREEN_S


def plan_of(world: World) -> SignalPlan:
    plan = world.junctions[0].plan
    assert plan is not None
    return plan


def check_plans(world: World) -> int:
    """Fail where a phase lets conflicting groups go; return the number of plans."""
    group_of = {c.id: c.signal_group_id for c in world.connections}
    meeting: dict[frozenset[str | None], set[str]] = {}
    for c in world.conflicts:
        pair = frozenset((group_of[c.first_id], group_of[c.second_id]))
        if len(pair) == 2 and None not in pair:
            meeting.setdefault(pair, set()).add(c.rule)
    plans = [junction.plan for junction in world.junctions if junction.plan is not None]
    named: list[str] = []
    for plan in (*plans, *world.crossing_plans):
        groups = [group.id for group in plan.groups]
        named += groups
        green = {name for phase in plan.phases for name in phase.green_group_ids}
        assert green == set(groups)
        assert all(phase.green_s >= LEAST_GREEN_S for phase in plan.phases)
        assert plan.amber_s in (3.0, 4.0, 5.0)
        assert plan.all_red_s >= 1.0
        step_s = plan.amber_s + plan.all_red_s
        assert sum(phase.green_s + step_s for phase in plan.phases) <= 180.0
        for phase in plan.phases:
            for a in phase.green_group_ids:
                for b in phase.green_group_ids:
                    if a < b:
                        assert meeting.get(frozenset((a, b)), set()) <= {"turn_across", "u_turn"}
    assert len(set(named)) == len(named)
    for junction in world.junctions:
        for group in junction.plan.groups if junction.plan else ():
            assert group.id.startswith(f"{junction.summary.id}:g")
            assert all(group_of[name] == group.id for name in group.connection_ids)
    assert {signal.group_id for signal in world.signals} <= set(named)
    governed = {lane for signal in world.signals for lane in signal.lane_ids}
    lit = {line.lane_id for line in world.stop_lines if line.control.value == "signal"}
    assert lit == governed
    return len(plans)
