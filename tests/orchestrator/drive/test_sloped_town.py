"""The stand-in car in the drawn town on a hillside that SRTM-like cells see with their noise."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import GnssFix
from foretwin.contracts.errors import UserError
from foretwin.contracts.gap import Verdict
from foretwin.contracts.setup import BuilderSetup, TuningSetup
from foretwin.contracts.tuning import Identification
from foretwin.geometry.slopes import Slopes, read_slopes
from foretwin.orchestrator.config import DriveConfig
from foretwin.orchestrator.drive.plan import make_plan, read_inputs
from foretwin.orchestrator.drive.processes import PROCESSES, process_ids
from foretwin.orchestrator.plan import DriveInputs
from foretwin.orchestrator.routing.route_heights import heights_along
from foretwin.orchestrator.routing.standin_path import standin_path
from foretwin.orchestrator.worlds.heights import slopes_in
from foretwin.sim_worker.analysis.gap.monitor import GapMonitor
from foretwin.sim_worker.analysis.identify.window import identify
from foretwin.sim_worker.analysis.motion_record import MotionRecorder
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.path import DrivenPath, read_path
from foretwin.telemetry.standin.source import START_STAMP_NS, StandinSource
from foretwin.world_gen.elevation.profiles import RoadProfiles
from foretwin.world_gen.elevation.road_profiles import road_profiles
from tests.orchestrator.trip import NOW
from tests.sim_worker.faulty_standin import model_with
from tests.sim_worker.standin_drives import estimate
from tests.world_gen.elevation.hills import raster

COVERS = (
    "foretwin.orchestrator.routing.route_heights",
    "foretwin.sim_worker.analysis.identify.road_grade",
)
SRTM_NOISE_M = 3.7
Samples = list[tuple[str, Any]]


def hillside(x: Array, y: Array) -> Array:
    """Heights in metres; streets climb by up to 9 %."""
    return 100.0 + 18.0 * np.sin(2.0 * np.pi * x / 1500.0) + 14.0 * np.cos(2.0 * np.pi * y / 1200.0)


@functools.cache
def town() -> DriveInputs:
    return read_inputs(DriveConfig(view="none"))


@functools.cache
def profiles(*, arc_s: float, noise_m: float = 0.0, seed: int = 0) -> RoadProfiles:
    graph = town().graph
    seen = raster(
        hillside, graph.frame.origin, arc_s=arc_s, noise_m=noise_m, seed=seed, reach_deg=0.012
    )
    return road_profiles(graph, [e.index for e in graph.edges if e.drivable], seen)


def slopes(heights: RoadProfiles) -> Slopes:
    return Slopes(slopes_in(town().drive_frame, town().graph, heights))


def real() -> RoadProfiles:
    return profiles(arc_s=0.15)


def seen(seed: int = 0) -> RoadProfiles:
    return profiles(arc_s=3.0, noise_m=SRTM_NOISE_M, seed=seed)


@functools.cache
def driven(*, climbs: bool) -> tuple[tuple[str, Any], ...]:
    """Return what the car sends along the town's route, which lasts two minutes."""
    inputs, parameters = town(), read_parameters()
    way = standin_path(inputs.osm, inputs.graph, inputs.routes[0], real() if climbs else None)
    path = DrivenPath(
        way.lat_deg, way.lon_deg, way.speed_mps, driver=parameters.driver, altitude_m=way.altitude_m
    )
    source = StandinSource(path, parameters, vehicle_id="standin", seed=3)
    return tuple(source.advance(START_STAMP_NS + 300_000_000_000))


def without_altitude(samples: Iterable[tuple[str, Any]]) -> Samples:
    """Return the samples of a receiver that tells no height, as most of telephones' do."""
    return [(channel, _level(message)) for channel, message in samples]


def _level(message: Any) -> Any:
    if not isinstance(message, GnssFix):
        return message
    return msgspec.structs.replace(
        message, position=msgspec.structs.replace(message.position, alt_m=0.0)
    )


def identified(samples: Iterable[tuple[str, Any]], roads: Slopes | None) -> Identification:
    recorder = MotionRecorder(frame=town().drive_frame, keep_s=600.0)
    for channel, message in samples:
        recorder.handle(channel, message)
    record = recorder.record(period_s=0.02)
    return identify(record, load_vehicle(), vehicle_id="standin", roads=roads)


def gains(found: Identification) -> Array:
    values = [estimate(found, name).value for name in ("drive_gain", "brake_gain")]
    return np.array(values, dtype=np.float64)


def test_the_map_s_grades_are_off_by_what_they_say() -> None:
    apart = []
    for seed in range(4):
        for index, profile in seen(seed).of_edge.items():
            at = np.arange(0.0, profile.along_m[-1], 5.0)
            apart.append(profile.grade_at(at) - real().of_edge[index].grade_at(at))
    rms = float(np.sqrt(np.mean(np.square(np.concatenate(apart)))))

    assert 0.5 * seen().grade_std < rms < 1.2 * seen().grade_std


def test_the_car_drives_over_the_hillside_as_it_really_is() -> None:
    inputs = town()
    route = inputs.routes[0]
    at = np.linspace(20.0, route.end_m - 20.0, 50)
    fixes = [m.position.alt_m for c, m in driven(climbs=True) if c == "gnss"]

    heights = heights_along(route, at, real())
    assert np.ptp(heights) > 15.0
    assert np.ptp(fixes) == pytest.approx(np.ptp(heights), abs=3.0)


