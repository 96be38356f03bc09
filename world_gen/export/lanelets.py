"""What Lanelet2 and CommonRoad, whose maps are both made of lanelets, say alike."""

from __future__ import annotations

from collections.abc import Mapping

from foretwin.contracts.world import Connection, Crossing, DrivingSide, Lane, Turn
from foretwin.geometry.polyline import left_of, unit
from foretwin.world_gen.export.lane_borders import Borders

URBAN_MPS = 60.0 / 3.6
"""Roads on which one may drive faster count as outside towns."""


def narrower_lane(connection: Connection, lanes: Mapping[str, Lane]) -> Lane:
    """Return of the lanes that a connection joins the one that fewer may use."""
    start, end = lanes[connection.from_lane_id], lanes[connection.to_lane_id]
    return end if start.kind == "driving" else start


def indicated(turn: Turn, side: DrivingSide) -> Turn:
    """Return the turn as it is indicated: neither format knows U-turns, which lead across."""
    across: Turn = "left" if side == "right" else "right"
    return across if turn == "u_turn" else turn


def crosswalk_edges(crossing: Crossing) -> Borders:
    """Return both edges (2, 2) of the stripe on which pedestrians cross, in its direction."""
    start, end = crossing.line
    aside = left_of(unit(end - start)) * (crossing.width_m.value / 2)
    return Borders(crossing.line + aside, crossing.line - aside)


def is_marked(crossing: Crossing) -> bool:
    """Return whether the edges of a crossing are painted."""
    return crossing.kind.value not in ("unmarked", "no")
