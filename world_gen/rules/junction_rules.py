"""Stop lines, lights and right of way of all junctions that lie whole in a World."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from itertools import chain
from typing import NamedTuple

from foretwin.contracts.signals import Signal, SignalPlan
from foretwin.contracts.world import Conflict, Crossing, StopLine
from foretwin.world_gen.connections.lane_connections import ConnectionDraft
from foretwin.world_gen.countries.rules import rules_of
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.lanes.lane_curves import LaneSet
from foretwin.world_gen.lanes.stopping import NodeTags
from foretwin.world_gen.rules.approaches import Approach, approaches
from foretwin.world_gen.rules.control_devices import lights_inside
from foretwin.world_gen.rules.lone_lights import lone_lights
from foretwin.world_gen.rules.right_of_way import right_of_way
from foretwin.world_gen.rules.ring_exits import with_ring_exits
from foretwin.world_gen.rules.signal_groups import lane_groups, walk_groups
from foretwin.world_gen.rules.signal_heads import signal_heads
from foretwin.world_gen.rules.signal_plan import signal_plans
from foretwin.world_gen.rules.signal_systems import signal_systems
from foretwin.world_gen.rules.signs_inside import SignsInside, signs_inside
from foretwin.world_gen.rules.stop_lines import line_controls, lines_at_signs, stop_lines
from foretwin.world_gen.rules.turns_on_red import allow_on_red


class TrafficControl(NamedTuple):
    """Control devices and conflicts of a World.

    `plans` are by junction id, `crossing_plans` those of lights away from junctions.
    """

    stop_lines: tuple[StopLine, ...]
    signals: tuple[Signal, ...]
    conflicts: tuple[Conflict, ...]
    plans: Mapping[str, SignalPlan]
    crossing_plans: tuple[SignalPlan, ...]


def junction_rules(
    around: Surroundings,
    node_tags: NodeTags,
    lanes: LaneSet,
    connections: Sequence[ConnectionDraft],
    crossings: Sequence[Crossing],
    junction_lights: Collection[int],
    not_on_red: Collection[tuple[int, int]],
) -> TrafficControl:
    """Return the rules of every whole junction, and of every light away from one.

    `junction_lights` are the nodes of the lights of all junctions of the map, `not_on_red` the
    ways from and to which signs forbid the turn on red.
    Control, signal group and conflicts are entered into the connections.
    """
    signs = signs_inside(connections, node_tags, around)
    found = approaches(around, node_tags, connections, junction_lights, signs)
    lines = stop_lines(found, around, lanes, crossings)
    _control(connections, found, lines, signs, node_tags, around)
    whole = {id(junction) for junction in around.junctions}
    ruled = [c for c in connections if id(c.cluster.junction) in whole]
    country = rules_of(around.country)
    conflicts, met = right_of_way(ruled, found, signs, around.driving_side, country.first_from)
    groups = lane_groups(found, around, lanes, ruled)
    allow_on_red(
        ruled,
        found,
        node_tags,
        around.driving_side,
        usual=country.turn_on_red,
        forbidden=not_on_red,
    )
    walks = walk_groups(groups, crossings, around)
    line_of = {line.lane_id: line for line in lines}
    heads = signal_heads(list(chain(*groups.values())), line_of, around)
    known = {node for approach in found for node in approach.signal_nodes}.union(junction_lights)
    red_amber_s = country.red_amber_s
    lone = lone_lights(around, node_tags, lanes, crossings, known, red_amber_s=red_amber_s)
    systems = signal_systems(groups, around)
    own = signal_plans(groups, walks, conflicts, met, systems, red_amber_s=red_amber_s)
    plans, lone = with_ring_exits(own, lone, around)
    return TrafficControl(
        # Where a lane has two lines the one at the junction stands last, so that it wins by lane.
        stop_lines=(*lone.stop_lines, *lines, *lines_at_signs(connections, signs)),
        signals=(*heads, *lone.signals),
        conflicts=conflicts,
        plans=plans,
        crossing_plans=lone.plans,
    )


def _control(
    connections: Sequence[ConnectionDraft],
    found: Sequence[Approach],
    lines: Sequence[StopLine],
    signs: SignsInside,
    node_tags: NodeTags,
    around: Surroundings,
) -> None:
    """Tell connections what controls them: their lane's line, or a sign on a slip road.

    A slip road to the near side that passes no light of its own is not under the junction's.
    Elsewhere a sign farther in counts where the lane has neither a light nor a tagged sign.
    """
    controls = line_controls(lines)
    near = "right" if around.driving_side == "right" else "left"
    by_road = {approach.key: approach for approach in found}
    for c in connections:
        c.control = controls.get(c.start.id, "none")
        approach = by_road.get(c.movement.toward.key)
        if approach is None or not c.movement.inside:
            continue
        sign = next((sign.rule for sign in signs.get(c.id, ())), None)
        own = approach.control
        if c.turn == near:
            slips = not lights_inside(c.movement.inside, node_tags)
        else:
            slips = own.value == "none" or (own.value != "signal" and own.source != "tagged")
        if slips and sign is not None:
            c.control = "stop" if sign == "stop" else "give_way"
        elif slips and c.turn == near and approach.lit_inside:
            c.control = "give_way"