def test_gains_by_altitude_are_those_of_a_level_town_within_three_per_cent() -> None:
    level = gains(identified(driven(climbs=False), slopes(flat())))
    climbing = gains(identified(driven(climbs=True), slopes(seen())))

    assert climbing == pytest.approx(level, rel=0.03)


def flat() -> RoadProfiles:
    graph = town().graph
    level = raster(lambda x, y: 0.0 * x, graph.frame.origin, reach_deg=0.012)
    return road_profiles(graph, [e.index for e in graph.edges if e.drivable], level)


def test_the_roads_own_grade_tells_gains_where_no_altitude_is_measured() -> None:
    """Of a good model: one like SRTM says only that two minutes say nothing."""
    samples = without_altitude(driven(climbs=True))
    by_truth = identified(samples, slopes(real()))
    by_srtm = identified(samples, slopes(seen()))
    believed_level = identified(samples, slopes(flat()))

    car = read_parameters().car
    truth = np.array([car.drive_gain, car.brake_gain])
    assert gains(by_truth) == pytest.approx(truth, rel=0.03)
    for name, value in zip(("drive_gain", "brake_gain"), truth, strict=True):
        found = estimate(by_srtm, name)
        assert "interval is wide" in found.reason
        assert found.low is not None
        assert found.high is not None
        assert found.low < value < found.high
    off = np.abs(gains(believed_level) / truth - 1.0)
    assert off.max() > 2.0 * np.abs(gains(by_srtm) / truth - 1.0).max()


def accused(samples: Iterable[tuple[str, Any]], roads: Slopes | None) -> list[str]:
    """Return of what along the road a car that has nothing is accused."""
    monitor = GapMonitor(_info(), model_with(None), frame=town().drive_frame, roads=roads)
    found = [one for channel, m in samples for one in monitor.handle(channel, m)]
    along = ("drive", "brake", "drag")
    verdicts = [one for one in found if isinstance(one, Verdict)]
    return [one.cause for one in verdicts if any(word in one.cause for word in along)]


@pytest.mark.parametrize(
    "measured",
    [
        pytest.param(True, id="altitude"),
        pytest.param(False, id="map alone", marks=pytest.mark.judge),
    ],
)
def test_a_slope_is_not_taken_for_a_fault_of_the_car(measured: bool) -> None:
    samples = driven(climbs=True)
    told = samples if measured else without_altitude(samples)

    assert len(accused(told, slopes(seen()))) <= 2
    assert measured or len(accused(told, None)) >= 6


def _info() -> Any:
    parameters = read_parameters()
    way = standin_path(town().osm, town().graph, town().routes[0])
    path = DrivenPath(way.lat_deg, way.lon_deg, way.speed_mps, driver=parameters.driver)
    return StandinSource(path, parameters, vehicle_id="standin").info


def test_a_drive_s_stand_in_reads_the_heights_of_its_path(tmp_path: Path) -> None:
    inputs = town()
    way = standin_path(inputs.osm, inputs.graph, inputs.routes[0], real())
    file = tmp_path / "path.json"
    file.write_text(msgspec.json.encode(way.as_json()).decode())

    read = read_path(file, driver=read_parameters().driver)
    assert read.altitude_m is not None
    assert np.ptp(read.altitude_m) > 15.0
    assert "altitude_m" not in standin_path(inputs.osm, inputs.graph, inputs.routes[0]).as_json()


def tiles(folder: Path) -> Path:
    """Write the SRTM tiles that the drawn town lies across, climbing northwards by 5 %."""
    folder.mkdir()
    for name, south in (("N44W031", 0), ("N45W031", 1200), ("N44W030", 0), ("N45W030", 1200)):
        rise = 0.05 * 92.66 * np.arange(1200, -1, -1) + 0.05 * 92.66 * south
        heights = np.repeat(np.round(rise)[:, None], 1201, axis=1).astype(">i2")
        (folder / f"{name}.hgt").write_bytes(heights.tobytes())
    return folder


def test_a_drive_over_an_elevation_model_tells_its_processes(tmp_path: Path) -> None:
    dem = str(tiles(tmp_path / "dem"))
    config = DriveConfig(view="none", dem=dem, tuning="report", out=str(tmp_path / "runs"))
    plan = make_plan(read_inputs(config.validate()), NOW)

    assert plan.slopes is not None
    north = np.abs(plan.slopes.direction[:, 1])
    # Its ring apart: over 30 m such cells tell nothing, and roads are level until told otherwise.
    off = np.abs(np.abs(plan.slopes.grade) - 0.05 * north)
    assert np.percentile(off, 90) < 0.02
    assert read_slopes(plan.slopes_file).grade_std == pytest.approx(0.027, abs=0.001)
    assert "altitude_m" in plan.standin_path_file.read_text()
    setups = [row.setup(plan, name) for row in PROCESSES for name in process_ids(row, plan)]
    assert [one.dem for one in setups if isinstance(one, BuilderSetup)] == [dem]
    told = [one.slopes for one in setups if isinstance(one, TuningSetup)]
    assert told == [str(plan.slopes_file)]


def test_an_elevation_model_of_elsewhere_ends_the_drive_before_it_begins(tmp_path: Path) -> None:
    (tiles(tmp_path / "dem") / "N44W031.hgt").rename(tmp_path / "N10E010.hgt")
    config = DriveConfig(view="none", dem=str(tmp_path / "N10E010.hgt"), out=str(tmp_path / "runs"))

    with pytest.raises(UserError, match="knows no height between"):
        read_inputs(config)
    assert not (tmp_path / "runs").exists()
