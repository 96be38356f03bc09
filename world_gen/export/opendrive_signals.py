"""Signals, stop and give-way signs beside the roads of an OpenDRIVE file, and their controllers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import count
from typing import NamedTuple

import numpy as np
from lxml import etree

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.signals import Signal
from foretwin.contracts.world import DrivingSide, Lane, StopLine, World
from foretwin.world_gen.export.opendrive_elements import Version, number
from foretwin.world_gen.export.opendrive_places import OdrJunction, OdrNetwork
from foretwin.world_gen.export.opendrive_roads import OdrRoad

SIGN_BESIDE_M = 0.6
SIGN_HEIGHT_M = 2.65
"""Middle of a sign, whose lower edge is 2.20 m high (VwV-StVO on §§ 39 to 43)."""
SIGN_M = (0.9, 0.9)
"""Width and height of a sign (VzKat 2017, size 2)."""
LIGHT_M = (0.3, 0.9)
"""Width and height of three lights of 200 mm above each other."""
_SIGNS = {"stop": ("206", "stop"), "give_way": ("205", "yield")}
"""Type in Germany's catalogue of signs and meaning of the signs at stop lines by their control."""


class Controller(NamedTuple):
    """Signals that change together, and the junctions that they lead into."""

    id: int
    junctions: frozenset[int]
    element: etree._Element


def add_signals(
    world: World, network: OdrNetwork, elements: Mapping[int, etree._Element], version: Version
) -> list[Controller]:
    """Add `<signals>` to the roads' `elements`, which are by id, and return their controllers."""
    lanes = {lane.id: lane for lane in world.lanes}
    ids = count(1)
    groups: dict[str, list[int]] = {}
    leads_into: dict[str, set[int]] = {}
    junction_of = _junction_of_lane(network.junctions)
    for signal in world.signals:
        for road, mine in _by_road(signal.lane_ids, lanes, network):
            own = next(ids)
            _add(
                elements[road.id],
                road,
                _ruled(road, mine),
                own,
                _light(signal),
                signal.position,
                signal.yaw_rad,
                version,
            )
            groups.setdefault(signal.group_id, []).append(own)
            into = leads_into.setdefault(signal.group_id, set())
            into.update(junction_of[lane.id] for lane in mine if lane.id in junction_of)
    for lines in _signed(world.stop_lines, lanes, network):
        place, yaw = _beside(lines, network.side)
        road = network.road_of[lines[0].lane_id]
        ruled = _ruled(road, [lanes[line.lane_id] for line in lines])
        face = _sign(lines[0], network.side)
        _add(elements[road.id], road, ruled, next(ids), face, place, yaw, version)
    for line in world.stop_lines:
        over = network.connecting.get(line.connection_id or "")
        if over is not None and line.control.value in _SIGNS:
            place, yaw = _beside([line], network.side)
            # A connecting road runs as it is driven, and has one lane.
            ruled = _Ruled(True, [over.lanes[0].number])
            face = _sign(line, network.side)
            _add(elements[over.id], over, ruled, next(ids), face, place, yaw, version)
    return [
        Controller(i, frozenset(leads_into[name]), _controller(i, name, members))
        for i, (name, members) in enumerate(groups.items(), start=1)
    ]


class _Face(NamedTuple):
    name: str
    type: str
    country: str
    meaning: str
    dynamic: bool
    width_m: float
    height_m: float


class _Ruled(NamedTuple):
    """The lanes of a road, by number, that a signal is for, and whether they run along it."""

    along: bool
    numbers: list[int]


def _ruled(road: OdrRoad, lanes: Sequence[Lane]) -> _Ruled:
    return _Ruled(not lanes[0].reverse, [road.numbers[lane.id] for lane in lanes])


def _light(signal: Signal) -> _Face:
    return _Face(signal.id, "1000001", "OpenDRIVE", "trafficLight", True, *LIGHT_M)


def _sign(line: StopLine, side: DrivingSide) -> _Face:
    kind, meaning = _SIGNS[line.control.value]
    # Germany's signs stand for the Vienna convention's, which left-hand countries may not share.
    return _Face(line.id, kind, "DE" if side == "right" else "OpenDRIVE", meaning, False, *SIGN_M)


