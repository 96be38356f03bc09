"""Signals, stop and give-way signs beside the roads of an OpenDRIVE file, and their controllers."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.signals import Signal
from foretwin.contracts.world import DrivingSide, Lane, StopLine, World
from foretwin.world_gen.export.choices import OpenDriveVersion
from foretwin.world_gen.export.opendrive_places import OdrNetwork
from foretwin.world_gen.export.opendrive_roads import OdrRoad
from foretwin.world_gen.export.stop_line_lanes import StopLineLanes
from foretwin.world_gen.export.xml_tree import Element, child, element

SIGN_BESIDE_M = 0.6
SIGN_HEIGHT_M = 2.65
"""Middle of a sign, whose lower edge is 2.20 m high (VwV-StVO on §§ 39 to 43)."""
SIGN_M = (0.9, 0.9)
"""Width and height of a sign (VzKat 2017, size 2)."""
LIGHT_M = (0.3, 0.9)
"""Width and height of three lights of 200 mm above each other."""
_SIGNS = {"stop": ("206", "stop"), "give_way": ("205", "yield")}
"""Type in Germany's catalogue of signs and meaning of the signs at stop lines by their control."""


_Ruled = tuple[OdrRoad, bool, list[int]]
"""The first three fields of a `_Post`."""


class Controller(NamedTuple):
    """Signals that change together, and the junctions that they lead into."""

    id: int
    junctions: frozenset[int]
    element: Element


class _Post(NamedTuple):
    """A signal head or sign as the file has it, facing `yaw_rad` at `position` (3,).

    It is for lanes of one road, by number, which run `along` its reference line or against it.
    """

    road: OdrRoad
    along: bool
    numbers: list[int]
    name: str
    type: str
    country: str
    meaning: str
    dynamic: str
    size_m: tuple[float, float]
    position: Array
    yaw_rad: float
    group: str | None = None


def add_signals(
    world: World, network: OdrNetwork, elements: Mapping[int, Element], version: OpenDriveVersion
) -> list[Controller]:
    """Add `<signals>` to the roads' `elements`, which are by id, and return their controllers."""
    lanes = {lane.id: lane for lane in world.lanes}
    groups: dict[str, list[int]] = {}
    posts = [*_lights(world, network, lanes), *_signs(world, network, lanes)]
    for own, post in enumerate(posts, start=1):
        _add(elements[post.road.id], own, post, version)
        if post.group is not None:
            groups.setdefault(post.group, []).append(own)
    leads_into = _leads_into(world.signals, network)
    return [
        Controller(i, leads_into[name], _controller(i, name, members))
        for i, (name, members) in enumerate(groups.items(), start=1)
    ]


def _lights(world: World, network: OdrNetwork, lanes: Mapping[str, Lane]) -> Iterator[_Post]:
    """Yield every head once for each road whose lanes obey it."""
    kind, country, meaning = "1000001", "OpenDRIVE", "trafficLight"
    lines = StopLineLanes(world)
    for head in world.signals:
        by_road: dict[int, list[str]] = defaultdict(list)
        for lane_id in dict.fromkeys(lines.of_head(head, name) for name in head.lane_ids):
            if lane_id in network.road_of:
                by_road[network.road_of[lane_id].id].append(lane_id)
        for mine in by_road.values():
            ruled = _ruled(network, lanes, mine)
            at, yaw_rad = head.position, head.yaw_rad
            post = _Post(*ruled, head.id, kind, country, meaning, "yes", LIGHT_M, at, yaw_rad)
            yield post._replace(group=head.group_id)


def _signs(world: World, network: OdrNetwork, lanes: Mapping[str, Lane]) -> Iterator[_Post]:
    """Yield the signs at stop lines, one for those of one road and direction."""
    together: dict[tuple[int, bool, str], list[StopLine]] = defaultdict(list)
    inside = []
    side = world.intersection.driving_side
    places = StopLineLanes(world)
    for line in world.stop_lines:
        if line.control.value not in _SIGNS:
            continue
        across = places.across(line)
        if across in network.road_of:
            road_id = network.road_of[across].id
            together[road_id, lanes[across].reverse, line.control.value].append(line)
        elif across in network.connecting:
            inside.append(line)
    for lines in together.values():
        yield _sign(lines, side, _ruled(network, lanes, [places.across(line) for line in lines]))
    for line in inside:
        # A connecting road runs as it is driven, and has one lane.
        road = network.connecting[line.across_id]
        yield _sign([line], side, (road, True, [road.lanes[0].number]))


