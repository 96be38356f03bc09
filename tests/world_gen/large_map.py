"""Write a map as large as wished: the same small town over and over, from a seed.

    python -m tests.world_gen.large_map OUT.osm MEGABYTES [SEED]

The towns stand on a grid over the middle of Europe. Every town has its own ids, streets with
signals, a turn restriction, houses, one of them with a courtyard, and trees that no driver needs.
"""

from __future__ import annotations

import random
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

SOUTH_DEG, WEST_DEG, TOWN_DEG = 45.0, 5.0, 0.02
TOWNS_IN_ROW = 400
STREETS = 10
STEP_DEG = 0.0015
META = 'version="3" timestamp="2024-01-02T03:04:05Z" changeset="123456789" uid="4711" user="mapper"'


class Town(NamedTuple):
    """One town as it repeats: nodes (lat, lon, tags), ways and relations by place in it."""

    nodes: list[tuple[float, float, str]]
    ways: list[tuple[list[int], str]]
    relations: list[tuple[list[tuple[str, int, str]], str]]


def draw_town(seed: int) -> Town:
    """Return a grid of streets with houses between them."""
    chance = random.Random(seed)
    town = Town([], [], [])
    for row in range(STREETS):
        for column in range(STREETS):
            lat, lon = (n * STEP_DEG + chance.uniform(-5e-5, 5e-5) for n in (row, column))
            signal = '<tag k="highway" v="traffic_signals"/>' if chance.random() < 0.2 else ""
            town.nodes.append((lat, lon, signal))
    for street in range(STREETS):
        name = f'<tag k="name" v="Street {street}"/><tag k="maxspeed" v="50"/>'
        kind = '<tag k="highway" v="residential"/>' + name
        town.ways.append(([street * STREETS + k for k in range(STREETS)], kind))
        town.ways.append(([k * STREETS + street for k in range(STREETS)], kind))
    for row in range(STREETS - 1):
        for column in range(STREETS - 1):
            for k in range(4):
                lat = (row + 0.3 + 0.4 * (k // 2)) * STEP_DEG
                lon = (column + 0.3 + 0.4 * (k % 2)) * STEP_DEG
                _add_ring(town, lat, lon, chance.uniform(0.6e-4, 1.2e-4))
                height = f'<tag k="building:levels" v="{chance.randint(1, 6)}"/>'
                town.ways[-1] = (town.ways[-1][0], f'<tag k="building" v="house"/>{height}')
            town.nodes.append(
                ((row + 0.5) * STEP_DEG, (column + 0.2) * STEP_DEG, '<tag k="natural" v="tree"/>')
            )
    yard = (STREETS - 0.5) * STEP_DEG
    outer = _add_ring(town, yard, yard, 3e-4)
    inner = _add_ring(town, yard, yard, 1e-4)
    multipolygon = '<tag k="type" v="multipolygon"/><tag k="building" v="yes"/>'
    town.relations.append(([("way", outer, "outer"), ("way", inner, "inner")], multipolygon))
    no_left = '<tag k="type" v="restriction"/><tag k="restriction" v="no_left_turn"/>'
    middle = STREETS * (STREETS // 2) + STREETS // 2
    turn = [("way", STREETS, "from"), ("node", middle, "via"), ("way", STREETS + 1, "to")]
    town.relations.append((turn, no_left))
    return town


def _add_ring(town: Town, lat: float, lon: float, half: float) -> int:
    first = len(town.nodes)
    for north, east in ((-1, -1), (-1, 1), (1, 1), (1, -1)):
        town.nodes.append((lat + north * half, lon + east * half, ""))
    town.ways.append(([*range(first, first + 4), first], ""))
    return len(town.ways) - 1


def write_large_map(path: Path, size_bytes: int, seed: int = 1) -> int:
    """Write OSM XML of about `size_bytes`; returns how many towns it holds."""
    town = draw_town(seed)
    one = sum(len(text) for part in _parts(town, 1) for text in part)
    towns = max(1, size_bytes // one)
    with path.open("w", encoding="utf-8") as file:
        file.write('<?xml version="1.0" encoding="UTF-8"?>\n<osm version="0.6">\n')
        for part in _parts(town, towns):
            file.writelines(part)
        file.write("</osm>\n")
    return towns


def _parts(town: Town, towns: int) -> Iterator[Iterator[str]]:
    """Yield all nodes, all ways, all relations, as map files order them."""
    node_text = "".join(
        f'<node id="%d" lat="%.7f" lon="%.7f" {META}' + (f">{tags}</node>\n" if tags else "/>\n")
        for _, _, tags in town.nodes
    )
    yield (node_text % _node_values(town, k) for k in range(towns))
    way_text = "".join(
        f'<way id="%d" {META}>' + '<nd ref="%d"/>' * len(nodes) + f"{tags}</way>\n"
        for nodes, tags in town.ways
    )
    yield (way_text % _way_values(town, k) for k in range(towns))
    relation_text = "".join(
        f'<relation id="%d" {META}>'
        + "".join(f'<member type="{kind}" ref="%d" role="{role}"/>' for kind, _, role in members)
        + f"{tags}</relation>\n"
        for members, tags in town.relations
    )
    yield (relation_text % _relation_values(town, k) for k in range(towns))


def _node_values(town: Town, k: int) -> tuple[float, ...]:
    north = SOUTH_DEG + TOWN_DEG * (k // TOWNS_IN_ROW)
    east = WEST_DEG + TOWN_DEG * (k % TOWNS_IN_ROW)
    first = 1 + k * len(town.nodes)
    values: list[float] = []
    for i, (lat, lon, _) in enumerate(town.nodes):
        values += (first + i, north + lat, east + lon)
    return tuple(values)


def _way_values(town: Town, k: int) -> tuple[int, ...]:
    first_node, first_way = 1 + k * len(town.nodes), 1 + k * len(town.ways)
    values: list[int] = []
    for i, (nodes, _) in enumerate(town.ways):
        values.append(first_way + i)
        values += [first_node + node for node in nodes]
    return tuple(values)


def _relation_values(town: Town, k: int) -> tuple[int, ...]:
    first = {"node": 1 + k * len(town.nodes), "way": 1 + k * len(town.ways)}
    values: list[int] = []
    for i, (members, _) in enumerate(town.relations):
        values.append(1 + k * len(town.relations) + i)
        values += [first[kind] + ref for kind, ref, _ in members]
    return tuple(values)


if __name__ == "__main__":
    count = write_large_map(
        Path(sys.argv[1]), int(float(sys.argv[2]) * 1e6), int((*sys.argv, "1")[3])
    )
    print(f"{sys.argv[1]}: {count} towns")
