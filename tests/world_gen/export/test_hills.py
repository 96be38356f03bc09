"""A crossing on a hillside in all formats that have heights."""

from __future__ import annotations

import json
from collections import defaultdict
from functools import cache
from pathlib import Path

import msgspec
import numpy as np
import pytest
from lxml import etree

from foretwin.contracts.arrays import Array
from foretwin.contracts.elevation import Elevation, HeightProfile
from foretwin.contracts.world import World
from foretwin.geometry.world_heights import WorldHeights, heights_of
from foretwin.world_gen.export.formats import FORMATS, ExportOptions
from foretwin.world_gen.export.geojson import geojson_of
from foretwin.world_gen.export.opendrive import write_opendrive
from foretwin.world_gen.export.opendrive_cubics import Cubic, Rise
from foretwin.world_gen.export.sdformat import write_sdf
from foretwin.world_gen.export.terrain import draped, ground_mesh, road_mesh
from tests.world_gen.drawn_maps import drawn_map
from tests.world_gen.export.lanelet2_file import written
from tests.world_gen.export.read_opendrive import FileRoad, OpenDriveFile
from tests.world_gen.ground.test_heights import world_on

COVERS = (
    "foretwin.world_gen.export.opendrive_cubics",
    "foretwin.world_gen.export.sdformat_hills",
    "foretwin.world_gen.export.terrain",
)


def hillside(x: Array, y: Array) -> Array:
    return 300.0 + 0.07 * x + 0.0002 * y * y


@cache
def hilly() -> World:
    return world_on(hillside)


def hills() -> WorldHeights:
    found = heights_of(hilly())
    assert found is not None
    return found


def elevation() -> Elevation:
    assert not isinstance(hilly().elevation, msgspec.UnsetType)
    return hilly().elevation


@pytest.mark.parametrize("version", ["1.8", "1.4"])
def test_opendrive_roads_join_at_one_height_and_grade(tmp_path: Path, version: str) -> None:
    write_opendrive(hilly(), tmp_path / "h.xodr", version=version)  # type: ignore[arg-type]
    file = OpenDriveFile.read(tmp_path / "h.xodr")
    seen = 0
    for joint in file.joints():
        (a, end_a, _), (b, end_b, _) = joint
        one, other = a.height_m(a.s_of(end_a)), b.height_m(b.s_of(end_b))
        assert one == pytest.approx(other, abs=0.002)
        assert _outward(a, end_a) == pytest.approx(-_outward(b, end_b), abs=0.004)
        seen += 1
    assert seen >= 12
    steep = [abs(road.grade(road.length_m / 2)) for road in file.roads.values()]
    assert max(steep) == pytest.approx(0.07, abs=0.02)


def _outward(road: FileRoad, end: str) -> float:
    grade = road.grade(road.s_of(end))
    return grade if end == "end" else -grade


def test_opendrive_roads_lie_where_the_world_s_do(tmp_path: Path) -> None:
    write_opendrive(hilly(), tmp_path / "h.xodr")
    file = OpenDriveFile.read(tmp_path / "h.xodr")
    sources = {road.source: road for road in file.roads.values()}
    for road in hilly().roads:
        profile, written_road = hills().road(road.id), sources[road.id]
        assert profile is not None
        for share in (0.0, 0.3, 0.77, 1.0):
            found = written_road.height_m(share * written_road.length_m)
            asked = float(profile.height_at(np.array([share * profile.along_m[-1]]))[0])
            assert found == pytest.approx(asked, abs=0.03)


def test_a_rise_between_two_grades_is_a_hermite_cubic() -> None:
    rise = Rise.joining(1.0, 0.1, 2.0, -0.05, 20.0)
    assert (rise.at(0.0), rise.at(20.0)) == pytest.approx((1.0, 2.0))
    assert (rise.slope_at(0.0), rise.slope_at(20.0)) == pytest.approx((0.1, -0.05))
    assert Rise.joining(3.0, 0.0, 3.0, 0.0, 9.0).pieces == ((0.0, Cubic(3.0)),)


def test_a_profile_is_stretched_to_its_curve() -> None:
    profile = HeightProfile(
        id="r",
        along_m=np.array([0.0, 10.0, 30.0]),
        height_m=np.array([0.0, 1.0, 1.0]),
        grade=np.array([0.0, 0.1, 0.0]),
    )
    rise = Rise.of(profile, 33.0)
    assert [rise.at(11.0), rise.at(22.0)] == pytest.approx(
        profile.height_at(np.array([10.0, 20.0])).tolist()
    )
    assert rise.slope_at(11.0) == pytest.approx(0.1 / 1.1)


def test_lanelet2_nodes_lie_above_the_sea(tmp_path: Path) -> None:
    FORMATS["lanelet2"].write(hilly(), tmp_path / "h.osm", ExportOptions())
    root = etree.parse(str(tmp_path / "h.osm")).getroot()
    for node in root.iter("node"):
        tags = {tag.get("k"): float(tag.get("v")) for tag in node.iter("tag") if _is_number(tag)}
        x, y = np.array([tags["local_x"]]), np.array([tags["local_y"]])
        assert tags["ele"] == pytest.approx(float(hillside(x, y)[0]), abs=2.5)


