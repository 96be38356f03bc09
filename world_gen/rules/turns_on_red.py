"""Which turns may go on red after a stop: by the country's rule, signs and arrows."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from foretwin.contracts.world import DrivingSide
from foretwin.world_gen.connections.lane_connections import ConnectionDraft
from foretwin.world_gen.lanes.stopping import NodeTags
from foretwin.world_gen.rules.approaches import Approach


def allow_on_red(
    connections: Sequence[ConnectionDraft],
    found: Sequence[Approach],
    node_tags: NodeTags,
    near_side: DrivingSide,
    *,
    usual: bool,
    forbidden: Collection[tuple[int, int]],
) -> None:
    """Enter into signalled turns to the near side whether red lets them go after a stop.

    `usual` is the country's rule; a light tagged `red_turn:right` (or left), or `red_turn`, says
    otherwise, and so do restrictions such as `no_right_turn_on_red` between the ways `forbidden`.
    """
    by_road = {approach.key: approach for approach in found}
    for c in connections:
        approach = by_road.get(c.movement.toward.key)
        if c.turn != near_side or c.signal_group_id is None or approach is None:
            continue
        tags = [node_tags.get(node, {}) for node in approach.signal_nodes]
        keys = (f"red_turn:{near_side}", "red_turn")
        said = next((tag[key] for tag in tags for key in keys if key in tag), None)
        ways = c.movement.toward.ways[-1], c.movement.away.ways[0]
        c.red_after_stop = (usual if said is None else said == "yes") and ways not in forbidden
