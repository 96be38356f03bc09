"""CARLA's parser puts its waypoints where the World has its lanes, whichever side is driven on."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import shapely

from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.world import World
from foretwin.world_gen.build import build_region
from foretwin.world_gen.export.choices import OpenDriveVersion
from foretwin.world_gen.export.lanelets import crosswalk_edges
from foretwin.world_gen.export.opendrive import write_opendrive
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.drawn_maps import IRELAND, crossing, roundabout, world_of
from tests.world_gen.export.judged_sample import sample_worlds
from tests.world_gen.export.judges import ask_judge
from tests.world_gen.export.read_opendrive import OpenDriveFile
from tests.world_gen.export.signalled import signalled_crossing

pytestmark = [pytest.mark.judge, pytest.mark.timeout(3600)]

VERSIONS: tuple[OpenDriveVersion, ...] = ("1.8", "1.4")
LEEDS = "osm-leeds/leeds.osm.gz"
"""Left-hand traffic about a ring with lights."""
OFF_M = 0.2


class Score(NamedTuple):
    """How a file is read: waypoints on the World's lanes, and how far off the worst lies."""

    waypoints: int
    off_m: float
    against: int
    """Waypoints that look another way than their lane is driven."""
    astray: int
    """Steps of a metre onto what does not follow in the World."""
    lanes_without: int
    """Lanes for driving of the World, of two metres and more, without a waypoint."""
    crosswalks: int
    crosswalks_off_m: float


def lines_by_source(world: World) -> dict[str, shapely.LineString]:
    """Return the middle of every lane and connection by its id."""
    parts = (*world.lanes, *world.connections)
    return {part.id: shapely.LineString(part.centerline) for part in parts}


def scored(world: World, file: OpenDriveFile, found: dict[str, Any]) -> Score:
    lines = lines_by_source(world)
    on_road = defaultdict(list)
    for road in world.roads:
        on_road[road.id] += [(name, lines[name]) for name in road.lane_ids if name in lines]
    follows = {lane.id: set(lane.successor_ids) for lane in world.lanes}
    follows |= {c.id: {c.to_lane_id} for c in world.connections}

    def lane_of(road: int, x: float, y: float) -> str | None:
        """Return the World's lane or connection that a file's road has here; None on short ones."""
        source = file.roads[str(road)].source.rstrip("~")
        if source in lines:
            return source
        at = shapely.Point(x, y)
        return min(on_road[source], key=lambda lane: lane[1].distance(at), default=(None,))[0]

    off_m, against, astray, count, met = 0.0, 0, 0, 0, set()
    for (road, _, x, y, yaw, _), following in zip(found["waypoints"], found["next"], strict=True):
        name = lane_of(road, x, y)
        if name is None:
            continue
        count, line = count + 1, lines[name]
        met.add(name)
        off_m = max(off_m, line.distance(shapely.Point(x, y)))
        s = float(np.clip(line.project(shapely.Point(x, y)), 0.05, line.length - 0.05))
        a, b = line.interpolate(s - 0.05), line.interpolate(s + 0.05)
        heading = np.arctan2(b.y - a.y, b.x - a.x)
        against += abs(wrap_angle(yaw - heading)) > np.pi / 2
        for other in following:
            after = lane_of(*(other[i] for i in (0, 2, 3)))
            astray += after is not None and not leads(name, after, follows)
    drawn = crosswalks_as_carla_has_them(world, file)
    read = [shapely.Polygon(outline) for outline in found["crosswalks"]]
    gaps = [min(shapely.hausdorff_distance(one, other) for other in read) for one in drawn if read]
    driven = {lane.id for lane in world.lanes if lane.kind == "driving"}
    return Score(
        waypoints=count,
        off_m=off_m,
        against=against,
        astray=astray,
        lanes_without=sum(lines[name].length >= 2.0 for name in driven - met),
        crosswalks=len(read),
        crosswalks_off_m=max(gaps, default=0.0),
    )


def crosswalks_as_carla_has_them(world: World, file: OpenDriveFile) -> list[shapely.Polygon]:
    """Return the World's crosswalks, moved as CARLA moves them.

    It measures `t` from lane 0 (Map::GetAllCrosswalkZones), OpenDRIVE from the reference line.
    """
    found = []
    edges = {one.id: crosswalk_edges(one) for one in world.crossings}
    for road in file.roads.values():
        for item in road.element.iterfind("objects/object[@type='crosswalk']"):
            left, right = edges[str(item.get("name"))]
            s = float(item.get("s"))
            heading = road.at(s).heading_rad
            offset = road.element.find("lanes/laneOffset")
            a, b, c, d = ((0.0,) * 4) if offset is None else (float(offset.get(k)) for k in "abcd")
            aside = (a + s * (b + s * (c + s * d))) * np.array([-np.sin(heading), np.cos(heading)])
            found.append(shapely.Polygon(np.concatenate([right, left[::-1]]) + aside))
    return found


def leads(name: str, after: str, follows: dict[str, set[str]]) -> bool:
    """Return whether one follows the other, short ones in between, or is the other."""
    near = {name}
    for _ in range(4):
        if after in near:
            return True
        near |= {following for one in near for following in follows.get(one, ())}
    return False


def judged(worlds: Iterator[tuple[str, World]], folder: Path) -> dict[str, tuple[World, Score]]:
    """Write each World in both versions and score what CARLA reads of them."""
    files = {}
    for name, world in worlds:
        for version in VERSIONS:
            path = folder / f"{name}-{version}.xodr"
            write_opendrive(world, path, version=version)
            files[path] = world
    found = ask_judge("load_carla.py", [str(path) for path in files])
    return {
        path.stem: (world, scored(world, OpenDriveFile.read(path), found[str(path)]))
        for path, world in files.items()
    }


def faults(results: dict[str, tuple[World, Score]]) -> list[str]:
    return [
        f"{name}: {score}"
        for name, (world, score) in results.items()
        if score.off_m > OFF_M
        or score.against
        or score.astray
        or score.lanes_without
        or score.crosswalks != len(world.crossings)
        or score.crosswalks_off_m > OFF_M
        or not score.waypoints
    ]


def test_carla_reads_drawn_worlds_as_they_are(tmp_path: Path) -> None:
    worlds = {
        "right": signalled_crossing(),
        "left": world_of(crossing(origin=IRELAND)),
        "ring": world_of(roundabout()),
        "ring_left": world_of(roundabout(origin=IRELAND, clockwise=True)),
    }
    assert faults(judged(iter(worlds.items()), tmp_path)) == []


@pytest.mark.real_data
def test_carla_reads_a_left_hand_town_as_it_is(data_dir: Path, tmp_path: Path) -> None:
    osm = read_map(data_dir / LEEDS)
    world = build_region(osm, build_road_graph(osm), osm.bounds)
    assert world.intersection.driving_side == "left"
    results = judged(iter([("leeds", world)]), tmp_path)
    assert faults(results) == []
    assert {score.crosswalks for _, score in results.values()} == {len(world.crossings)}


@pytest.mark.real_data
def test_carla_reads_the_sample_as_it_is(data_dir: Path, tmp_path: Path) -> None:
    results = judged(iter(sample_worlds(data_dir)), tmp_path)
    assert len(results) == 120
    assert {world.intersection.driving_side for world, _ in results.values()} == {"left", "right"}
    assert faults(results) == []
