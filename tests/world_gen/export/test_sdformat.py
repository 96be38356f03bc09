"""SDFormat files: the geographic origin, what stands where, what collides, the three vehicles."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree
from shapely import union_all
from shapely.geometry import Point, Polygon

from foretwin.contracts.beside_road import Building
from foretwin.contracts.provenance import Choice, Quantity
from foretwin.contracts.signals import Signal
from foretwin.contracts.vehicle import Parameter, VehicleParameters
from foretwin.contracts.world import ATTRIBUTION, StopLine, World
from foretwin.world_gen.export.choices import VehicleKind
from foretwin.world_gen.export.sdformat import write_sdf
from foretwin.world_gen.export.sdformat_shapes import extrusions
from foretwin.world_gen.export.sdformat_vehicles import SdfVehicle, place_vehicles
from tests.world_gen.drawn_maps import GERMANY, crossing, roundabout, world_of

COVERS = (
    "foretwin.world_gen.export.sdformat_plugins",
    "foretwin.world_gen.export.sdformat_shapes",
    "foretwin.world_gen.export.sdformat_vehicles",
)
_CAR = {
    "mass_kg": 1100.0,
    "yaw_inertia_kgm2": 1800.0,
    "wheelbase_m": 2.6,
    "cog_from_rear_axle_m": 1.4,
    "cog_height_m": 0.6,
    "front_cornering_stiffness_npr": 1.3e5,
    "rear_cornering_stiffness_npr": 1.1e5,
    "friction": 1.05,
    "steering_ratio": 16.0,
    "steering_offset_rad": 0.0,
    "steering_delay_s": 0.1,
    "max_tire_angle_rad": 0.6,
    "max_tire_rate_radps": 0.4,
    "drag_npv2": 0.4,
    "rolling_resistance_n": 100.0,
    "drive_gain": 1.0,
    "brake_gain": 1.0,
    "max_drive_accel_mps2": 4.0,
    "max_brake_decel_mps2": 9.0,
    "wheel_inertia_mass_factor": 1.05,
    "length_m": 4.5,
    "width_m": 1.8,
    "height_m": 1.4,
    "rear_overhang_m": 0.9,
}
CAR = VehicleParameters(name="car", **{key: Parameter(value) for key, value in _CAR.items()})
ALL_KINDS: tuple[tuple[str, VehicleKind], ...] = (
    ("ego", "twin"),
    ("real", "shadow"),
    ("thought", "ghost"),
)
COURTYARD = np.array([[20.0, 20.0], [50.0, 20.0], [50.0, 50.0], [20.0, 50.0]])
YARD = np.array([[30.0, 30.0], [30.0, 40.0], [40.0, 40.0], [40.0, 30.0]])


def built() -> World:
    """Return a crossing with a house around a courtyard, a signal and its line."""
    world = world_of(crossing())
    house = Building(
        id="w20",
        outline=COURTYARD,
        holes=(YARD,),
        height_m=Quantity(12.0, "tagged"),
        min_height_m=3.0,
    )
    line = StopLine(
        id="s",
        lane_id=world.lanes[0].id,
        ends=np.array([[6.0, 3.0], [6.0, 0.0]]),
        control=Choice("signal", "tagged"),
    )
    signal = Signal(
        id="h",
        osm_node=1,
        group_id="g",
        lane_ids=(world.lanes[0].id,),
        position=np.array([6.0, 4.0, 3.0]),
        yaw_rad=0.5,
        source="tagged",
    )
    return msgspec.structs.replace(world, buildings=(house,), stop_lines=(line,), signals=(signal,))


def written(world: World, folder: Path, **options: Any) -> Any:
    """Write a World and return its root element."""
    path = folder / "world.sdf"
    write_sdf(world, path, **options)
    return etree.parse(str(path)).getroot()


def shape_outline(part: Any) -> Polygon:
    """Return where a collision or visual stands, seen from above."""
    x, y, *_, yaw = (float(v) for v in (part.findtext("pose") or "0 0 0 0 0 0").split())
    size = part.findtext("geometry/box/size")
    if size is None:
        points = [p.text.split() for p in part.findall("geometry/polyline/point")]
        return Polygon([(float(a) + x, float(b) + y) for a, b in points])
    length, width, _ = (float(v) for v in size.split())
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [length / 2, width / 2]
    turn = np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]])
    return Polygon(corners @ turn + [x, y])


def test_the_file_has_origin_and_attribution(tmp_path: Path) -> None:
    root = written(built(), tmp_path, simulator="gazebo")
    assert root.get("version") == "1.7"
    where = root.find("world/spherical_coordinates")
    assert float(where.findtext("latitude_deg")) == pytest.approx(GERMANY.lat_deg, abs=1e-8)
    assert float(where.findtext("longitude_deg")) == pytest.approx(GERMANY.lon_deg, abs=1e-8)
    assert where.findtext("world_frame_orientation") == "ENU"
    assert where.findtext("heading_deg") == "0"
    assert root.findtext("world/{*}attribution") == ATTRIBUTION
    (comment,) = (child for child in root if child.tag is etree.Comment)
    assert ATTRIBUTION in comment.text


def test_a_strange_name_does_not_break_the_file(tmp_path: Path) -> None:
    world = built()
    strange = msgspec.structs.replace(world.intersection, name="a -- b \x07 <&> --->")
    written(msgspec.structs.replace(world, intersection=strange), tmp_path)


def test_gazebo_classics_axes_are_turned_back(tmp_path: Path) -> None:
    root = written(built(), tmp_path, simulator="classic")
    assert root.findtext("world/spherical_coordinates/heading_deg") == "180"


def test_buildings_are_shapes_of_one_link_and_leave_the_courtyard_free(tmp_path: Path) -> None:
    root = written(built(), tmp_path)
    (link,) = root.findall("world/model[@name='buildings']/link")
    house = Polygon(COURTYARD, [YARD])
    for tag in ("collision", "visual"):
        covered = union_all([shape_outline(part) for part in link.findall(tag)])
        assert covered.symmetric_difference(house).area < 0.1
    for part in link.findall("collision"):
        middle = float(part.findtext("pose").split()[2])
        size = part.findtext("geometry/box/size")
        if size is None:
            assert middle == 3.0
            assert float(part.findtext("geometry/polyline/height")) == 9.0
        else:
            assert middle == pytest.approx(7.5)
            assert float(size.split()[2]) == 9.0


def test_road_markings_and_signals_are_seen_and_never_touched(tmp_path: Path) -> None:
    world = built()
    root = written(world, tmp_path)
    for name in ("road", "markings", "signals"):
        assert root.find(f"world/model[@name='{name}']/link/visual") is not None
        assert root.find(f"world/model[@name='{name}']/link/collision") is None
    road = union_all(
        [shape_outline(part) for part in root.findall("world/model[@name='road']/link/visual")]
    )
    surface = union_all([Polygon(area.outline, area.holes) for area in world.road_surface])
    assert road.symmetric_difference(surface).area < 0.01 * surface.area
    line = root.find("world/model[@name='markings']/link/visual")
    assert shape_outline(line).centroid.distance(Point(6.0, 1.5)) < 0.01


def test_a_roundabouts_middle_is_solid(tmp_path: Path) -> None:
    root = written(world_of(roundabout()), tmp_path)
    solid = root.findall("world/model[@name='road']/link/collision")
    assert union_all([shape_outline(part) for part in solid]).contains(Point(0.0, 0.0))


@pytest.mark.parametrize("simulator", ["classic", "gazebo"])
def test_a_twin_weighs_and_balances_as_its_parameters_say(tmp_path: Path, simulator: Any) -> None:
    vehicles = place_vehicles(built(), ALL_KINDS, CAR)
    root = written(built(), tmp_path, simulator=simulator, vehicles=vehicles)
    masses, places, yaw_inertias = [], [], []
    for link in root.findall("world/model[@name='ego']/link"):
        at = np.array([float(v) for v in (link.findtext("pose") or "0 0 0").split()[:3]])
        inner = link.findtext("inertial/pose") or "0 0 0"
        masses.append(float(link.findtext("inertial/mass")))
        places.append(at + [float(v) for v in inner.split()[:3]])
        yaw_inertias.append(float(link.findtext("inertial/inertia/izz")))
    mass, place = np.array(masses), np.array(places)
    cog = (mass[:, None] * place).sum(axis=0) / mass.sum()
    assert mass.sum() == pytest.approx(1100.0, rel=1e-4)
    np.testing.assert_allclose(cog, [1.4, 0.0, 0.6], atol=2e-3)
    arms = ((place[:, :2] - cog[:2]) ** 2).sum(axis=1)
    assert (mass * arms).sum() + sum(yaw_inertias) == pytest.approx(1800.0, rel=0.01)


def test_a_twin_steers_and_tells_its_position(tmp_path: Path) -> None:
    vehicles = place_vehicles(built(), ALL_KINDS, CAR)
    classic = written(built(), tmp_path, simulator="classic", vehicles=vehicles)
    twin = classic.find("world/model[@name='ego']")
    plugin = twin.find("plugin")
    assert plugin.get("filename") == "libgazebo_ros_ackermann_drive.so"
    joints = {joint.get("name"): joint for joint in twin.findall("joint")}
    named = {e.text for e in plugin if e.tag.endswith("_joint")}
    assert named <= set(joints)
    assert len(named) == 6
    assert joints["front_left_steer_joint"].findtext("axis/xyz") == "0 0 1"
    # The inner wheel turns further than a bicycle's.
    assert float(joints["front_left_steer_joint"].findtext("axis/limit/upper")) > 0.6
    assert twin.find("link/sensor[@type='gps']/plugin").get("filename") == (
        "libgazebo_ros_gps_sensor.so"
    )
    gazebo = written(built(), tmp_path, simulator="gazebo", vehicles=vehicles)
    twin = gazebo.find("world/model[@name='ego']")
    assert twin.find("plugin").get("name") == "gz::sim::systems::AckermannSteering"
    assert twin.find("link/sensor[@type='gps']/plugin") is None
    systems = {plugin.get("name") for plugin in gazebo.findall("world/plugin")}
    assert "gz::sim::systems::NavSat" in systems


def test_a_shadow_collides_and_a_ghost_does_not(tmp_path: Path) -> None:
    vehicles = place_vehicles(built(), ALL_KINDS, CAR)
    root = written(built(), tmp_path, vehicles=vehicles)
    for name in ("real", "thought"):
        model = root.find(f"world/model[@name='{name}']")
        assert model.findtext("link/gravity") == "0"
        assert model.findtext("link/kinematic") == "1"
        assert model.find("joint") is None
        assert (model.find("link/collision") is not None) == (name == "real")
        box = shape_outline(model.find("link/visual"))
        # base_link is the rear axle's centre: 0.9 m of the car are behind it.
        np.testing.assert_allclose(box.bounds, [-0.9, -0.9, 3.6, 0.9], atol=1e-3)


def test_vehicles_begin_apart_on_lanes_in_driving_direction() -> None:
    world = built()
    placed = place_vehicles(world, [(f"v{i}", "twin") for i in range(9)], CAR)
    places = np.array([(v.x_m, v.y_m) for v in placed])
    gaps = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    assert gaps[~np.eye(9, dtype=bool)].min() > 5.0
    for vehicle in placed:
        lane = min(
            world.lanes,
            key=lambda lane: np.hypot(*(lane.centerline - [vehicle.x_m, vehicle.y_m]).T).min(),
        )
        ahead = np.array([math.cos(vehicle.yaw_rad), math.sin(vehicle.yaw_rad)])
        assert ahead @ (lane.centerline[-1] - lane.centerline[0]) > 0.0


def test_wrong_vehicles_and_simulators_are_named(tmp_path: Path) -> None:
    car = SdfVehicle(name="road", kind="ghost", parameters=CAR)
    with pytest.raises(ValueError, match="'road' is taken"):
        write_sdf(built(), tmp_path / "w.sdf", vehicles=[car])
    with pytest.raises(ValueError, match="classic, gazebo"):
        write_sdf(built(), tmp_path / "w.sdf", simulator="morse")  # type: ignore[arg-type]


@given(
    holes=st.lists(st.tuples(st.integers(1, 8), st.integers(1, 8)), max_size=6, unique=True),
    size=st.floats(0.3, 0.8),
)
def test_extrusions_cover_a_polygon_and_none_of_its_holes(
    holes: list[tuple[int, int]], size: float
) -> None:
    outline = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
    rings = [
        np.array([[x, y], [x + size, y], [x + size / 3, y + size / 3], [x, y + size]])
        for x, y in holes
    ]
    wanted = Polygon(outline, rings)
    pieces = [Polygon(ring) for ring in extrusions(outline, rings)]
    assert all(piece.is_valid and not piece.interiors for piece in pieces)
    assert union_all(pieces).symmetric_difference(wanted).area < 0.06 * (1 + len(holes))
    assert sum(piece.area for piece in pieces) == pytest.approx(wanted.area, rel=0.01)


def test_extrusions_of_what_is_no_area_and_of_a_bow_tie() -> None:
    assert extrusions(np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])) == []
    bow_tie = np.array([[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0]])
    assert sorted(Polygon(ring).area for ring in extrusions(bow_tie)) == [1.0, 1.0]
