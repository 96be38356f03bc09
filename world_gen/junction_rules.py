"""Stop lines, lights and right of way of all junctions that lie whole in a World."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from contracts.world import Conflict, Signal, SignalPlan, StopLine
from world_gen.approaches import approaches
from world_gen.clusters import Surroundings
from world_gen.connections import ConnectionDraft
from world_gen.lanes import LaneSet
from world_gen.met_on_the_way import NodeTags
from world_gen.right_of_way import right_of_way
from world_gen.stop_lines import line_controls, signals, stop_lines


class JunctionRules(NamedTuple):
    """What tells drivers when to go; `plans` by junction id."""

    stop_lines: tuple[StopLine, ...]
    signals: tuple[Signal, ...]
    conflicts: tuple[Conflict, ...]
    plans: Mapping[str, SignalPlan]


def junction_rules(
    around: Surroundings,
    node_tags: NodeTags,
    lanes: LaneSet,
    connections: Sequence[ConnectionDraft],
) -> JunctionRules:
    """Return the rules of every whole junction; connections learn their control and conflicts."""
    found = approaches(around, node_tags, connections)
    lines = stop_lines(found, around, lanes)
    controls = line_controls(lines)
    for connection in connections:
        connection.control = controls.get(connection.start.id, "none")
    whole = {id(junction) for junction in around.junctions}
    ruled = [c for c in connections if id(c.cluster.junction) in whole]
    conflicts, _ = right_of_way(ruled, found, node_tags, around.driving_side)
    return JunctionRules(lines, signals(found, lines, around, lanes), conflicts, {})
