"""OpenDRIVE files as a reader sees them: points of roads and lanes from the XML alone."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from lxml import etree

from foretwin.contracts.arrays import Array


class Place(NamedTuple):
    point: Array
    heading_rad: float


@dataclass(frozen=True, slots=True)
class FileRoad:
    """One `<road>` of a file."""

    element: etree._Element

    @property
    def id(self) -> str:
        return str(self.element.get("id"))

    @property
    def junction(self) -> str:
        return str(self.element.get("junction"))

    @property
    def source(self) -> str:
        """The id of the World's road or connection that it was written from."""
        return str(self.element.find("userData").get("value"))

    @property
    def length_m(self) -> float:
        return float(self.element.get("length"))

    @property
    def lanes(self) -> dict[int, etree._Element]:
        found = {int(e.get("id")): e for e in self.element.iter("lane")}
        return {i: found[i] for i in sorted(found) if i != 0}

    def link(self, end: str) -> etree._Element | None:
        return self.element.find("link/" + ("successor" if end == "end" else "predecessor"))

    def s_of(self, end: str) -> float:
        return self.length_m if end == "end" else 0.0

    def at(self, s: float) -> Place:
        """Return a point of the reference line and the heading there."""
        item = next(
            g
            for g in reversed(self.element.findall("planView/geometry"))
            if float(g.get("s")) <= s + 1e-9
        )
        x, y, heading, length, start = (
            float(item.get(k)) for k in ("x", "y", "hdg", "length", "s")
        )
        shape = item[0]
        if shape.tag == "line":
            u, v, du, dv = s - start, 0.0, 1.0, 0.0
        else:
            assert shape.get("pRange") == "normalized"
            p = (s - start) / length
            (u, du), (v, dv) = (_cubic(shape, axis, p) for axis in "UV")
        cos, sin = math.cos(heading), math.sin(heading)
        point = np.array([x + cos * u - sin * v, y + sin * u + cos * v])
        return Place(point, heading + math.atan2(dv, du))

    def beside(self, s: float, t: float) -> Array:
        point, heading = self.at(s)
        return point + t * np.array([-math.sin(heading), math.cos(heading)])

    def edges_m(self, lane: int, s: float) -> tuple[float, float]:
        """Return how far a lane's inner and outer border lie to the left of the line."""
        offset = self.element.find("lanes/laneOffset")
        t = 0.0 if offset is None else _poly(offset, s)
        step = 1 if lane > 0 else -1
        inner = t
        for number in range(step, lane + step, step):
            inner, t = t, t + step * _poly(self.lanes[number].find("width"), s)
        return inner, t

    def borders(self, lane: int, s: float) -> tuple[Array, Array]:
        inner, outer = self.edges_m(lane, s)
        return self.beside(s, inner), self.beside(s, outer)

    def height_m(self, s: float) -> float:
        pieces = self.element.findall("elevationProfile/elevation")
        piece = max((p for p in pieces if float(p.get("s")) <= s), key=lambda p: float(p.get("s")))
        return _poly(piece, s - float(piece.get("s")))

    def grade(self, s: float) -> float:
        step = 0.01
        low, high = max(s - step, 0.0), min(s + step, self.length_m)
        return (self.height_m(high) - self.height_m(low)) / (high - low)

    def placed(self, item: etree._Element) -> list[Array]:
        """Return the outlines of an `<object>`, each (N, 2)."""
        s, t = float(item.get("s")), float(item.get("t"))
        origin, turn = self.beside(s, t), self.at(s).heading_rad + float(item.get("hdg"))
        cos, sin = math.cos(turn), math.sin(turn)
        found = []
        for outline in item.iter("outline"):
            uv = np.array([[float(c.get("u")), float(c.get("v"))] for c in outline])
            found.append(origin + uv @ np.array([[cos, sin], [-sin, cos]]))
        return found


def _cubic(shape: etree._Element, axis: str, p: float) -> tuple[float, float]:
    a, b, c, d = (float(shape.get(k + axis)) for k in "abcd")
    return a + p * (b + p * (c + p * d)), b + p * (2 * c + 3 * p * d)


def _poly(item: etree._Element, s: float) -> float:
    a, b, c, d = (float(item.get(k)) for k in "abcd")
    return a + s * (b + s * (c + s * d))


class LaneJoint(NamedTuple):
    """Two lane ends that a file says are one: road, `start` or `end`, lane number."""

    first: tuple[FileRoad, str, int]
    second: tuple[FileRoad, str, int]


@dataclass(frozen=True, slots=True)
class OpenDriveFile:
    """A whole file."""

    root: etree._Element
    roads: dict[str, FileRoad]

    @staticmethod
    def read(path: Path) -> OpenDriveFile:
        root = etree.parse(str(path)).getroot()
        return OpenDriveFile(root, {r.get("id"): FileRoad(r) for r in root.findall("road")})

    def joints(self) -> Iterator[LaneJoint]:
        """Yield every pair of lane ends that are linked, from both sides."""
        for road in self.roads.values():
            for end, tag in (("start", "predecessor"), ("end", "successor")):
                to = road.link(end)
                if to is None or to.get("elementType") != "road":
                    continue
                other = self.roads[to.get("elementId")]
                for number, lane in road.lanes.items():
                    following = lane.find(f"link/{tag}")
                    if following is not None:
                        second = (other, to.get("contactPoint"), int(following.get("id")))
                        yield LaneJoint((road, end, number), second)
        for connection in self.root.iterfind("junction/connection"):
            road = self.roads[connection.get("connectingRoad")]
            incoming = self.roads[connection.get("incomingRoad")]
            junction = connection.getparent().get("id")
            ends = [
                end
                for end in ("start", "end")
                if (to := incoming.link(end)) is not None
                and to.get("elementType") == "junction"
                and to.get("elementId") == junction
            ]
            back = road.link("start")
            assert back is not None
            assert back.get("contactPoint") in ends
            for link in connection.findall("laneLink"):
                yield LaneJoint(
                    (incoming, back.get("contactPoint"), int(link.get("from"))),
                    (road, connection.get("contactPoint"), int(link.get("to"))),
                )


def gap_m(joint: LaneJoint) -> float:
    """Return the larger distance between the borders of two lane ends."""
    (a, end_a, lane_a), (b, end_b, lane_b) = joint
    one, other = a.borders(lane_a, a.s_of(end_a)), b.borders(lane_b, b.s_of(end_b))
    straight = max(math.dist(p, q) for p, q in zip(one, other, strict=True))
    crossed = max(math.dist(p, q) for p, q in zip(one, other[::-1], strict=True))
    return min(straight, crossed)


def bend_rad(joint: LaneJoint) -> float:
    """Return the change of heading between two roads where their lanes join."""
    (a, end_a, _), (b, end_b, _) = joint
    turned = 0.0 if end_a != end_b else math.pi
    gap = a.at(a.s_of(end_a)).heading_rad - b.at(b.s_of(end_b)).heading_rad + turned
    return abs(math.remainder(gap, math.tau))
