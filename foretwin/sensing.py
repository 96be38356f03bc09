"""What sensors would measure in a World, and real clouds with virtual bodies in them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, get_args

import numpy as np

from foretwin.checks import expect, files_told, number, path_of, whole_number
from foretwin.contracts.arrays import Array, Array32
from foretwin.contracts.did_you_mean import one_of
from foretwin.contracts.drive import RoadUser, RoadUserKind, VehicleState
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import geo_pose, local_pose
from foretwin.contracts.numbers import MAX_SEED
from foretwin.contracts.point_cloud import POINT_COLUMNS, PointCloud
from foretwin.contracts.radar_list import RadarList
from foretwin.contracts.sensed_motion import SensedFix, SensedImu
from foretwin.contracts.world import World
from foretwin.sim_worker.sensors.base_motion import BaseMotion
from foretwin.sim_worker.sensors.camera import CameraView, CameraWorld, message_of
from foretwin.sim_worker.sensors.cloud_merge import merge
from foretwin.sim_worker.sensors.kinds import Lidar, Radar
from foretwin.sim_worker.sensors.lidar import LidarScan, scan
from foretwin.sim_worker.sensors.motion_sensors import MotionSensor
from foretwin.sim_worker.sensors.moving_boxes import MovingBoxes, boxes_of
from foretwin.sim_worker.sensors.radar import RadarReturns, detect
from foretwin.sim_worker.sensors.ray_world import RayWorld
from foretwin.sim_worker.sensors.sensor_file import DEFAULT_FILE, SensorFile, load_sensor
from foretwin.sim_worker.sensors.virtual_sensors import Measured
from foretwin.sim_worker.vehicle.road_user_kinds import KINDS
from foretwin.telemetry.logs.write_mcap import create


def road_user(
    world: World,
    kind: RoadUserKind,
    x_m: float,
    y_m: float,
    *,
    yaw_rad: float = 0.0,
    speed_mps: float = 0.0,
) -> RoadUser:
    """Return a virtual road user of a kind's size, its middle at a place in the World's frame."""
    expect("world", world, World)
    if kind not in get_args(RoadUserKind):
        raise UserError(f"kind {kind!r}: {one_of(str(kind), get_args(RoadUserKind))}")
    place = number("x_m", x_m), number("y_m", y_m), number("yaw_rad", yaw_rad)
    if not all(map(math.isfinite, (*place, number("speed_mps", speed_mps)))):
        raise UserError(f"{kind}: place, yaw and speed must be finite numbers")
    at = geo_pose(world.frame, *place)
    size = KINDS[kind]
    return RoadUser(
        user_id=f"{kind} at {x_m:g}, {y_m:g}",
        kind=kind,
        position=at.position,
        yaw_rad=at.yaw_rad,
        speed_mps=float(speed_mps),
        length_m=size.length_m,
        width_m=size.width_m,
        virtual=True,
    )


def lidar_scan(
    world: World,
    state: VehicleState,
    road_users: Sequence[RoadUser] = (),
    sensor: SensorFile | Path | str = DEFAULT_FILE,
    *,
    users_alone: bool = False,
    seed: int = 0,
) -> LidarScan:
    """Return one turn of a lidar on a car, which begins with `state` and `road_users`.

    Both drive on meanwhile. `sensor` is a bundled one's name, a file or what was read from one.
    With `users_alone` nothing of the World is seen: for `merge_clouds`. The same seed gives the
    same noise. Raises UserError for what is no sensor, or a state without a place.
    """
    seed = whole_number("seed", seed, 0, MAX_SEED)
    around = _around(world, state, road_users, sensor, users_alone=users_alone)
    around.sensor.measures(Lidar)
    return scan(RayWorld(around.world), around.sensor, around.motion, around.boxes, seed=seed)


def radar_list(
    world: World,
    state: VehicleState,
    road_users: Sequence[RoadUser] = (),
    sensor: SensorFile | Path | str = "long_range_radar",
    *,
    users_alone: bool = False,
    seed: int = 0,
) -> RadarReturns:
    """Return what a radar on a car lists at the instant of `state` and `road_users`.

    `sensor`, `users_alone`, `seed` and what is raised are as for `lidar_scan`. A road user is one
    return, where the nearest of what is seen of it is.
    """
    seed = whole_number("seed", seed, 0, MAX_SEED)
    around = _around(world, state, road_users, sensor, users_alone=users_alone)
    around.sensor.measures(Radar)
    return detect(RayWorld(around.world), around.sensor, around.motion, around.boxes, seed=seed)


def camera_view(
    world: World,
    state: VehicleState,
    road_users: Sequence[RoadUser] = (),
    sensor: SensorFile | Path | str = "vga_camera",
    *,
    users_alone: bool = False,
) -> CameraView:
    """Return what a camera on a car sees at the instant of `state` and `road_users`.

    Colours, distances and whom, pixel by pixel. `sensor` and `users_alone` are as for `lidar_scan`.
    Raises UserError for what is no camera, and where there is no EGL to draw with.
    """
    around = _around(world, state, road_users, sensor, users_alone=users_alone)
    drawn = CameraWorld(around.world, around.sensor)
    try:
        return drawn.view(around.motion, around.boxes)
    finally:
        drawn.close()


def motion_samples(
    states: Sequence[VehicleState], sensor: SensorFile | Path | str, *, seed: int = 0
) -> list[SensedFix | SensedImu]:
    """Return what a satellite receiver or an inertial sensor measures at states, in their order.

    The same seed gives the same errors. Raises UserError for a sensor of another kind.
    """
    if not isinstance(sensor, SensorFile):
        sensor = load_sensor(path_of("sensor", sensor))
    measures = MotionSensor(sensor, seed=whole_number("seed", seed, 0, MAX_SEED))
    return [measures.sample(expect("a state", one, VehicleState)) for one in states]


def merge_clouds(real: Array | Array32, virtual: LidarScan) -> Array32:
    """Return a real cloud (N, 6) into which a scan of road users alone is put, as (M, 6).

    Columns are x, y, z, intensity, ring and time: metres in base_link as measured, percent, from
    the lowest ring on, seconds since the turn began. What is real behind a virtual body goes, what
    is virtual behind something real does not come. Raises UserError for another shape.
    """
    expect("virtual", virtual, LidarScan)
    return merge(_cloud("real", real), virtual)


def save_clouds(file: Path | str, clouds: Sequence[tuple[float, Array | Array32]]) -> Path:
    """Write clouds (N, 6), each with its seconds, as sensor_msgs/PointCloud2 to an MCAP file.

    Raises UserError for another shape, or where the file cannot be written.
    """
    return _saved(
        file,
        "point_cloud",
        [
            PointCloud(stamp_ns=_stamp_ns(time_s), points=_cloud("a cloud", points))
            for time_s, points in clouds
        ],
    )


def save_radar_lists(file: Path | str, lists: Sequence[tuple[float, RadarReturns]]) -> Path:
    """Write what radars listed, each with its seconds, as radar_msgs/RadarScan to an MCAP file.

    The frame of each is called as its sensor is. Raises UserError where the file cannot be written.
    """
    messages = []
    for time_s, one in lists:
        sensor = expect("a list", one, RadarReturns).sensor
        messages.append(
            RadarList(
                stamp_ns=_stamp_ns(time_s),
                returns=one.returns,
                sensor=sensor.name,
                mount=sensor.mount,
            )
        )
    return _saved(file, "radar_list", messages)


def save_pictures(file: Path | str, views: Sequence[tuple[float, CameraView]]) -> Path:
    """Write what cameras saw, each with its seconds, to an MCAP file.

    As sensor_msgs/CompressedImage with CameraInfo. Raises UserError where it cannot be written.
    """
    messages = []
    for time_s, one in views:
        sensor = expect("a view", one, CameraView).sensor
        messages.append(message_of(one.rgb, sensor, stamp_ns=_stamp_ns(time_s)))
    return _saved(file, "camera_image", messages)


def save_samples(file: Path | str, samples: Sequence[SensedFix | SensedImu]) -> Path:
    """Write what `motion_samples` gave as sensor_msgs/NavSatFix or Imu to an MCAP file.

    Raises UserError where the file cannot be written.
    """
    fixes = all(isinstance(one, SensedFix) for one in samples)
    return _saved(file, "sensed_gnss" if fixes else "sensed_imu", samples)


class _Around(NamedTuple):
    """What a sensor is asked with."""

    world: World | None
    sensor: SensorFile
    motion: BaseMotion
    boxes: MovingBoxes


def _around(
    world: World,
    state: VehicleState,
    road_users: Sequence[RoadUser],
    sensor: SensorFile | Path | str,
    *,
    users_alone: bool,
) -> _Around:
    expect("world", world, World)
    expect("state", state, VehicleState)
    if not isinstance(sensor, SensorFile):
        sensor = load_sensor(path_of("sensor", sensor))
    users = [expect("a road user", user, RoadUser) for user in road_users]
    pose = local_pose(world.frame, state.position.validate(), state.yaw_rad)
    motion = BaseMotion(pose, state.speed_mps, state.yaw_rate_radps)
    boxes = boxes_of(world.frame, users)
    return _Around(None if users_alone else world, sensor, motion, boxes)


def _stamp_ns(time_s: float) -> int:
    return int(number("a time", time_s) * 1e9)


def _saved(file: Path | str, channel: str, messages: Sequence[Measured]) -> Path:
    file = path_of("file", file)
    with files_told(file), create(file) as writer:
        for message in messages:
            try:
                writer.add(channel, message)
            except ValueError as error:
                raise UserError(f"{file}: {error}") from error
    if writer.error is not None:
        raise UserError(f"{file}: {writer.error.strerror or writer.error}")
    return file


def _cloud(what: str, given: Array | Array32) -> Array32:
    try:
        points = np.asarray(given, dtype=np.float32)
    except (TypeError, ValueError):
        raise UserError(f"{what}: an array of numbers is needed") from None
    if points.ndim != 2 or points.shape[1] != len(POINT_COLUMNS):
        raise UserError(f"{what} has the shape {points.shape}; (N, 6): {', '.join(POINT_COLUMNS)}")
    return points
