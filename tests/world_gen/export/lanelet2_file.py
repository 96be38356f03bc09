"""Reads a written Lanelet2 map back, as plain XML."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from lxml import etree

from foretwin.contracts.world import World
from foretwin.world_gen.export.lanelet2 import write_lanelet2


class Read(NamedTuple):
    """A written map: its primitives by id, tags as dicts."""

    nodes: dict[int, dict[str, str]]
    ways: dict[int, tuple[list[int], dict[str, str]]]
    relations: dict[int, tuple[list[tuple[str, int, str]], dict[str, str]]]
    root: Any

    def lanelet(self, name: str) -> tuple[list[tuple[str, int, str]], dict[str, str]]:
        return next(r for r in self.relations.values() if r[1].get("foretwin:id") == name)

    def id_of(self, name: str) -> int:
        return next(i for i, r in self.relations.items() if r[1].get("foretwin:id") == name)

    def rules(self, subtype: str) -> list[tuple[int, list[tuple[str, int, str]], dict[str, str]]]:
        return [
            (i, members, tags)
            for i, (members, tags) in self.relations.items()
            if tags["type"] == "regulatory_element" and tags["subtype"] == subtype
        ]

    def border(self, name: str, side: str) -> dict[str, str]:
        members, _ = self.lanelet(name)
        return self.ways[next(ref for _, ref, role in members if role == side)][1]


def read(path: Path) -> Read:
    root = etree.parse(str(path)).getroot()
    tags = lambda e: {t.get("k"): t.get("v") for t in e.iterfind("tag")}  # noqa: E731
    return Read(
        {int(e.get("id")): dict(e.attrib) | tags(e) for e in root.iterfind("node")},
        {
            int(e.get("id")): ([int(n.get("ref")) for n in e.iterfind("nd")], tags(e))
            for e in root.iterfind("way")
        },
        {
            int(e.get("id")): (
                [(m.get("type"), int(m.get("ref")), m.get("role")) for m in e.iterfind("member")],
                tags(e),
            )
            for e in root.iterfind("relation")
        },
        root,
    )


def written(drawn: World, folder: Path, **options: Any) -> Read:
    path = folder / "map.osm"
    write_lanelet2(drawn, path, **options)
    return read(path)


def assert_closed(found: Read) -> None:
    ids = [*found.nodes, *found.ways, *found.relations]
    assert len(ids) == len(set(ids))
    for nodes, _ in found.ways.values():
        assert nodes
        assert set(nodes) <= set(found.nodes)
    for members, _ in found.relations.values():
        for kind, ref, _ in members:
            assert ref in (found.ways if kind == "way" else found.relations)
