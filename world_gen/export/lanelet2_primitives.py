"""The primitives of a Lanelet2 map, nodes, ways and relations, gathered and written as OSM XML."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Literal, NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame, geo_from_local
from foretwin.contracts.world import ATTRIBUTION, Connection, Lane, World
from foretwin.geometry.world_heights import WorldHeights
from foretwin.world_gen.export.xml_tree import in_comment, legal

Tags = Mapping[str, str]
MemberKind = Literal["way", "relation"]
LICENSE_URL = "https://opendatacommons.org/licenses/odbl/1-0/"


class RelationMember(NamedTuple):
    """One member of a relation."""

    kind: MemberKind
    ref: int
    role: str


class Lanelet2Map:
    """A map while it is drawn; ids count up from 1 and are unique over all kinds.

    Lanelet2 sees by a shared node that lanelets follow each other, and by a shared way that
    they lie side by side: points of roads with the same coordinates are one node here, and
    lines over the same nodes one way, whichever way they run.
    """

    def __init__(self, hills: WorldHeights | None = None) -> None:
        """Ground lies as high as `hills` say, else at 0; files tell heights above the sea then."""
        self.hills = hills
        self._next_id = 1
        self._xyz: list[tuple[float, float, float]] = []
        self._node_ids: list[int] = []
        self._node_tags: dict[int, Tags] = {}
        self._node_at: dict[tuple[int, int, int | None], int] = {}
        self._way_over: dict[tuple[int, ...], int] = {}
        self._ways: list[tuple[int, tuple[int, ...], Tags]] = []
        self._relations: list[tuple[int, Sequence[RelationMember], Tags]] = []

    def new_id(self) -> int:
        """Return an id for a relation that others name before it is drawn."""
        self._next_id += 1
        return self._next_id - 1

    def node(self, x_m: float, y_m: float, z_m: float, tags: Tags | None = None) -> int:
        """Add a node of its own."""
        node = self.new_id()
        self._node_ids.append(node)
        self._xyz.append((x_m, y_m, z_m))
        if tags:
            self._node_tags[node] = tags
        return node

    def ground_m(self, points: Array) -> Array:
        """Return how high the ground lies at points (N, 2)."""
        return np.zeros(len(points)) if self.hills is None else self.hills.surface_at(points)

    def ground_nodes(self, points: Array) -> tuple[int, ...]:
        """Add nodes of their own at points (N, 2) on the ground."""
        z_m = self.ground_m(points)
        return tuple(
            self.node(x, y, z) for (x, y), z in zip(points.tolist(), z_m.tolist(), strict=True)
        )

    def road_nodes(self, part: Lane | Connection, line: Array) -> tuple[int, ...]:
        """Return the nodes of a border (N, 2), shared with those at the same place.

        Between its ends that is with those of its layer alone: what passes over it stays apart.
        """
        z_m = np.zeros(len(line)) if self.hills is None else self.hills.along(part, line)
        found: list[int] = []
        keys = np.rint(line * 1000.0).astype(np.int64).tolist()
        for i, ((x, y), point, z) in enumerate(zip(keys, line.tolist(), z_m.tolist(), strict=True)):
            key = (x, y, None if i in (0, len(keys) - 1) else part.layer)
            node = self._node_at.get(key)
            if node is None:
                node = self._node_at[key] = self.node(point[0], point[1], z)
            if not found or found[-1] != node:
                found.append(node)
        return tuple(found)

    def road_way(self, nodes: tuple[int, ...], tags: Tags) -> int:
        """Return the way over these nodes, drawn with `tags` where there is none yet."""
        known = self._way_over.get(nodes) or self._way_over.get(nodes[::-1])
        if known is None:
            known = self._way_over[nodes] = self.way(nodes, tags)
        return known

    def way(self, nodes: tuple[int, ...], tags: Tags) -> int:
        """Add a way of its own."""
        way = self.new_id()
        self._ways.append((way, nodes, tags))
        return way

    def relation(
        self, members: Sequence[RelationMember], tags: Tags, *, number: int | None = None
    ) -> int:
        """Add a relation, under an id from `new_id` where one is given."""
        number = self.new_id() if number is None else number
        self._relations.append((number, members, tags))
        return number

    def write(self, world: World, path: Path) -> None:
        """Write the map as OSM XML, one primitive to a line."""
        root = {"version": "0.6", "generator": "foretwin", "attribution": world.attribution}
        if world.attribution == ATTRIBUTION:
            root["license"] = LICENSE_URL
        note = in_comment(f"{world.attribution}; world {world.id}")
        with path.open("w", encoding="utf-8", newline="\n") as file:
            file.write('<?xml version="1.0" encoding="utf-8"?>\n')
            file.write(f"<osm{_attributes(root)}>\n<!-- {note} -->\n")
            meta = {"format_version": "1", "map_version": world.id}
            file.write(f"<MetaInfo{_attributes(meta)}/>\n")
            file.writelines(self._node_lines(world.frame))
            for way, nodes, tags in self._ways:
                refs = "".join([f'<nd ref="{node}"/>' for node in nodes])
                file.write(_line("way", way, refs + _tags(tags)))
            for relation, members, tags in self._relations:
                listed = "".join(
                    f'<member type="{m.kind}" ref="{m.ref}" role="{m.role}"/>' for m in members
                )
                file.write(_line("relation", relation, listed + _tags(tags)))
            file.write("</osm>\n")

    def _node_lines(self, frame: LocalFrame) -> Iterator[str]:
        if not self._xyz:
            return
        xyz = np.array(self._xyz, dtype=np.float64)
        if self.hills is not None:
            xyz[:, 2] += self.hills.elevation.base_m
        lat_lon = geo_from_local(frame, xyz[:, :2]).tolist()
        for node, (lat, lon), (x, y, z) in zip(self._node_ids, lat_lon, xyz.tolist(), strict=True):
            yield (
                f'<node id="{node}" visible="true" version="1" lat="{lat:.11f}" lon="{lon:.11f}">'
                f'<tag k="local_x" v="{x:.3f}"/><tag k="local_y" v="{y:.3f}"/>'
                f'<tag k="ele" v="{z:.3f}"/>{_tags(self._node_tags.get(node, {}))}</node>\n'
            )


def _line(kind: str, number: int, content: str) -> str:
    return f'<{kind} id="{number}" visible="true" version="1">{content}</{kind}>\n'


def _tags(tags: Tags) -> str:
    return "".join([f"<tag{_attributes({'k': key, 'v': value})}/>" for key, value in tags.items()])


def _attributes(values: Mapping[str, str]) -> str:
    return "".join([f" {name}={quoteattr(legal(value))}" for name, value in values.items()])
