"""Roads as OpenDRIVE has them: a reference line and lanes with signed numbers beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import DrivingSide, Lane, Road, World
from foretwin.geometry.polyline import left_of
from foretwin.geometry.world_heights import WorldHeights, heights_of
from foretwin.world_gen.export.opendrive_cubics import Cubic, Rise
from foretwin.world_gen.export.opendrive_curve import Curve, fit_curve
from foretwin.world_gen.export.opendrive_sidewalks import Sidewalk
from foretwin.world_gen.export.road_heights import Node, layer_heights, node_of

GAP_M = 0.01
"""Lanes farther apart than this have a strip without traffic between them."""


Link = tuple[Literal["road", "junction"], int, bool]


class Pose(NamedTuple):
    """A point (2,) and the unit direction (2,) in which it is driven."""

    point: Array
    heading: Array


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
    height: Rise
    junction: int = -1
    predecessor: Link | None = None
    """What it is linked to before its start, its id, and, for a road, whether at its end."""
    successor: Link | None = None
    road: Road | None = None
    numbers: dict[str, int] = field(default_factory=dict)
    """The number of each of the World's lanes."""


class End(NamedTuple):
    """One end of a road."""

    road: OdrRoad
    at_end: bool

    @property
    def s_m(self) -> float:
        """Arc length of the reference line here."""
        return self.road.curve.length_m if self.at_end else 0.0

    @property
    def height_m(self) -> float:
        """Height of the road here."""
        return self.road.height.at(self.s_m)

    @property
    def grade_out(self) -> float:
        """How the road climbs here towards its end."""
        grade = self.road.height.slope_at(self.s_m)
        return grade if self.at_end else -grade

    def link(self, kind: Literal["road", "junction"], number: int, *, at_end: bool = False) -> None:
        """Say what follows after this end: a junction, or a road from its start or its end."""
        if self.at_end:
            self.road.successor = (kind, number, at_end)
        else:
            self.road.predecessor = (kind, number, at_end)

    def link_lane(self, number: int, following: int) -> None:
        """Say which lane follows after a lane of the road, both by number."""
        lane = next(lane for lane in self.road.lanes if lane.number == number)
        if self.at_end:
            lane.successor = following
        else:
            lane.predecessor = following

    def edge_m(self, number: int) -> float:
        """Return how far a lane's outer edge, or lane 0, lies to the left of the reference line."""
        left = self.road.offset.at(self.s_m)
        step = 1 if number > 0 else -1
        for lane in self.road.lanes:
            if 0 < lane.number * step <= number * step:
                left += step * lane.width.at(self.s_m)
        return left

    def lane_end(self, lane: Lane) -> Pose:
        """Return where one of the World's lanes ends here, as it is driven."""
        number = self.road.numbers[lane.id]
        left = (self.edge_m(number) + self.edge_m(inward(number))) / 2.0
        point, direction = self.road.curve.end(at_end=self.at_end)
        return Pose(point + left * left_of(direction), -direction if lane.reverse else direction)


def inward(number: int) -> int:
    """Return the number of the lane on the inner side of a lane; it may be lane 0."""
    return number - (1 if number > 0 else -1)


def roads_of(
    world: World,
    lanes: Mapping[str, Lane],
    headings: Mapping[tuple[str, bool], Array],
    sidewalks: Mapping[str, Sequence[Sidewalk]],
    side: DrivingSide,
) -> list[OdrRoad]:
    """Return the World's roads, numbered from 1.

    `headings` holds the unit direction (2,) along the reference line that a road must have at
    its start or, True, its end, where it is joined to another; elsewhere its own line decides.
    `sidewalks` are by road, `side` is the rule by which lanes are numbered.
    Roads without lanes are left out.
    """
    heights, hills = layer_heights(world.roads), heights_of(world)
    found: list[OdrRoad] = []
    for road in world.roads:
        mine = [lanes[i] for i in road.lane_ids if i in lanes]
        if not mine:
            continue
        start, end = headings.get((road.id, False)), headings.get((road.id, True))
        curve = fit_curve(road.reference_line, start=start, end=end)
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
                height=_rise(road, heights, hills, curve.length_m),
                road=road,
                numbers={s.lane.id: s.number for s in strips if s.lane is not None},
            )
        )
    return found


def _rise(
    road: Road, layers: Mapping[Node, float], hills: WorldHeights | None, length_m: float
) -> Rise:
    """Return a road's heights: the hills', else those of the layers at its ends."""
    if hills is None:
        ends = layers[node_of(road, at_end=False)], layers[node_of(road, at_end=True)]
        return Rise.between(*ends, length_m)
    profile = hills.road(road.id)
    if profile is not None:
        return Rise.of(profile, length_m)
    # A track of trams alone lies on the ground.
    start, end = hills.surface_at(road.reference_line[[0, -1]]).tolist()
    return Rise.between(start, end, length_m)


def runs_along(number: int, side: DrivingSide) -> bool:
    """Return whether a lane of this number is driven along the reference line."""
    return (number < 0) == (side == "right")


def _strips(lanes: Sequence[Lane], side: DrivingSide) -> tuple[list[OdrLane], float]:
    """Return lanes and gaps from left to right, and where lane 0 lies to the left of the line."""
    ordered = sorted(lanes, key=lambda lane: -lane.left_of_reference_m)
    centre = _lane_zero(ordered, side)
    beside, step = (ordered[centre - 1], -1) if centre else (ordered[0], 1)
    zero_m = beside.left_of_reference_m + step * beside.width_m.value / 2.0
    left = _outward(ordered[:centre][::-1], 1, zero_m, side)
    right = _outward(ordered[centre:], -1, zero_m, side)
    return [*left[::-1], *right], zero_m


def _outward(
    lanes: Sequence[Lane], step: Literal[1, -1], zero_m: float, side: DrivingSide
) -> list[OdrLane]:
    """Return lanes to one side of lane 0, numbered outward by `step`, and the gaps before them."""
    found: list[OdrLane] = []
    at = -step * zero_m
    for lane in lanes:
        width = lane.width_m.value
        gap = at - (-step * lane.left_of_reference_m - width / 2.0 + width)
        if gap > GAP_M:
            found.append(OdrLane(number=step * (len(found) + 1), width=Cubic(gap), lane=None))
            at -= gap
        number = step * (len(found) + 1)
        against = lane.reverse == runs_along(number, side)
        found.append(OdrLane(number=number, width=Cubic(width), lane=lane, reversed=against))
        at -= width
    return found


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
        widths = [gap, sidewalk.width_m] if gap > GAP_M else [sidewalk.width_m]
        more = [
            OdrLane(number=i * step, width=Cubic(width), lane=None)
            for i, width in enumerate(widths, start=len(mine) + 1)
        ]
        more[-1].sidewalk = True
        found = [*reversed(more), *found] if sidewalk.left else [*found, *more]
    return found


def _lane_zero(ordered: Sequence[Lane], side: DrivingSide) -> int:
    """Return before which lane from the left lane 0 stands, so that fewest run against their side.

    Right of lane 0 lanes run along the reference line where traffic keeps right.
    """
    against = np.array([lane.reverse == (side == "right") for lane in ordered])
    wrong = [int((~against[:i]).sum() + against[i:].sum()) for i in range(len(ordered) + 1)]
    return int(np.argmin(wrong))
