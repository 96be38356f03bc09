"""The samples of a group of vehicles: each in its role, corrections, touches."""

from __future__ import annotations

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame, target_from_source, wrap_angle
from foretwin.contracts.simulation import MirroredVehicle, MirrorSample, PlaneState, TwinCorrection
from foretwin.sim_worker.mirror.member import Member
from foretwin.sim_worker.mirror.track import MeasuredPose
from foretwin.sim_worker.mirror.vehicle_group import VehicleGroup

_SIZES = ("length_m", "width_m", "height_m", "rear_overhang_m")


def plane_state(
    pose: Array, speed_mps: float, *, drive_frame: LocalFrame, world_frame: LocalFrame
) -> PlaneState:
    """Return x, y, yaw (3,) and a speed in the frame of the drive."""
    there = target_from_source(drive_frame, world_frame, pose[None, :2], pose[None, 2])
    return PlaneState(
        x_m=float(there.xy_m[0, 0]),
        y_m=float(there.xy_m[0, 1]),
        yaw_rad=float(wrap_angle(there.yaw_rad[0])),
        speed_mps=float(speed_mps),
    )


def with_group(
    sample: MirrorSample,
    group: VehicleGroup,
    car_id: str,
    *,
    drive_frame: LocalFrame,
    world_frame: LocalFrame,
) -> MirrorSample:
    """Return the sample of the car with its roles and all other vehicles that are there."""

    def plane(motion: MeasuredPose) -> PlaneState:
        return plane_state(
            motion.pose, _speed(motion), drive_frame=drive_frame, world_frame=world_frame
        )

    car = group.members[car_id]
    box = plane(car.box(car.track.at(sample.stamp_ns)))
    changes: dict[str, object] = {"shadow": box, "ghost": box}
    if car.has_twin and car.present:
        twin_now = _twin_at(group, car, sample.stamp_ns)
        changes["twin"] = plane(twin_now)
        changes["twin_yaw_rate_radps"] = float(twin_now.rate[2])
        changes["free"] = sample.twin
    others = []
    for name, member in group.members.items():
        if name == car_id or not member.present:
            continue
        measured = member.track.at(sample.stamp_ns)
        twin = member.has_twin
        shown = _twin_at(group, member, sample.stamp_ns) if twin else member.box(measured)
        others.append(
            MirroredVehicle(
                vehicle_id=name,
                role=member.role,
                real=plane(measured),
                shown=plane(shown),
                **{name: getattr(member.spec.vehicle, name).value for name in _SIZES},
                correction=_correction(group, member),
            )
        )
    return msgspec.structs.replace(
        sample,
        **changes,
        role=car.role,
        correction=_correction(group, car),
        others=tuple(others),
        touches=tuple(sorted(group.touches)),
    )


def _speed(motion: MeasuredPose) -> float:
    """Return the speed along the heading."""
    yaw = motion.pose[2]
    return float(np.cos(yaw) * motion.rate[0] + np.sin(yaw) * motion.rate[1])


def _twin_at(group: VehicleGroup, member: Member, stamp_ns: int) -> MeasuredPose:
    """Return the twin, carried on by the part of a step that is left."""
    assert group.stamp_ns is not None
    twin = member.twin()
    return MeasuredPose(twin.pose + (stamp_ns - group.stamp_ns) / 1e9 * twin.rate, twin.rate)


def _correction(group: VehicleGroup, member: Member) -> TwinCorrection | None:
    if not (member.has_twin and (group.correction == "follow" or not member.drawn.at_rest)):
        return None
    along, across, yaw = member.drawn.acceleration.tolist()
    return TwinCorrection(along_mps2=along, across_mps2=across, yaw_radps2=yaw)