def _junction_of_lane(junctions: Sequence[OdrJunction]) -> dict[str, int]:
    return {
        item.connection.from_lane_id: junction.id
        for junction in junctions
        for item in junction.connections
    }


def _by_road(
    lane_ids: Sequence[str], lanes: Mapping[str, Lane], network: OdrNetwork
) -> list[tuple[OdrRoad, list[Lane]]]:
    found: dict[int, tuple[OdrRoad, list[Lane]]] = {}
    for i in lane_ids:
        if i in network.road_of:
            road = network.road_of[i]
            found.setdefault(road.id, (road, []))[1].append(lanes[i])
    return list(found.values())


def _signed(
    lines: Sequence[StopLine], lanes: Mapping[str, Lane], network: OdrNetwork
) -> list[list[StopLine]]:
    """Return the stop lines that have a sign, together those of one road and direction."""
    found: dict[tuple[int, bool, str], list[StopLine]] = {}
    for line in lines:
        if line.control.value in _SIGNS and line.across_id in network.road_of:
            key = (network.road_of[line.lane_id].id, lanes[line.lane_id].reverse)
            found.setdefault((*key, line.control.value), []).append(line)
    return list(found.values())


def _beside(lines: Sequence[StopLine], side: DrivingSide) -> tuple[Array, float]:
    """Return where a sign stands, at the kerb side of the lines, and where it faces."""
    kerb = 1 if side == "right" else 0
    across = lines[0].ends[0] - lines[0].ends[1]
    across /= max(math.hypot(*across), 1e-6)
    outward = across * (1.0 if kerb == 0 else -1.0)
    ends = np.array([line.ends[kerb] for line in lines])
    at = ends[int(np.argmax(ends @ outward))] + outward * SIGN_BESIDE_M
    # `across` points to the driver's left: he looks a quarter turn clockwise of it.
    facing = math.atan2(-across[0], across[1])
    return np.array([at[0], at[1], SIGN_HEIGHT_M]), facing + math.pi


def _add(
    element: etree._Element,
    road: OdrRoad,
    ruled: _Ruled,
    own: int,
    face: _Face,
    position: Array,
    yaw_rad: float,
    version: Version,
) -> None:
    signals = element.find("signals")
    if signals is None:
        signals = etree.SubElement(element, "signals")
    s, t = road.curve.locate(position[:2])
    _, direction = road.curve.at(s)
    heading = math.atan2(direction[0, 1], direction[0, 0])
    usual = heading + math.pi if ruled.along else heading
    item = etree.SubElement(
        signals,
        "signal",
        name=face.name,
        s=number(s[0]),
        t=number(t[0]),
        dynamic="yes" if face.dynamic else "no",
        orientation="+" if ruled.along else "-",
        # The file asks for the lower edge, the World says where the middle is.
        zOffset=number(float(position[2]) - face.height_m / 2.0),
        width=number(face.width_m),
        height=number(face.height_m),
        country=face.country,
        type=face.type,
        subtype="-1",
        hOffset=number(float(wrap_angle(yaw_rad - usual))),
    )
    item.set("id", str(own))
    for first, last in _runs(ruled.numbers):
        etree.SubElement(item, "validity", fromLane=str(first), toLane=str(last))
    if version == "1.8":
        etree.SubElement(etree.SubElement(item, "semantics"), "priority", type=face.meaning)


def _runs(numbers: Sequence[int]) -> list[tuple[int, int]]:
    """Return runs of lane numbers without a gap, each from the smaller to the larger."""
    runs: list[tuple[int, int]] = []
    for value in sorted(numbers):
        if runs and value == runs[-1][1] + 1:
            runs[-1] = (runs[-1][0], value)
        else:
            runs.append((value, value))
    return runs


def _controller(own: int, name: str, signals: Sequence[int]) -> etree._Element:
    element = etree.Element("controller", name=name)
    element.set("id", str(own))
    for signal in signals:
        etree.SubElement(element, "control", signalId=str(signal), type="0")
    return element