def _is_number(tag: etree._Element) -> bool:
    return tag.get("k") in ("local_x", "local_y", "ele")


def test_lanelet2_borders_are_shared_at_one_height(tmp_path: Path) -> None:
    read = written(hilly(), tmp_path)
    assert read  # the reader refuses a node that stands twice


def test_geojson_has_heights_as_third_numbers() -> None:
    places = defaultdict(list)
    for feature in geojson_of(hilly())["features"]:
        geometry = feature["geometry"]
        flat = np.array(list(_flat(geometry["coordinates"])))
        assert flat.shape[1] == 3
        places[feature["properties"]["kind"]].extend(flat[:, 2])
    assert np.ptp(places["lane"]) == pytest.approx(np.ptp(places["road"]), abs=1.5)
    assert np.mean(places["lane"]) == pytest.approx(300.0, abs=8.0)
    assert json.dumps(geojson_of(world_on(None))).count("elevation") == 0


def _flat(nested: list) -> list:  # type: ignore[type-arg]
    if not isinstance(nested[0], list):
        return [nested]
    return [point for part in nested for point in _flat(part)]


def test_meshes_face_upwards_and_lie_on_the_hill() -> None:
    roads = draped([(a.outline, a.holes) for a in hilly().road_surface], hills(), above_m=0.01)
    ground = ground_mesh(hilly(), hills())
    for mesh in (roads, ground):
        a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
        assert (np.cross(b - a, c - a)[:, 2] > 0.0).all()
    area = sum(_area(a.outline) - sum(map(_area, a.holes)) for a in hilly().road_surface)
    a, b, c = (roads.points[roads.triangles[:, k], :2] for k in range(3))
    across = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    assert across.sum() / 2.0 == pytest.approx(area, rel=1e-3)
    high = hillside(*roads.points[:, :2].T) - elevation().base_m
    assert roads.points[:, 2] == pytest.approx(high, abs=2.0)


def test_the_ground_nowhere_looks_through_the_road() -> None:
    roads = draped([(a.outline, a.holes) for a in hilly().road_surface], hills(), above_m=0.01)
    ground = ground_mesh(hilly(), hills())
    rows, columns = elevation().ground_m.shape
    lowered = msgspec.structs.replace(
        elevation(), ground_m=ground.points[:, 2].reshape(rows, columns)
    )
    middles = roads.points[roads.triangles].mean(axis=1)
    assert (middles[:, 2] > lowered.ground_at(middles[:, :2])).all()


def test_tunnels_and_bridges_are_strips_at_their_own_height() -> None:
    def ridge(x: Array, y: Array) -> Array:
        return 100.0 + 60.0 * np.exp(-np.square(x - 90.0) / 40.0**2)

    street, tunnel = {"highway": "residential"}, {"highway": "residential", "tunnel": "yes"}
    nodes = {i: (100.0 * i - 700.0, 0.0) for i in range(15)} | {20: (0.0, -400.0), 21: (0.0, 400.0)}
    ways = [
        (1, [0, 1, 2, 3, 4, 5, 6, 7], street),
        (2, [7, 8, 9], tunnel),
        (3, list(range(9, 15)), street),
        (4, [20, 7, 21], street),
    ]
    world = world_on(ridge, drawn_map(nodes, ways))
    own = heights_of(world)
    assert own is not None
    mesh = road_mesh(world, own, above_m=0.0)
    ground = ground_mesh(world, own)

    inside = (np.abs(mesh.points[:, 0] - 90.0) < 10.0) & (np.abs(mesh.points[:, 1]) < 5.0)
    above = np.hypot(*(ground.points[:, :2] - (90.0, 0.0)).T) < 10.0
    assert inside.any()
    assert mesh.points[inside, 2].max() < ground.points[above, 2].min() - 10.0
    a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    assert (normal[:, 2] > 0.0).all()
    assert (np.hypot(*normal[:, :2].T) / normal[:, 2]).max() < 0.5


def _area(ring: Array) -> float:
    ahead = np.roll(ring, -1, axis=0)
    return abs(float((ring[:, 0] * ahead[:, 1] - ahead[:, 0] * ring[:, 1]).sum())) / 2.0


def test_sdformat_names_its_meshes_and_how_high_it_lies(tmp_path: Path) -> None:
    write_sdf(hilly(), tmp_path / "h.sdf")
    root = etree.parse(str(tmp_path / "h.sdf")).getroot()
    named = {uri.text for uri in root.iter("uri")}
    assert {"h.ground.obj", "h.road.obj"} <= named
    assert all((tmp_path / name).is_file() for name in named if name and name.endswith(".obj"))
    assert float(root.find(".//elevation").text) == pytest.approx(elevation().base_m, abs=0.01)
    assert root.find(".//plane") is None
    flat = tmp_path / "flat"
    flat.mkdir()
    write_sdf(world_on(None), flat / "h.sdf")
    assert [path.name for path in flat.iterdir()] == ["h.sdf"]
