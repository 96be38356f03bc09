"""An HD map reduced to what OpenStreetMap would hold of it, as the text of an .osm file.

Ways stand in the middle of carriageways with few nodes; they say how many lanes there are, where
these lead, and which way they are driven. No lane's place, width or path is told.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from xml.sax.saxutils import quoteattr

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import geo_from_local
from tests.world_gen.truth.carriageways import Carriageway, carriageways
from tests.world_gen.truth.hd_map import HdMap
from tests.world_gen.truth.junction_ways import (
    STRAIGHT_RAD,
    JunctionWay,
    Port,
    junction_ways,
    junctions,
    movements,
    neighbours,
    place,
    turn_of,
)

_U_TURN_RAD = math.radians(150.0)
_MARGIN_DEG = 0.0005
Tags = Mapping[str, str]


@dataclass(kw_only=True)
class _Writer:
    hd: HdMap
    nodes: list[Array] = field(default_factory=list)
    node_tags: dict[int, Tags] = field(default_factory=dict)
    ways: list[tuple[list[int], Tags]] = field(default_factory=list)

    def node(self, xy_m: Array) -> int:
        self.nodes.append(xy_m)
        return len(self.nodes) - 1

    def text(self) -> str:
        lat_lon = geo_from_local(self.hd.frame, np.array(self.nodes))
        south, west = lat_lon.min(axis=0) - _MARGIN_DEG
        north, east = lat_lon.max(axis=0) + _MARGIN_DEG
        lines = [
            '<osm version="0.6" generator="truth harness">',
            f'<bounds minlat="{south:.7f}" minlon="{west:.7f}"'
            f' maxlat="{north:.7f}" maxlon="{east:.7f}"/>',
        ]
        for i, (lat, lon) in enumerate(lat_lon.tolist()):
            tags = _tags(self.node_tags.get(i, {}))
            lines.append(
                f'<node id="{i + 1}" version="1" lat="{lat:.8f}" lon="{lon:.8f}">{tags}</node>'
            )
        for i, (nodes, said) in enumerate(self.ways):
            refs = "".join(f'<nd ref="{n + 1}"/>' for n in nodes)
            lines.append(f'<way id="{i + 1}" version="1">{refs}{_tags(said)}</way>')
        return "\n".join([*lines, "</osm>\n"])


def _tags(tags: Tags) -> str:
    return "".join(f"<tag k={quoteattr(k)} v={quoteattr(v)}/>" for k, v in tags.items())


def reduced(hd: HdMap) -> str:
    """Return the .osm text that a mapper who knows the streets would have drawn."""
    roads = carriageways(hd)
    found = movements(hd)
    crossed = junctions(hd, roads, found)
    through = [(way, junction) for junction in crossed for way in junction_ways(roads, junction)]
    turns = {key: set[str]() for key in hd.lanes}
    for movement in found:
        turns[movement.from_lane].add(_word(turn_of(hd, movement)))
    names = _names(hd, roads, [way for way, _ in through])
    writer = _Writer(hd=hd)
    ports = _port_nodes(hd, roads, writer)
    lines = [_road_nodes(road, i, ports, writer) for i, road in enumerate(roads)]
    tags = [_road_tags(hd, road, names[i], turns, roads) for i, road in enumerate(roads)]
    made: dict[int, int] = {}
    for way, _ in through:
        nodes = [ports[way.port]]
        for point in way.points[1:]:
            if way.to is not None and point is way.points[-1]:
                nodes.append(ports[way.to])
                continue
            if id(point) not in made:
                made[id(point)] = writer.node(point)
                if hd.signals:
                    writer.node_tags[made[id(point)]] = {"highway": "traffic_signals"}
            nodes.append(made[id(point)])
        _lay(way, nodes, [w for w, _ in through], lines, tags, roads, writer)
    for line, tag in zip(lines, tags, strict=True):
        if len(line) > 1:
            writer.ways.append((line, tag))
    _mark_crossings(hd, writer)
    return writer.text()


def _word(angle_rad: float) -> str:
    if abs(angle_rad) < STRAIGHT_RAD:
        return "through"
    if abs(angle_rad) > _U_TURN_RAD:
        return "reverse"
    return "left" if angle_rad > 0.0 else "right"


def _names(hd: HdMap, roads: list[Carriageway], ways: list[JunctionWay]) -> list[str]:
    """Return a name for each carriageway, the same where a road goes straight on."""
    street = list(range(len(roads)))
    pairs = [(a.road, b.road) for a, b in neighbours(hd, roads)]
    pairs += [(way.port.road, way.to.road) for way in ways if way.to is not None]
    for a, b in pairs:
        old, new = max(street[a], street[b]), min(street[a], street[b])
        street = [new if value == old else value for value in street]
    return [f"Street {value}" for value in street]


def _port_nodes(hd: HdMap, roads: list[Carriageway], writer: _Writer) -> dict[Port, int]:
    """Return the node of each port; ports where lanes go on share theirs."""
    every = [Port(i, last) for i in range(len(roads)) for last in (False, True)]
    together = {port: {port} for port in every}
    for a, b in neighbours(hd, roads):
        both = together[a] | together[b]
        together.update(dict.fromkeys(both, both))
    nodes: dict[Port, int] = {}
    for port in every:
        if port not in nodes:
            mine = sorted(together[port])
            node = writer.node(np.mean([place(roads, p) for p in mine], axis=0))
            nodes.update(dict.fromkeys(mine, node))
    return nodes


def _road_nodes(road: Carriageway, i: int, ports: dict[Port, int], writer: _Writer) -> list[int]:
    inner = [writer.node(point) for point in road.line[1:-1]]
    return [ports[Port(i, False)], *inner, ports[Port(i, True)]]


def _road_tags(
    hd: HdMap,
    road: Carriageway,
    name: str,
    turns: Mapping[str, set[str]],
    roads: list[Carriageway],
) -> dict[str, str]:
    most = max(len(road.forward), len(road.backward))
    tags = {"highway": "secondary" if most > 1 else "residential", "name": name}
    if road.narrow:
        return tags
    tags["lanes"] = str(len(road.forward) + len(road.backward))
    if not road.two_way:
        tags["oneway"] = "yes"
    elif len(road.forward) != len(road.backward):
        tags["lanes:forward"] = str(len(road.forward))
        tags["lanes:backward"] = str(len(road.backward))
    for lanes, suffix in ((road.forward, ":forward"), (road.backward, ":backward")):
        end = suffix if road.two_way else ""
        if any(turns[key] for key in lanes):
            words = [";".join(sorted(turns[key], key=_from_left)) for key in lanes]
            tags[f"turn:lanes{end}"] = "|".join(words)
        kinds = [hd.lanes[key].kind for key in lanes]
        if "bus" in kinds:
            tags[f"bus:lanes{end}"] = "|".join("designated" if k == "bus" else "" for k in kinds)
            tags[f"vehicle:lanes{end}"] = "|".join("no" if k == "bus" else "yes" for k in kinds)
    return tags


def _from_left(word: str) -> int:
    return ("reverse", "left", "through", "right").index(word)


def _lay(
    way: JunctionWay,
    nodes: list[int],
    ways: list[JunctionWay],
    lines: list[list[int]],
    tags: list[dict[str, str]],
    roads: list[Carriageway],
    writer: _Writer,
) -> None:
    """Give the ends of a way through a junction to the roads that it goes on from.

    A mapper ends a road at the node where it meets another, not at the stop line.
    """
    alone = {
        port: sum(port in (w.port, w.to) for w in ways) == 1
        and way.two_way == roads[port.road].two_way
        for port in (way.port, way.to)
        if port is not None
    }
    begin, end = 0, len(nodes) - 1
    if alone[way.port] and len(nodes) > 1:
        _extend(lines, way.port, nodes[1])
        begin = 1
    if way.to is not None and alone[way.to] and end - 1 >= begin:
        _extend(lines, way.to, nodes[end - 1])
        end -= 1
    if end - begin < 1:
        return
    base = {"highway": tags[way.port.road]["highway"], "name": tags[way.port.road]["name"]}
    rest = nodes[begin : end + 1]
    if not way.two_way:
        base["oneway"] = "yes"
        road = roads[way.port.road]
        count = len(road.forward if way.port.last != way.toward_port else road.backward)
        base["lanes"] = str(max(count, 1))
        rest = rest[::-1] if way.toward_port else rest
    writer.ways.append((rest, base))


def _extend(lines: list[list[int]], port: Port, node: int) -> None:
    line = lines[port.road]
    if port.last:
        line.append(node)
    else:
        line.insert(0, node)


def _mark_crossings(hd: HdMap, writer: _Writer) -> None:
    """Put a node where people cross a way on foot."""
    for crossing in hd.crossings:
        foot = shapely.LineString(crossing)
        for nodes, _ in writer.ways:
            for at in range(len(nodes) - 1):
                piece = shapely.LineString([writer.nodes[nodes[at]], writer.nodes[nodes[at + 1]]])
                met = piece.intersection(foot)
                if (
                    met.geom_type == "Point"
                    and min(
                        met.distance(shapely.Point(writer.nodes[n])) for n in nodes[at : at + 2]
                    )
                    > 1.0
                ):
                    new = writer.node(np.array([met.x, met.y]))
                    kind = "traffic_signals" if hd.signals else "marked"
                    writer.node_tags[new] = {"highway": "crossing", "crossing": kind}
                    nodes.insert(at + 1, new)
                    break
