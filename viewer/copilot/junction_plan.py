"""A World as the display draws it: lines and areas in the drive's frame, to decimetres."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame, target_from_source_m
from foretwin.contracts.world import World
from foretwin.geometry.polyline import offset

REACH_M = 130.0
"""What lies farther from the junction is not drawn; the display looks ahead 110 m at most."""
_LIMITS_M = REACH_M + 20.0

Points = list[list[float]]


class SignalHead(msgspec.Struct, frozen=True, kw_only=True):
    """Where a light stands, and its group, by which its live colour is known."""

    at: list[float]
    group: str


class JunctionPlan(msgspec.Struct, frozen=True, kw_only=True):
    """What is drawn of a World, each line or ring a list of x, y in metres of the drive's frame.

    `crossings` are [from kerb, to kerb, width]; `priority` are paths of those whom the car has to
    let go first, as far as they are known.
    """

    world_id: str
    junction_id: str
    centre: list[float]
    surface: list[list[Points]]
    junction: list[Points]
    islands: list[Points]
    buildings: list[Points]
    kerbs: list[Points]
    edges: list[Points]
    stop_lines: list[Points]
    crossings: list[list[Any]]
    signals: list[SignalHead]
    attribution: str


def junction_plan(world: World, drive_frame: LocalFrame) -> JunctionPlan:
    """Return the plan of a World."""
    move = _PlanMover(world.frame, drive_frame)
    edges = [
        offset(lane.centerline, side * lane.width_m.value / 2.0)
        for lane in world.lanes
        if lane.kind in ("driving", "bus", "tram")
        for side in (1.0, -1.0)
    ]
    areas = [place.area for place in world.junctions[:1] if place.area is not None]
    return JunctionPlan(
        world_id=world.id,
        junction_id=world.intersection.id,
        centre=move.points(np.zeros((1, 2)))[0],
        surface=[
            move.lines([area.outline, *area.holes])
            for area in world.road_surface
            if _near(area.outline)
        ],
        junction=move.lines([area.outline for area in areas]),
        islands=move.lines(_nearby(one.outline for one in world.islands)),
        buildings=move.lines(_nearby(one.outline for one in world.buildings)),
        kerbs=move.lines(_nearby(world.kerbs)),
        edges=move.lines(_nearby(edges)),
        stop_lines=move.lines(_nearby(one.ends for one in world.stop_lines)),
        crossings=[
            [*move.points(one.line), round(one.width_m.value, 1)]
            for one in world.crossings
            if _near(one.line)
        ],
        signals=[
            SignalHead(at=move.points(one.position[None, :2])[0], group=one.group_id)
            for one in world.signals
            if _near(one.position[None, :2])
        ],
        attribution=world.attribution,
    )


def _near(line_m: Array) -> bool:
    return bool((np.abs(np.asarray(line_m)) < _LIMITS_M).all(axis=1).any())


def _nearby(lines: Iterable[Array]) -> list[Array]:
    return [line for line in lines if _near(line)]


class _PlanMover:
    """Moves points of a World into the drive's frame, rounded."""

    def __init__(self, source: LocalFrame, target: LocalFrame) -> None:
        self._source, self._target = source, target

    def points(self, line_m: Array) -> Points:
        return self.lines([line_m])[0]

    def lines(self, lines: Sequence[Array]) -> list[Points]:
        if not lines:
            return []
        every = np.concatenate([np.asarray(line, dtype=np.float64) for line in lines])
        moved = target_from_source_m(self._target, self._source, every)
        cuts = np.cumsum([len(line) for line in lines])[:-1]
        return [one.round(1).tolist() for one in np.split(moved, cuts)]
