"""An F1TENTH car on a lot of 20 m by 10 m drives through Berlin, and its twin with it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.anchor import Anchor, AnchorPose
from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import ControlCommand, GnssFix, ImuSample, SpeedSample, VehicleInfo
from foretwin.contracts.frames import geo_from_local, geo_from_local_yaw, geo_pose, local_pose
from foretwin.contracts.world import World
from foretwin.geometry.polyline import arc_lengths, interpolated
from foretwin.sim_worker.mirror.mirror import Mirror
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.anchored import world_from_lot_message
from foretwin.telemetry.estimator.estimator import estimator_of
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.sim_worker.vehicle.f1tenth import LF, LR, GymCar

COVERS = ("foretwin.telemetry.anchored", "foretwin.sim_worker.mirror.mirror")
KRONENSTRASSE = 25663150
"""With Markgrafenstraße."""
SPEED_MPS, AHEAD_M = 0.6, 0.5
"""On the lot."""
LOT_M = 20.0, 10.0
START_NS = 1_700_000_000_000_000_000


def a_turn(world: World) -> Array:
    """Return (N, 2) a way through the junction: some 40 m, a turn, and some 40 m."""
    lanes = {lane.id: lane for lane in world.lanes}
    turn = next(one for one in world.connections if one.turn in ("left", "right"))
    before, after = (lanes[one].centerline for one in (turn.from_lane_id, turn.to_lane_id))
    way = np.concatenate([before[:, :2], turn.centerline[1:, :2], after[1:, :2]])
    along = arc_lengths(way)
    fresh = np.concatenate([[True], np.diff(along) > 1e-6])
    middle = float(arc_lengths(before[:, :2])[-1])
    kept = np.arange(max(middle - 40.0, 0.0), min(middle + 55.0, along[-1]), 0.5)
    found: Array = interpolated(kept, along[fresh], way[fresh])
    return found


def anchor_of(world: World, way_m: Array) -> Anchor:
    """Lay a lot so that the way lies on it lengthwise; its middle is the way's."""
    middle = (way_m.min(axis=0) + way_m.max(axis=0)) / 2.0
    chord = way_m[-1] - way_m[0]
    lat, lon = geo_from_local(world.frame, middle).tolist()
    towards = float(np.arctan2(chord[1], chord[0]))
    yaw = geo_from_local_yaw(world.frame, np.array([towards]), middle[None])[0]
    there = AnchorPose(lat_deg=lat, lon_deg=lon, yaw_deg=float(np.degrees(yaw)))
    return Anchor(
        lot=AnchorPose(lat_deg=48.19, lon_deg=16.37, yaw_deg=0.0), world=there, scale=10.0
    )


@pytest.mark.real_data
def test_its_twin_drives_the_junction_in_the_world_as_the_car_does_on_the_lot(
    data_dir: Path,
) -> None:
    osm = read_map(data_dir / "osm-berlin-mitte" / "berlin-mitte.osm")
    graph = build_road_graph(osm)
    (junction,) = (
        one for one in find_intersections(osm, graph) if KRONENSTRASSE in one.summary.osm_nodes
    )
    world = build_world(osm, graph, junction)
    way_m = a_turn(world)
    anchor = anchor_of(world, way_m)
    lot = anchor.lot.frame
    ones = [geo_pose(world.frame, x, y, 0.0) for x, y in way_m.tolist()]
    back = [anchor.lot_from_world(one.position, one.yaw_rad) for one in ones]
    path = np.array([local_pose(lot, one.position, one.yaw_rad)[:2] for one in back])
    assert np.all(np.ptp(path, axis=0) < LOT_M)

    vehicle = load_vehicle("f1tenth")
    info = VehicleInfo(
        vehicle_id="ego", time_base="utc", start_stamp_ns=START_NS,
        body_from_antenna_m=(0.0, 0.0, 0.0), sends=("gnss", "imu", "speed", "control"),
    )  # fmt: skip
    estimator = estimator_of(info, vehicle)
    mirror = Mirror(vehicle, drive_frame=world.frame, commands_recorded=True)
    mirror.set_world(world)
    random = np.random.default_rng(3)
    first = path[1] - path[0]
    car = GymCar(np.array([*path[0], np.arctan2(first[1], first[0])]), SPEED_MPS)
    off_m, gaps_m, touches, tick = list[float](), list[float](), set[tuple[str, str]](), 0
    while (apart := np.hypot(*(path - car.pose()[:2]).T)).argmin() < len(path) - 8:
        x, y, yaw = car.pose().tolist()
        near = int(apart.argmin())
        ahead = path[min(near + round(AHEAD_M / 0.05), len(path) - 1)] - (x, y)
        left = -np.sin(yaw) * ahead[0] + np.cos(yaw) * ahead[1]
        tire = float(np.arctan(2.0 * (LF + LR) * left / np.sum(ahead**2)))
        tire = min(max(tire, -0.4189), 0.4189)
        accel = 2.0 * (SPEED_MPS - car.speed_mps)
        ns = START_NS + tick * 20_000_000
        told = [
            ("control", ControlCommand(stamp_ns=ns, accel_mps2=accel, tire_angle_rad=tire)),
            ("imu", ImuSample(
                stamp_ns=ns, accel_mps2=(accel, car.speed_mps * car.yaw_rate, 9.81),
                rate_radps=(0.0, 0.0, car.yaw_rate + random.normal(0.0, 0.002)),
            )),
            ("speed", SpeedSample(stamp_ns=ns, speed_mps=car.speed_mps)),
        ]  # fmt: skip
        if tick % 5 == 0:
            noise = random.normal(0.0, 0.002, 2)
            there = geo_pose(lot, x + noise[0], y + noise[1], yaw)
            told.append(("gnss", GnssFix(stamp_ns=ns, position=there.position, std_m=0.002)))
        for channel, on_lot in told:
            message = world_from_lot_message(anchor, on_lot)
            if isinstance(message, ControlCommand):
                mirror.handle_command(message)
            state = estimator.handle(channel, message)
            if state is None or not state.yaw_valid:
                continue
            at = local_pose(world.frame, state.position, state.yaw_rad)
            off_m.append(float(np.hypot(*(way_m - at[:2]).T).min()))
            sample = mirror.handle_state(state)
            if sample is not None:
                gaps_m.append(sample.gap_m)
                touches |= set(sample.touches)
        car.drive(0.02, accel, tire)
        tick += 1
        assert tick < 2000, "it never arrived"
    print(f"off the way {max(off_m):.2f} m, gap of the twin {max(gaps_m):.2f} m, in the World")
    assert tick > 400
    assert max(off_m) < 1.5
    assert max(gaps_m) < 3.0  # by delays that the stand-in here has not
    assert not touches
