"""Sidewalks that run along a road as lanes of it; all others stay outlines."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import Area, Road, World
from foretwin.geometry.polyline import left_of, length, points_at, units

_BESIDE = re.compile(r"sidewalk:(?P<road>.+):(?P<side>left|right)(?:-\d+)?")
"""How the World names a sidewalk that belongs to a road, and the pieces that it is cut into."""
COVERED = 0.7
"""Share of a road's length along which a sidewalk must run to be a lane of it."""
_STEP_M = 0.05
_WIDEST_M = 6.0


class Sidewalk(NamedTuple):
    """A sidewalk along one side of a road, seen along its reference line, from its edge on."""

    left: bool
    width_m: float


class Sidewalks(NamedTuple):
    """Sidewalks by road, and those areas that are no part of any of them."""

    beside: Mapping[str, tuple[Sidewalk, ...]]
    others: tuple[Area, ...]


def sidewalks_of(world: World) -> Sidewalks:
    """Return which of the World's sidewalks are lanes of a road."""
    roads = {road.id: road for road in world.roads}
    pieces: dict[tuple[str, bool], list[Area]] = {}
    others: list[Area] = []
    for area in world.sidewalks:
        name = _BESIDE.fullmatch(area.id)
        if name is None or name["road"] not in roads:
            others.append(area)
        else:
            pieces.setdefault((name["road"], name["side"] == "left"), []).append(area)
    beside: dict[str, tuple[Sidewalk, ...]] = {}
    for (road, left), areas in pieces.items():
        width = _width_m(roads[road], left, areas)
        if width is None:
            others.extend(areas)
        else:
            beside[road] = (*beside.get(road, ()), Sidewalk(left, width))
    return Sidewalks(beside, tuple(others))


def _width_m(road: Road, left: bool, areas: list[Area]) -> float | None:
    """Return the width, to 0.1 m, that areas mostly have along a road; None where they lack."""
    line = road.reference_line
    total = length(line)
    at = total * (np.arange(20) + 0.5) / 20
    ahead = points_at(line, np.minimum(at + 0.1, total)) - points_at(line, np.maximum(at - 0.1, 0))
    out = left_of(units(ahead)) * (1.0 if left else -1.0)
    edge = points_at(line, at) + out * (road.left_m if left else -road.right_m)
    steps = np.arange(_STEP_M / 2.0, _WIDEST_M, _STEP_M)
    across: Array = edge[:, None] + out[:, None] * steps[None, :, None]
    ground = shapely.union_all([shapely.Polygon(a.outline, a.holes) for a in areas])
    shapely.prepare(ground)
    on_it = shapely.contains_xy(ground, across[..., 0], across[..., 1])
    widths = on_it.sum(axis=1) * _STEP_M
    there = widths > 0.5
    return round(float(np.median(widths[there])), 1) if there.mean() >= COVERED else None
