"""Worlds drawn by hand, without a map: roads of given lanes, and connections between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.contracts.provenance import Choice, Quantity
from foretwin.contracts.world import (
    Connection,
    Crossing,
    IntersectionSummary,
    Lane,
    Road,
    World,
)

NOWHERE = IntersectionSummary(
    id="drawn",
    kind="crossing",
    lat=52.0,
    lon=10.0,
    arms=4,
    control="uncontrolled",
    driving_side="right",
    osm_nodes=(),
)
ZEBRA = Crossing(
    id="x",
    line=np.array([[20.0, -3.0], [20.0, 3.0]]),
    width_m=Quantity(4.0, "default"),
    kind=Choice("zebra", "tagged"),
)
NOTHING_ELSE: dict[str, Any] = dict.fromkeys(
    ("stop_lines", "crossings", "signals", "islands", "kerbs", "road_surface", "buildings"), ()
)


def road(
    name: str,
    line: Sequence[Sequence[float]] | Array,
    *,
    ahead: Sequence[float],
    against: Sequence[float] = (),
    **more: Any,
) -> tuple[Road, list[Lane]]:
    """Return a road and its lanes of given widths, from the reference line outward.

    Traffic keeps right: lanes along the line lie to its right, those against it to its left.
    """
    points = np.asarray(line, dtype=np.float64)
    lanes = [
        *_lanes(name, points, against, reverse=True, more=more)[::-1],
        *_lanes(name, points, ahead, reverse=False, more=more),
    ]
    drawn = Road(
        id=name,
        osm_way=1,
        name="",
        road_class="secondary",
        reference_line=points,
        left_m=float(sum(against)),
        right_m=-float(sum(ahead)),
        lane_ids=tuple(lane.id for lane in lanes),
        layer=more.get("layer", 0),
    )
    return drawn, lanes


def _lanes(
    name: str, points: Array, widths: Sequence[float], *, reverse: bool, more: dict[str, Any]
) -> list[Lane]:
    side = "b" if reverse else "f"
    found = []
    gone = 0.0
    for i, width in enumerate(widths):
        middle = (gone + width / 2) * (1 if reverse else -1)
        gone += width
        found.append(
            Lane(
                id=f"{name}.{side}{i}",
                osm_way=1,
                name="",
                kind="driving",
                # Near enough to the middle: what is tested reads the road's reference line.
                centerline=points[::-1] if reverse else points,
                width_m=Quantity(width, "tagged"),
                speed_limit_mps=Quantity(50 / 3.6, "tagged"),
                role="other",
                road_id=name,
                reverse=reverse,
                left_of_reference_m=middle,
                left_id=f"{name}.{side}{i - 1}" if i else None,
                right_id=f"{name}.{side}{i + 1}" if i + 1 < len(widths) else None,
            )
        )
    return [msgspec.structs.replace(lane, **more) for lane in found]


def world(
    *roads: tuple[Road, list[Lane]], connections: Sequence[Connection] = (), **more: Any
) -> World:
    """Return a World of these roads and connections and nothing else."""
    return World(
        id="0123456789abcdef",
        intersection=NOWHERE,
        frame=LocalFrame(GeoPoint(52.0, 10.0)),
        radius_m=150.0,
        map_sha256="",
        roads=tuple(r for r, _ in roads),
        lanes=tuple(lane for _, lanes in roads for lane in lanes),
        connections=tuple(connections),
        **(NOTHING_ELSE | more),
    )


def leading_to(lanes: list[Lane], successors: dict[str, str]) -> list[Lane]:
    """Return the lanes with those by name leading straight into others."""
    return [
        msgspec.structs.replace(lane, successor_ids=(successors[lane.id],))
        if lane.id in successors
        else lane
        for lane in lanes
    ]


def connection(start: str, end: str, line: Array, **more: Any) -> Connection:
    """Return a connection along a line."""
    fields: dict[str, Any] = {
        "turn": "straight",
        "width_m": Quantity(3.0, "inferred"),
        "junction_id": "drawn",
        **more,
    }
    return Connection(
        id=f"{start}>{end}", from_lane_id=start, to_lane_id=end, centerline=line, **fields
    )
