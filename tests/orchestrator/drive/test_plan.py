"""What a drive needs is read first and checked whole; then, and not before, a folder is made."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import msgspec
import numpy as np
import pytest

from foretwin.contracts.anchor import Anchor, AnchorLine, AnchorPose
from foretwin.contracts.credentials import read_credentials
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import geo_from_local, local_from_geo
from foretwin.orchestrator.config import ConfigError, DriveConfig
from foretwin.orchestrator.drive.plan import make_plan, read_inputs, starts_a_car
from foretwin.orchestrator.drive.processes import PROCESSES, ROUTER, process_ids
from foretwin.orchestrator.drive.router_start import on_local_bus
from foretwin.orchestrator.embedded import MAP_FILE
from foretwin.orchestrator.other_vehicle_config import OtherVehicleConfig
from foretwin.orchestrator.worlds.opening import open_map
from foretwin.world_gen.junctions.intersections import junctions_on_route
from tests.orchestrator.trip import NOW, town, town_line, town_plan
from tests.orchestrator.worlds.tidal_street import TidalStreet
from tests.world_gen.sketch import Sketch

COVERS = ("foretwin.orchestrator.plan",)


def inputs_for(folder: Path, **settings: object) -> object:
    config = DriveConfig(view="none", out=str(folder / "runs"), **settings)  # type: ignore[arg-type]
    return read_inputs(config.validate())


def test_without_arguments_the_stand_in_car_drives_through_the_drawn_town() -> None:
    inputs = town()

    assert inputs.map_file == MAP_FILE
    assert (inputs.route_source, len(inputs.routes)) == ("given", 1)
    assert inputs.standin is not None
    assert (inputs.log_file, inputs.info) == (None, None)
    assert inputs.commands_recorded  # the stand-in publishes its own
    start = local_from_geo(inputs.drive_frame, inputs.standin.lat_deg[0], inputs.standin.lon_deg[0])
    assert start == pytest.approx([0.0, 0.0], abs=1e-6)


def test_of_a_route_that_leaves_the_map_for_long_the_stand_in_says_how_much_it_drives(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = geo_from_local(town().graph.frame, town_line())
    half = len(line) // 2
    away = line[half] + [0.02, 0.0]  # 2 km to the north
    file = tmp_path / "route.geojson"
    there = np.concatenate([line[:half], [away], line[half:]])[:, ::-1]
    file.write_text(json.dumps({"type": "LineString", "coordinates": there.tolist()}))
    inputs = inputs_for(tmp_path, route=str(file))

    assert len(inputs.routes) > 1  # type: ignore[attr-defined]
    driven_m = inputs.routes[0].end_m  # type: ignore[attr-defined]
    assert f"the stand-in car drives the first, {driven_m:.0f} m\n" in capsys.readouterr().err
    inputs_for(tmp_path)
    assert capsys.readouterr().err == ""


def test_reading_writes_nothing_and_planning_makes_the_runs_folder(tmp_path: Path) -> None:
    inputs = inputs_for(tmp_path)
    assert list(tmp_path.iterdir()) == []

    plan = make_plan(inputs, NOW)  # type: ignore[arg-type]
    assert plan.folder.parent == (tmp_path / "runs").resolve()
    assert plan.run_id.startswith("20300102-030405-")
    assert {p.name for p in plan.folder.iterdir()} == {"worlds", "results", "processes"}
    path = json.loads(plan.standin_path_file.read_text())
    assert set(path) == {"lat_deg", "lon_deg", "speed_mps"}


def test_two_runs_of_one_second_have_folders_of_their_own(tmp_path: Path) -> None:
    one, two = (town_plan(tmp_path) for _ in range(2))

    assert one.folder != two.folder


def test_a_bus_of_lock_step_loses_nothing(tmp_path: Path) -> None:
    assert town_plan(tmp_path, speed=None).bus.lossless
    assert not town_plan(tmp_path, speed=2.0).bus.lossless


def test_without_an_endpoint_the_bus_is_a_socket_on_which_each_process_has_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    config = DriveConfig(view="none", out=str(tmp_path))
    plan = on_local_bus(make_plan(replace(town(), config=config), NOW))

    folder = tmp_path / "foretwin" / plan.run_id
    assert plan.bus.endpoint == f"unixsock-stream/{folder / 'bus'}"
    setups = [row.setup(plan, one) for row in PROCESSES for one in process_ids(row, plan)]
    shown = [setup.bus.credentials for setup in setups if setup.process_id != ROUTER]
    assert len({*shown, plan.bus.credentials}) == len(shown) + 1
    assert all(Path(one).parent == folder for one in shown)
    passwords = [read_credentials(Path(one)).password for one in shown]
    texts = [file.read_bytes() for file in plan.folder.rglob("*") if file.is_file()]
    texts += [msgspec.json.encode(setup) for setup in setups]
    assert not any(password.encode() in text for password in passwords for text in texts)
    assert on_local_bus(town_plan(tmp_path)).bus.endpoint == "tcp/127.0.0.1:7447"


@pytest.mark.parametrize(("display", "live"), [("", "none"), (":0", "native")])
def test_view_auto_is_a_window_where_there_is_a_display(
    display: str, live: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("DISPLAY", display)

    assert make_plan(
        replace(town(), config=DriveConfig(view="auto", out=str(tmp_path))), NOW
    ).live_view == live  # fmt: skip


def gpx(folder: Path, xy: np.ndarray) -> Path:
    geo = geo_from_local(town().graph.frame, xy)
    points = "".join(
        f'<trkpt lat="{lat:.9f}" lon="{lon:.9f}">'
        f"<time>2030-01-01T00:{k // 60:02d}:{k % 60:02d}Z</time></trkpt>"
        for k, (lat, lon) in enumerate(geo)
    )
    file = folder / "drive.gpx"
    file.write_text(
        f'<gpx version="1.1" creator="test" xmlns="http://www.topografix.com/GPX/1/1">'
        f"<trk><trkseg>{points}</trkseg></trk></gpx>"
    )
    return file


def test_a_log_gives_the_drives_frame_and_on_request_its_route(tmp_path: Path) -> None:
    log = gpx(tmp_path, town_line()[::8])
    settings = {"map": str(MAP_FILE), "log": str(log)}
    predicted = inputs_for(tmp_path, **settings)
    followed = inputs_for(tmp_path, route="from-log", **settings)

    assert (predicted.routes, predicted.route_source) == ((), "predicted")  # type: ignore[attr-defined]
    assert followed.route_source == "from-log"  # type: ignore[attr-defined]
    (route,) = followed.routes  # type: ignore[attr-defined]
    names = [e.edge.way_id for e in route.edges]
    assert set(names) == {e.edge.way_id for e in town().routes[0].edges}
    assert predicted.standin is None  # type: ignore[attr-defined]
    assert not predicted.commands_recorded  # type: ignore[attr-defined]
    assert predicted.info.vehicle_id  # type: ignore[attr-defined]


def test_a_live_car_behind_no_gateway_of_ours_needs_no_certificate_of_the_drives() -> None:
    second = OtherVehicleConfig(id="second", live=True)
    gateway = msgspec.structs.replace(second, ros2="second.toml")
    assert starts_a_car(DriveConfig())
    assert not starts_a_car(DriveConfig(source="live", vehicles=(second,)))
    assert starts_a_car(DriveConfig(source="live", vehicles=(second, gateway)))
    assert starts_a_car(DriveConfig(source="live", ros2="autoware"))


def test_a_log_driven_elsewhere_is_refused_with_both_places(tmp_path: Path) -> None:
    places = town_line()[::8] + 20_000.0
    log = gpx(tmp_path, places)

    with pytest.raises(UserError, match="holds no position of the drive") as refused:
        inputs_for(tmp_path, map=str(MAP_FILE), log=str(log))
    assert str(log) in str(refused.value)
    begins = ", ".join(f"{one:.5f}" for one in geo_from_local(town().graph.frame, places[0]))
    assert f"which begins at {begins}); the map covers" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_stretch_without_positions_is_refused(tmp_path: Path) -> None:
    log = gpx(tmp_path, town_line()[::8])

    with pytest.raises(UserError, match="--start"):
        inputs_for(tmp_path, map=str(MAP_FILE), log=str(log), start_s=5000.0)


def test_an_unknown_planner_is_refused_before_the_map_is_read(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="pure_pursuit_idm"):
        inputs_for(tmp_path, planner="telepathy", map=str(tmp_path / "none.osm"), route="x.gpx")


def _yard(folder: Path) -> tuple[str, str]:
    """Write a street with a driveway to a yard and a lane to a field, and a route into the yard."""
    sketch = Sketch()
    for node, x_m, y_m in (
        (1, -200.0, 0.0), (2, 0.0, 0.0), (3, 200.0, 0.0), (4, 0.0, 60.0), (5, 100.0, 0.0),
        (6, 100.0, -60.0),
    ):  # fmt: skip
        sketch.node(node, x_m, y_m)
    sketch.road(10, [1, 2, 5, 3], "Street")
    sketch.road(11, [2, 4], highway="service")
    sketch.road(12, [5, 6], highway="service")
    (folder / "yard.osm").write_text(sketch.xml(), encoding="utf-8")
    line = geo_from_local(sketch.frame, [[-180.0, 0.0], [0.0, 0.0], [0.0, 55.0]]).tolist()  # type: ignore[arg-type]
    geometry = {"type": "LineString", "coordinates": [[lon, lat] for lat, lon in line]}
    (folder / "route.geojson").write_text(json.dumps(geometry), encoding="utf-8")
    return str(folder / "yard.osm"), str(folder / "route.geojson")


def test_where_the_route_leaves_the_street_a_driveway_makes_a_junction(tmp_path: Path) -> None:
    map_file, route = _yard(tmp_path)

    inputs = inputs_for(tmp_path, map=map_file, route=route)

    assert [j.summary.id for j in inputs.junctions] == ["n2"]  # type: ignore[attr-defined]
    assert {inputs.graph.edges[i].way_id for i in inputs.added_roads} == {11}  # type: ignore[attr-defined]


def test_by_choice_every_driveway_makes_a_junction(tmp_path: Path) -> None:
    map_file, route = _yard(tmp_path)

    inputs = inputs_for(tmp_path, map=map_file, route=route, service_roads=True)

    assert [j.summary.id for j in inputs.junctions] == ["n2", "n5"]  # type: ignore[attr-defined]


def test_a_tidal_road_runs_as_the_route_drives_it(tmp_path: Path) -> None:
    street = TidalStreet(tmp_path)
    routed = inputs_for(tmp_path, map=str(street.map_file), route=str(street.eastward))
    assert all(item.allowed for item in routed.routes[0].edges)  # type: ignore[attr-defined]


@pytest.mark.real_data
def test_of_a_large_map_the_surroundings_of_the_drive_are_read(
    data_dir: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = {
        "map": str(data_dir / "osm-badhersfeld" / "badhersfeld.osm.xml.gz"),
        "route": str(_way_through_badhersfeld(tmp_path)),
    }
    whole = inputs_for(tmp_path, **settings)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(
        "foretwin.orchestrator.drive.plan.open_map", partial(open_map, large_bytes=1)
    )
    monkeypatch.setattr("foretwin.orchestrator.drive.plan.CORRIDOR_M", 300.0)

    part = inputs_for(tmp_path, **settings)

    assert len(part.osm.ways) < 0.7 * len(whole.osm.ways)  # type: ignore[attr-defined]
    passed = [
        [passage.junction.summary for passage in junctions_on_route(i.junctions, i.routes[0].edges)]  # type: ignore[attr-defined]
        for i in (whole, part)
    ]
    assert len(passed[0]) == 2
    assert passed[0] == passed[1]


def _way_through_badhersfeld(folder: Path) -> Path:
    line = [[9.7126, 50.8701], [9.7155, 50.8706]]
    path = folder / "through.geojson"
    path.write_text(json.dumps({"type": "LineString", "coordinates": line}), encoding="utf-8")
    return path


def test_a_car_on_a_lot_drives_where_its_anchor_says(tmp_path: Path) -> None:
    """The log lies where the anchor's lot is; the route is matched where that is in the World."""
    line = town_line()[::20]
    frame = town().graph.frame
    anchor = Anchor(
        lot=AnchorPose(lat_deg=52.4739, lon_deg=13.395, yaw_deg=30.0),
        world=AnchorPose(lat_deg=frame.origin.lat_deg, lon_deg=frame.origin.lon_deg, yaw_deg=-20.0),
    )
    geo = geo_from_local(frame, line)
    there = AnchorLine(geo[:, 0], geo[:, 1], np.zeros(len(geo)))
    on_lot = anchor.lot_from_world_line(there)
    log, file = tmp_path / "lot.gpx", tmp_path / "lot.toml"
    points = "".join(
        f'<trkpt lat="{lat:.9f}" lon="{lon:.9f}"><time>2026-01-01T00:{n // 60:02d}:{n % 60:02d}Z'
        "</time></trkpt>"
        for n, (lat, lon) in enumerate(zip(on_lot.lat_deg, on_lot.lon_deg, strict=True))
    )
    log.write_text(f'<gpx version="1.1"><trk><trkseg>{points}</trkseg></trk></gpx>')
    pose = "lat_deg = {0.lat_deg}\nlon_deg = {0.lon_deg}\nyaw_deg = {0.yaw_deg}\n"
    file.write_text(f"[lot]\n{pose.format(anchor.lot)}[world]\n{pose.format(anchor.world)}")
    settings = {"map": str(MAP_FILE), "log": str(log), "route": "from-log"}
    inputs = inputs_for(tmp_path, anchor=str(file), **settings)
    assert inputs.lot == anchor  # type: ignore[attr-defined]
    origin = inputs.drive_frame.origin  # type: ignore[attr-defined]
    begin = local_from_geo(frame, origin.lat_deg, origin.lon_deg)
    assert begin == pytest.approx(line[0], abs=0.01)
    with pytest.raises(UserError, match="holds no position"):
        inputs_for(tmp_path, **settings)
    with pytest.raises(ConfigError, match=r"scale = 1, but vehicle f1tenth is one of scale 10: "):
        inputs_for(tmp_path, anchor=str(file), vehicle="f1tenth", **settings)
    small = tmp_path / "small.toml"
    small.write_text(f"scale = 10.0\n{file.read_text()}")
    with pytest.raises(ConfigError, match=r"scale = 10, but vehicle bmw_320i is one of scale 1: "):
        inputs_for(tmp_path, anchor=str(small), **settings)
