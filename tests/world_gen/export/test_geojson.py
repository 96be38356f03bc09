"""GeoJSON files: coordinates that come back, rings the right way round, sources of values."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import shapely

from foretwin.contracts.beside_road import Building
from foretwin.contracts.frames import GeoPoint, local_from_geo
from foretwin.contracts.provenance import Choice, Quantity
from foretwin.contracts.signals import Signal
from foretwin.contracts.world import ATTRIBUTION, Area, Conflict, Crossing, World
from foretwin.world_gen.export.geojson import write_geojson
from tests.world_gen.drawn_maps import crossing, world_of

FIJI = GeoPoint(-17.0, 179.9999)


def built(origin: GeoPoint | None = None) -> World:
    """Return a crossing with one of everything that a World can hold."""
    world = world_of(crossing(**({"origin": origin} if origin else {})))
    square = np.array([[20.0, 20.0], [20.0, 40.0], [40.0, 40.0], [40.0, 20.0]])  # clockwise
    first, second = world.connections[0], world.connections[-1]
    return msgspec.structs.replace(
        world,
        buildings=(
            Building(
                id="w20",
                outline=square,
                holes=(square[::-1] * 0.5 + 15.0,),
                height_m=Quantity(12.0, "tagged"),
            ),
        ),
        crossings=(
            Crossing(
                id="c",
                line=np.array([[8.0, -3.0], [8.0, 3.0]]),
                width_m=Quantity(4.0, "default"),
                kind=Choice("zebra", "tagged"),
                osm_node=7,
            ),
        ),
        signals=(
            Signal(
                id="h",
                osm_node=1,
                group_id="g",
                lane_ids=(world.lanes[0].id,),
                position=np.array([6.0, 4.0, 3.0]),
                yaw_rad=0.5,
                source="inferred",
            ),
        ),
        sidewalks=(Area(id="walk", outline=square[::-1], source="tagged"),),
        conflicts=(
            Conflict(
                first_id=first.id,
                second_id=second.id,
                kind="crossing",
                point=np.zeros(2),
                area=square / 20.0,
                yields_id=first.id,
                rule="near_side",
                source="inferred",
            ),
        ),
    )


def features(world: World, folder: Path) -> dict[str, list[Any]]:
    """Write a World and return its features by kind."""
    path = folder / "world.geojson"
    write_geojson(world, path)
    collection = json.loads(path.read_text(encoding="utf-8"))
    assert collection["type"] == "FeatureCollection"
    assert collection["attribution"] == ATTRIBUTION
    found: dict[str, list[Any]] = {}
    for feature in collection["features"]:
        found.setdefault(feature["properties"]["kind"], []).append(feature)
    return found


def metres(world: World, lon_lat: Any) -> np.ndarray[Any, Any]:
    points = np.asarray(lon_lat, dtype=np.float64).reshape(-1, 2)
    return local_from_geo(world.frame, points[:, 1], points[:, 0])


def test_each_thing_of_the_world_is_a_feature(tmp_path: Path) -> None:
    world = built()
    found = features(world, tmp_path)
    for kind, things in (
        ("lane", world.lanes),
        ("connection", world.connections),
        ("stop_line", world.stop_lines),
        ("crossing", world.crossings),
        ("signal", world.signals),
        ("road", world.roads),
        ("conflict", world.conflicts),
        ("building", world.buildings),
        ("junction", world.junctions),
        ("road_surface", world.road_surface),
        ("sidewalk", world.sidewalks),
    ):
        assert len(things) > 0, kind
        assert len(found[kind]) == len(things), kind
    names = [feature["id"] for group in found.values() for feature in group]
    assert len(set(names)) == len(names)


def test_lines_come_back_within_a_millimetre(tmp_path: Path) -> None:
    world = built()
    found = features(world, tmp_path)
    for kind, things in (("lane", world.lanes), ("connection", world.connections)):
        for feature, thing in zip(found[kind], things, strict=True):
            back = metres(world, feature["geometry"]["coordinates"])
            np.testing.assert_allclose(back, thing.centerline, atol=1e-3)
    at = metres(world, found["signal"][0]["geometry"]["coordinates"])
    np.testing.assert_allclose(at, [[6.0, 4.0]], atol=1e-3)


def test_rings_are_closed_and_follow_the_right_hand_rule(tmp_path: Path) -> None:
    world = built()
    polygons = [
        feature["geometry"]["coordinates"]
        for group in features(world, tmp_path).values()
        for feature in group
        if feature["geometry"]["type"] == "Polygon"
    ]
    assert len(polygons) >= 5
    for rings in polygons:
        for number, ring in enumerate(rings):
            assert ring[0] == ring[-1]
            x, y = metres(world, ring).T
            doubled_area = (x[:-1] * y[1:] - x[1:] * y[:-1]).sum()
            assert (doubled_area > 0.0) == (number == 0)
    assert any(len(rings) == 2 for rings in polygons)


@pytest.mark.parametrize("origin", [None, FIJI])
def test_another_reader_takes_every_geometry(origin: GeoPoint | None, tmp_path: Path) -> None:
    features(built(origin), tmp_path)
    read = shapely.from_geojson((tmp_path / "world.geojson").read_text(encoding="utf-8"))
    geometries = shapely.get_parts(read)
    assert len(geometries) > 20
    assert all(geometry.is_valid and not geometry.is_empty for geometry in geometries)


def test_values_say_where_they_come_from(tmp_path: Path) -> None:
    found = features(built(), tmp_path)
    assert found["building"][0]["properties"]["height_m"] == 12.0
    assert found["building"][0]["properties"]["height_m_source"] == "tagged"
    assert found["crossing"][0]["properties"]["width_m_source"] == "default"
    assert found["signal"][0]["properties"]["source"] == "inferred"
    conflict = found["conflict"][0]["properties"]
    assert conflict["yields_id"] == conflict["first_id"]
    assert conflict["rule"] == "near_side"
    lane = found["lane"][0]["properties"]
    assert {lane[key] for key in lane if key.endswith("_source")} <= {
        "tagged",
        "inferred",
        "default",
    }
    assert len([key for key in lane if key.endswith("_source")]) == 5
    assert found["junction"][0]["properties"]["control"] == "uncontrolled"
    assert len(found["junction"][0]["properties"]["arms"]) == 4


@pytest.mark.parametrize("origin", [FIJI, GeoPoint(-17.0, -179.9999)])
def test_what_crosses_the_antimeridian_is_cut_there(origin: GeoPoint, tmp_path: Path) -> None:
    world = built(origin)
    found = features(world, tmp_path)
    surfaces = [feature["geometry"] for feature in found["road_surface"]]
    cut = [surface for surface in surfaces if surface["type"] == "MultiPolygon"]
    assert cut
    for polygon in [part for surface in cut for part in surface["coordinates"]]:
        lon = np.array(polygon[0])[:, 0]
        assert lon.max() - lon.min() < 0.01
        assert np.abs(lon).max() <= 180.0
        x, y = metres(world, polygon[0]).T
        assert (x[:-1] * y[1:] - x[1:] * y[:-1]).sum() > 0.0
