"""A run's recorded drive as the recogniser takes it: motion, detections, Worlds, one frame."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Stamps
from foretwin.contracts.codec import read_message
from foretwin.contracts.drive import RoadUsers, VehicleInfo, VehicleState
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import LocalFrame, local_from_geo, local_from_geo_yaw
from foretwin.contracts.segments import DRIVE_FILE, first_left
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.orchestrator.record.recorded_messages import CarRecorded, car_recorded
from foretwin.orchestrator.record.run_folder import VEHICLES
from foretwin.orchestrator.record.run_state import check_finished
from foretwin.sim_worker.analysis.occurred.scene import Detected, DrivenMotion, even_motion
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.estimator.estimator import estimator_of
from foretwin.telemetry.logs import open_log
from foretwin.telemetry.logs.log import Log
from foretwin.telemetry.logs.road_users import RoadUserTrack, detections_of, log_of_detections

_WORLDS = "worlds"


class DriveRead(NamedTuple):
    """A drive in `frame`, whose origin is where the car was first; `states` as estimated."""

    info: VehicleInfo
    frame: LocalFrame
    states: tuple[VehicleState, ...]
    ego: DrivenMotion
    detected: tuple[Detected, ...]
    told_ns: Stamps
    """When the car told of road users; empty where it never did: then nothing is known of any."""
    worlds: tuple[World, ...]
    vehicle: VehicleParameters


def read_run(run: Path, recorded: CarRecorded | None = None) -> DriveRead:
    """Return a run's drive; `recorded` is what it recorded of its car, where that was read before.

    Raises FileNotFoundError for a folder that is none of a run, UserError for a run that goes on
    or holds no motion.
    """
    check_finished(run)
    recording = first_left(run / DRIVE_FILE)
    if not recording.is_file():
        raise FileNotFoundError(f"run {run}: no {recording.name} in it")
    vehicle = _vehicle(run)
    log = open_log(recording)
    states, objects = recorded or car_recorded(run / DRIVE_FILE)
    if len(states) < 2:
        states, objects = _estimated(log, vehicle)
    told = [message.stamp_ns for message in objects]
    seen = [detections_of(one) for one in objects]
    headed = [state for state in states if state.yaw_valid]
    if len(headed) < 2:
        raise UserError(f"{recording}: the heading is never known, so nothing can be recognised")
    frame = LocalFrame(headed[0].position)
    return DriveRead(
        info=log.info,
        frame=frame,
        states=tuple(headed),
        ego=motion_in(frame, headed),
        detected=tuple(_detected(frame, track) for track in log_of_detections(seen).tracks),
        told_ns=np.array(sorted(told), dtype=np.int64),
        worlds=tuple(_worlds(run / _WORLDS)),
        vehicle=vehicle,
    )


def _estimated(log: Log, vehicle: VehicleParameters) -> CarRecorded:
    """Return states as they are estimated now from all sensors, and what was detected."""
    estimator = estimator_of(log.info, vehicle)
    states: list[VehicleState] = []
    objects = []
    for channel, message in log.samples():
        if isinstance(message, RoadUsers):
            objects.append(message)
        state = estimator.handle(channel, message)
        if state is not None:
            states.append(state)
    return CarRecorded(tuple(states), tuple(objects))


def motion_in(frame: LocalFrame, states: Iterable[VehicleState]) -> DrivenMotion:
    """Return estimated states in the order of their stamps at even times in a frame."""
    kept = list(states)
    lat, lon, yaw, speed, accel, rate = np.array(
        [
            (
                s.position.lat_deg,
                s.position.lon_deg,
                s.yaw_rad,
                s.speed_mps,
                s.accel_mps2,
                s.yaw_rate_radps,
            )
            for s in kept
        ]
    ).T
    stamps = np.array([state.stamp_ns for state in kept], dtype=np.int64)
    fresh = np.concatenate([[True], np.diff(stamps) > 0])
    # What the map moved a position by is no motion of the car.
    moved_m = np.array([s.map_shift_m or (0.0, 0.0) for s in kept])
    xy = np.asarray(local_from_geo(frame, lat, lon)) - moved_m
    local_yaw = np.asarray(local_from_geo_yaw(frame, yaw, lat, lon))
    columns = (column[fresh] for column in (xy, local_yaw, speed, accel, rate))
    return even_motion(stamps[fresh], *columns)


def _detected(frame: LocalFrame, track: RoadUserTrack) -> Detected:
    return Detected(
        user_id=track.user_id,
        kind=track.kind,
        size_m=track.size_m,
        stamp_ns=track.stamps_ns,
        xy_m=np.asarray(local_from_geo(frame, track.lat_deg, track.lon_deg)),
        yaw_rad=np.asarray(local_from_geo_yaw(frame, track.yaw_rad, track.lat_deg, track.lon_deg)),
    )


def _vehicle(run: Path) -> VehicleParameters:
    """Return the parameters that the run kept, the bundled ones where it kept none."""
    kept = sorted((run / VEHICLES).glob("*.vehicle"))
    return read_message(kept[0], VehicleParameters) if kept else load_vehicle(None)


def _worlds(folder: Path) -> Iterable[World]:
    for file in sorted(folder.glob("*.world")):
        yield read_message(file, World)
