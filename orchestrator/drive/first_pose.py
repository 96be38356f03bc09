"""An anchor file without a lot: the car's first settled pose becomes the pose in the World."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import msgspec

from foretwin.contracts.anchor import AnchorPose
from foretwin.contracts.anchor_file import AnchorFile
from foretwin.contracts.errors import UserError
from foretwin.contracts.terminal import say
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator.config import ConfigError, DriveConfig
from foretwin.telemetry import first_pose
from foretwin.telemetry.logs import open_log
from foretwin.telemetry.processes.replay import ReplaySource
from foretwin.telemetry.ros2 import lot_pose
from foretwin.telemetry.ros2.mapping import MappingFile

WAITS_S = 60.0
"""So long a car behind ROS 2 has time to send positions and to drive the metres that tell its
heading; chosen."""
_STARTS_S = 30.0


def with_first_pose(
    file: AnchorFile, config: DriveConfig, vehicle: VehicleParameters, ros2: MappingFile | None
) -> AnchorFile:
    """Return an anchor file with its lot: the file as it is, or where the car is first settled.

    A recorded drive is read from its start until then; a car behind ROS 2 is listened to.
    Raises UserError, in one line, where no pose is settled or the source has none.
    """
    if file.lot is not None:
        return file
    where = f"--anchor {config.anchor} names no [lot]"
    match config.resolved_source:
        case "log":
            pose, lacks = _of_log(config, vehicle, file.scale)
            whose = f"recorded drive {config.log}"
        case "live" if ros2 is not None:
            if ros2.mapping.endpoint is None:
                raise ConfigError(
                    f"{where}: {ros2.name} must name the endpoint of the car's router"
                )
            say(
                f"{where}: waits up to {WAITS_S:.0f} s for the car's first settled pose", error=True
            )
            pose, lacks = _of_car(Path(config.ros2 or ""), ros2, vehicle, file.scale)
            whose = f"the car of {ros2.name}"
        case _:
            raise ConfigError(f"{where}: the stand-in car begins on its route, and needs one")
    if pose is None:
        raise UserError(f"{where}, and {whose} has no settled pose: {lacks}")
    say(
        f"{where}: it is {pose.lat_deg:.7f}, {pose.lon_deg:.7f}, heading {pose.yaw_deg:.2f}° from "
        "east, the car's first settled pose; anchor.toml of the run keeps it",
        error=True,
    )
    return file.at_lot(pose)


def _of_log(
    config: DriveConfig, vehicle: VehicleParameters, scale: float
) -> tuple[AnchorPose | None, str]:
    log = open_log(Path(config.log or ""))
    source = ReplaySource(log, vehicle_id="ego", start_s=config.start_s, end_s=config.end_s)
    watch = first_pose.FirstPose(source.info, vehicle, scale=scale)
    end_ns = log.info.end_stamp_ns or sys.maxsize
    return first_pose.first_pose(watch, source.advance(end_ns)), watch.lacks


def _of_car(
    mapping_file: Path, ros2: MappingFile, vehicle: VehicleParameters, scale: float
) -> tuple[AnchorPose | None, str]:
    asked = lot_pose.LotPoseAsked(
        mapping=mapping_file.read_text(encoding="utf-8"),
        mapping_name=ros2.name,
        vehicle=vehicle,
        scale=scale,
        wait_s=WAITS_S,
    )
    said = subprocess.run(
        [sys.executable, "-P", "-m", lot_pose.__name__],
        input=msgspec.json.encode(asked),
        stdout=subprocess.PIPE,
        timeout=WAITS_S + _STARTS_S,
        check=True,
    ).stdout
    found = msgspec.json.decode(said, type=lot_pose.LotPose)
    return found.pose, found.lacks
