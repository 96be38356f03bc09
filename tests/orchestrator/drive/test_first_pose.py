"""An anchor without a lot: a recorded drive's or a real car's first settled pose is it."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from foretwin.contracts.anchor import AnchorPose
from foretwin.contracts.anchor_file import AnchorFile, read_anchor
from foretwin.contracts.arrays import Array
from foretwin.contracts.bus import ZenohBus
from foretwin.contracts.errors import UserError
from foretwin.contracts.foreign_bus import ZenohForeignBus
from foretwin.contracts.frames import geo_from_local, local_from_geo
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.setup import BusSetup
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator.config import ConfigError, DriveConfig
from foretwin.orchestrator.drive import first_pose
from foretwin.orchestrator.drive.first_pose import with_first_pose
from foretwin.orchestrator.drive.plan import make_plan
from foretwin.orchestrator.drive.ros2_mapping import read_ros2
from foretwin.orchestrator.embedded import MAP_FILE
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.lot_car.lot_car import LotCar
from foretwin.telemetry.ros2.mapping import MappingFile
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.source import StandinSource
from tests.orchestrator.drive.test_plan import gpx, inputs_for
from tests.orchestrator.trip import NOW, town, town_line
from tests.telemetry.lot_car.test_braking import ANCHOR, MAPPING, straight
from tests.telemetry.test_anchored import seen_from

WORLD = "[world]\nlat_deg = {0.lat_deg!r}\nlon_deg = {0.lon_deg!r}\nyaw_deg = {0.yaw_deg!r}\n"
LANE = AnchorFile(world=ANCHOR.world)
ROAD = load_vehicle(None)


def surveyed(folder: Path, xy: Array) -> Path:
    """Write positions once a second, which say that they are good to 1 cm."""
    geo = geo_from_local(town().graph.frame, xy)
    rows = "".join(f"{k},{lat:.9f},{lon:.9f},0.01\n" for k, (lat, lon) in enumerate(geo))
    file = folder / "drive.csv"
    file.write_text(f"t,lat,lon,std\n{rows}")
    Path(f"{file}.toml").write_text(
        'reference_point = "rear axle"\n'
        '[time]\ncolumn = "t"\nunit = "s"\nbase = "log"\n'
        '[position]\nframe = "wgs84"\nlatitude = { column = "lat", unit = "deg" }\n'
        'longitude = { column = "lon", unit = "deg" }\nstd = { column = "std", unit = "m" }\n'
    )
    return file


def test_a_recorded_drives_lot_is_where_it_is_first_settled(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where the log was drawn in the World itself, the lot is the place of its own pose there.

    The run's folder keeps the whole anchor, and a drive with that file is the same.
    """
    log, lane = surveyed(tmp_path, town_line()[::8]), tmp_path / "lane.toml"
    lane.write_text(WORLD.format(AnchorPose(lat_deg=45.0, lon_deg=-30.0, yaw_deg=0.0)))
    settings = {"map": str(MAP_FILE), "log": str(log)}
    elsewhere = first_pose.with_first_pose(
        read_anchor(lane, first_pose=True),
        DriveConfig(anchor=str(lane), **settings),  # type: ignore[arg-type]
        ROAD,
        None,
    )
    assert elsewhere.lot is not None
    along = local_xy(elsewhere.lot)
    assert abs(along - town_line()).min(axis=0).max() < 60.0
    lane.write_text(WORLD.format(elsewhere.lot))
    inputs = inputs_for(tmp_path, anchor=str(lane), **settings)
    anchor = inputs.anchor  # type: ignore[attr-defined]
    assert anchor.lot == elsewhere.lot
    assert "first settled pose" in capsys.readouterr().err
    plan = make_plan(inputs, NOW)  # type: ignore[arg-type]
    kept = plan.folder / "anchor.toml"
    assert read_anchor(kept) == anchor
    again = inputs_for(tmp_path, anchor=str(kept), **settings)
    assert again.lot == inputs.lot  # type: ignore[attr-defined]


def local_xy(pose: AnchorPose) -> Array:
    return local_from_geo(town().graph.frame, pose.lat_deg, pose.lon_deg)


def test_an_anchor_with_its_lot_stays_as_it_is():
    whole = AnchorFile(lot=ANCHOR.lot, world=ANCHOR.world)
    assert with_first_pose(whole, DriveConfig(), ROAD, None) is whole


def test_who_has_no_first_pose_is_told_so_in_a_line(tmp_path: Path):
    with pytest.raises(ConfigError, match=r"lane.toml names no \[lot\]: the stand-in car begins"):
        with_first_pose(LANE, DriveConfig(anchor="lane.toml"), ROAD, None)
    still = gpx(tmp_path, town_line()[[0] * 30])
    with pytest.raises(UserError, match="has no settled pose: the heading is not known"):
        with_first_pose(LANE, DriveConfig(anchor="lane.toml", log=str(still)), ROAD, None)
    with pytest.raises(ConfigError, match="must name the endpoint"):
        with_first_pose(LANE, *behind_ros2(tmp_path, None, insecure=True))


def behind_ros2(
    folder: Path, endpoint: str | None, **settings: bool
) -> tuple[DriveConfig, VehicleParameters, MappingFile | None]:
    file = folder / "car.toml"
    text = MAPPING.format(dialect="ros2dds", objects="DetectedObjects", lat=52.5, lon=13.4)
    file.write_text(text if endpoint is None else f'endpoint = "{endpoint}"\n{text}')
    config = DriveConfig(source="live", ros2=str(file), anchor="lane.toml", **settings)  # type: ignore[arg-type]
    return config, ROAD, read_ros2(config)


def test_a_car_behind_ros2_is_listened_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The car drives on its lot, over a router of its own; without one, a line says so."""
    endpoint = free_endpoint()
    config, vehicle, ros2 = behind_ros2(tmp_path, endpoint)
    monkeypatch.setattr(first_pose, "WAITS_S", 0.5)
    with pytest.raises(UserError, match=r"car\.toml has no settled pose: .*" + endpoint):
        with_first_pose(LANE, config, vehicle, ros2)
    monkeypatch.setattr(first_pose, "WAITS_S", 60.0)
    assert ros2 is not None
    parameters = read_parameters()
    source = StandinSource(straight(400.0), parameters, vehicle_id="standin")
    over = threading.Event()

    def drives() -> None:
        with ZenohForeignBus(BusSetup(endpoint=endpoint)) as foreign:
            car = LotCar(
                ros2.mapping, source, foreign=foreign, steering_ratio=parameters.car.steering_ratio
            )
            source.hold(False)
            while not over.is_set():
                car.step()

    with ZenohBus(BusSetup(endpoint=endpoint), router=True):
        on_lot = threading.Thread(target=drives)
        on_lot.start()
        try:
            found = with_first_pose(LANE, config, vehicle, ros2)
        finally:
            over.set()
            on_lot.join()
    assert found.lot is not None
    along_m, left_m, yaw = seen_from(ANCHOR.lot, found.lot.frame.origin, found.lot.yaw_rad)
    assert 0.0 < along_m < source.s_m + 1.0
    assert left_m == pytest.approx(0.0, abs=1.0)
    assert yaw == pytest.approx(0.0, abs=0.1)
