"""Roads as OpenDRIVE knows them: a reference line and lanes with signed numbers beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import DrivingSide, Lane, Road, World
from foretwin.world_gen.export.opendrive_curve import Curve, fit_curve
from foretwin.world_gen.export.opendrive_heights import heights_of, node_of
from foretwin.world_gen.export.opendrive_sidewalks import Sidewalk

GAP_M = 0.01
"""Lanes farther apart than this have a strip without traffic between them."""


class Cubic(NamedTuple):
    """a + b s + c s² + d s³, as widths and offsets are written."""

    a: float
    b: float = 0.0
    c: float = 0.0
    d: float = 0.0

    @staticmethod
    def between(start: float, end: float, length_m: float) -> Cubic:
        """Return the change from `start` to `end` that is level at both ends."""
        rise = end - start
        if abs(rise) < 1e-9:
            return Cubic(start)
        return Cubic(start, 0.0, 3.0 * rise / length_m**2, -2.0 * rise / length_m**3)

    def at(self, s_m: float) -> float:
        """Return the value at arc length `s_m`."""
        return self.a + s_m * (self.b + s_m * (self.c + s_m * self.d))


class Pose(NamedTuple):
    """A point (2,) and the unit direction (2,) in which it is driven."""

    point: Array
    heading: Array


class End(NamedTuple):
    """One end of a road."""

    road: OdrRoad
    at_end: bool


@dataclass(slots=True, kw_only=True)
class OdrLane:
    """A lane of an OpenDRIVE road; `number` is positive to the left of lane 0.

    `lane` is None for a strip that is not driven on, which is a `sidewalk` or nothing.
    """

    number: int
    width: Cubic
    lane: Lane | None
    reversed: bool = False
    """Driven against what its side of the road says."""
    predecessor: int | None = None
    successor: int | None = None
    sidewalk: bool = False


@dataclass(slots=True, kw_only=True)
class OdrRoad:
    """A road of the file; `lanes` stand from left to right, without lane 0."""

    id: int
    name: str
    source: str
    """The id of the World's road or connection, or of the place it bridges."""
    curve: Curve
    offset: Cubic
    lanes: list[OdrLane]
    road_class: str
    height: Cubic
    junction: int = -1
    predecessor: tuple[Literal["road", "junction"], int, bool] | None = None
    """What it is linked to before its start, its id, and, for a road, whether at its end."""
    successor: tuple[Literal["road", "junction"], int, bool] | None = None
    road: Road | None = None
    numbers: dict[str, int] = field(default_factory=dict)
    """The number of each of the World's lanes."""

    def link(self, *, at_end: bool, to: tuple[Literal["road", "junction"], int, bool]) -> None:
        """Say what follows after one end."""
        if at_end:
            self.successor = to
        else:
            self.predecessor = to

    def lane_numbered(self, number: int) -> OdrLane:
        """Return the lane with this number."""
        return next(lane for lane in self.lanes if lane.number == number)

    def edge_m(self, number: int, *, at_end: bool) -> float:
        """Return how far a lane's outer edge, or lane 0, lies to the left of the reference line."""
        s = self.curve.length_m if at_end else 0.0
        left = self.offset.at(s)
        step = 1 if number > 0 else -1
        for lane in self.lanes:
            if 0 < lane.number * step <= number * step:
                left += step * lane.width.at(s)
        return left

    def end_of(self, lane: Lane, *, at_end: bool) -> Pose:
        """Return where one of the World's lanes ends at an end of the road, as it is driven."""
        number = self.numbers[lane.id]
        inner = number - (1 if number > 0 else -1)
        left = (self.edge_m(number, at_end=at_end) + self.edge_m(inner, at_end=at_end)) / 2.0
        point, direction = self.curve.end(at_end=at_end)
        aside = left * np.array([-direction[1], direction[0]])
        return Pose(point + aside, -direction if lane.reverse else direction)