def _ruled(network: OdrNetwork, lanes: Mapping[str, Lane], lane_ids: Sequence[str]) -> _Ruled:
    road = network.road_of[lane_ids[0]]
    return road, not lanes[lane_ids[0]].reverse, [road.numbers[i] for i in lane_ids]


def _sign(lines: Sequence[StopLine], side: DrivingSide, ruled: _Ruled) -> _Post:
    kind, meaning = _SIGNS[lines[0].control.value]
    # Germany's signs stand for the Vienna convention's, which left-hand countries may not share.
    country = "DE" if side == "right" else "OpenDRIVE"
    place, yaw_rad = _beside(lines, kerb=1 if side == "right" else 0)
    return _Post(*ruled, lines[0].id, kind, country, meaning, "no", SIGN_M, place, yaw_rad)


def _beside(lines: Sequence[StopLine], *, kerb: int) -> tuple[Array, float]:
    """Return where a sign stands, at the end `kerb` of the lines, and where it faces."""
    across = lines[0].ends[0] - lines[0].ends[1]
    across /= max(math.hypot(*across), 1e-6)
    outward = across * (1.0 if kerb == 0 else -1.0)
    ends = np.array([line.ends[kerb] for line in lines])
    at = ends[int(np.argmax(ends @ outward))] + outward * SIGN_BESIDE_M
    # `across` points to the driver's left, a quarter turn counter-clockwise of the direction.
    facing = math.atan2(-across[0], across[1])
    return np.array([at[0], at[1], SIGN_HEIGHT_M]), facing + math.pi


def _leads_into(heads: Iterable[Signal], network: OdrNetwork) -> dict[str, frozenset[int]]:
    """Return for each group the junctions that the lanes of its heads lead into."""
    junction_of = {
        item.connection.from_lane_id: junction.id
        for junction in network.junctions
        for item in junction.connections
    }
    found: dict[str, frozenset[int]] = defaultdict(frozenset)
    for head in heads:
        found[head.group_id] |= {junction_of[i] for i in head.lane_ids if i in junction_of}
    return found


def _add(made: Element, own: int, post: _Post, version: OpenDriveVersion) -> None:
    signals = made.find("signals")
    if signals is None:
        signals = child(made, "signals")
    s, t = post.road.curve.locate(post.position[:2])
    _, direction = post.road.curve.at(s)
    heading = math.atan2(direction[0, 1], direction[0, 0])
    usual = heading + math.pi if post.along else heading
    width_m, height_m = post.size_m
    item = child(
        signals,
        "signal",
        name=post.name,
        s=s[0],
        t=t[0],
        dynamic=post.dynamic,
        orientation="+" if post.along else "-",
        # The file has the lower edge, the World the middle.
        zOffset=float(post.position[2]) - height_m / 2.0,
        width=width_m,
        height=height_m,
        country=post.country,
        type=post.type,
        subtype=-1,
        hOffset=float(wrap_angle(post.yaw_rad - usual)),
        id=own,
    )
    for first, last in _runs(post.numbers):
        child(item, "validity", fromLane=first, toLane=last)
    if version == "1.8":
        child(child(item, "semantics"), "priority", type=post.meaning)


def _runs(numbers: Sequence[int]) -> list[tuple[int, int]]:
    """Return runs of lane numbers without a gap, each from the smaller to the larger."""
    runs: list[tuple[int, int]] = []
    for value in sorted(numbers):
        if runs and value == runs[-1][1] + 1:
            runs[-1] = (runs[-1][0], value)
        else:
            runs.append((value, value))
    return runs


def _controller(own: int, name: str, signals: Sequence[int]) -> Element:
    made = element("controller", name=name, id=own)
    for signal in signals:
        child(made, "control", signalId=signal, type=0)
    return made