def roads_of(
    world: World,
    lanes: Mapping[str, Lane],
    headings: Mapping[tuple[str, bool], Array],
    sidewalks: Mapping[str, Sequence[Sidewalk]],
) -> list[OdrRoad]:
    """Return the World's roads, numbered from 1.

    `headings` holds the unit direction (2,) along the reference line that a road must have at
    its start or, True, its end, where it is joined to another; elsewhere its own line decides.
    `sidewalks` are by road.
    Roads without lanes are left out.
    """
    side = world.intersection.driving_side
    heights = heights_of(world.roads)
    found: list[OdrRoad] = []
    for road in world.roads:
        mine = [lanes[i] for i in road.lane_ids if i in lanes]
        if not mine:
            continue
        curve = fit_curve(
            road.reference_line,
            start=headings.get((road.id, False)),
            end=headings.get((road.id, True)),
        )
        strips, centre_m = _strips(mine, side)
        strips = _with_sidewalks(strips, centre_m, road, sidewalks.get(road.id, ()))
        found.append(
            OdrRoad(
                id=len(found) + 1,
                name=road.name,
                source=road.id,
                curve=curve,
                offset=Cubic(centre_m),
                lanes=strips,
                road_class=road.road_class,
                height=Cubic.between(
                    heights[node_of(road, at_end=False)],
                    heights[node_of(road, at_end=True)],
                    curve.length_m,
                ),
                road=road,
                numbers={s.lane.id: s.number for s in strips if s.lane is not None},
            )
        )
    return found


def runs_along(number: int, side: DrivingSide) -> bool:
    """Return whether a lane of this number is driven along the reference line."""
    return (number < 0) == (side == "right")


def _strips(lanes: Sequence[Lane], side: DrivingSide) -> tuple[list[OdrLane], float]:
    """Return lanes and gaps from left to right, and where lane 0 lies to the left of the line."""
    ordered = sorted(lanes, key=lambda lane: -lane.left_of_reference_m)
    centre = _lane_zero(ordered, side)
    edges = [
        (
            lane.left_of_reference_m + lane.width_m.value / 2.0,
            lane.left_of_reference_m - lane.width_m.value / 2.0,
        )
        for lane in ordered
    ]
    left: list[tuple[Lane | None, float]] = []
    right: list[tuple[Lane | None, float]] = []
    zero_m = edges[centre - 1][1] if centre else edges[0][0]
    at = zero_m
    for lane, (_, outer) in zip(ordered[centre:], edges[centre:], strict=True):
        at = _add(right, lane, at, outer, lane.width_m.value)
    at = -zero_m
    for lane, (outer, _) in zip(ordered[:centre][::-1], edges[:centre][::-1], strict=True):
        at = _add(left, lane, at, -outer, lane.width_m.value)
    numbered = [(len(left) - i, strip) for i, strip in enumerate(reversed(left))]
    numbered += [(-1 - i, strip) for i, strip in enumerate(right)]
    return [
        OdrLane(
            number=number,
            width=Cubic(width),
            lane=lane,
            reversed=lane is not None and lane.reverse == runs_along(number, side),
        )
        for number, (lane, width) in numbered
    ], zero_m


def _with_sidewalks(
    strips: list[OdrLane], centre_m: float, road: Road, sidewalks: Sequence[Sidewalk]
) -> list[OdrLane]:
    """Add sidewalks at the outer edges, and what lies between them and the outermost lane."""
    found = list(strips)
    for sidewalk in sidewalks:
        step = 1 if sidewalk.left else -1
        mine = [strip for strip in strips if strip.number * step > 0]
        outer = centre_m + step * sum(strip.width.a for strip in mine)
        gap = step * ((road.left_m if sidewalk.left else road.right_m) - outer)
        more = [OdrLane(number=0, width=Cubic(sidewalk.width_m), lane=None, sidewalk=True)]
        if gap > GAP_M:
            more.insert(0, OdrLane(number=0, width=Cubic(gap), lane=None))
        for i, strip in enumerate(more, start=len(mine) + 1):
            strip.number = i * step
        found = [*reversed(more), *found] if sidewalk.left else [*found, *more]
    return found


def _add(
    strips: list[tuple[Lane | None, float]], lane: Lane, at: float, outer: float, width: float
) -> float:
    """Add a lane outward (downwards) of `at`, after a strip for a gap; return where it ends."""
    gap = at - (outer + width)
    if gap > GAP_M:
        strips.append((None, gap))
        at -= gap
    strips.append((lane, width))
    return at - width


def _lane_zero(ordered: Sequence[Lane], side: DrivingSide) -> int:
    """Return before which lane from the left lane 0 stands, so that fewest run against their side.

    Right of lane 0 lanes run along the reference line where traffic keeps right.
    """
    against = np.array([lane.reverse == (side == "right") for lane in ordered])
    wrong = [int((~against[:i]).sum() + against[i:].sum()) for i in range(len(ordered) + 1)]
    return int(np.argmin(wrong))
