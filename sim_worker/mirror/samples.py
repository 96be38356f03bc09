"""What a cast says to those who watch: every vehicle in its role, corrections, touches."""

from __future__ import annotations

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame, target_from_source, wrap_angle
from foretwin.contracts.simulation import MirroredVehicle, MirrorSample, PlaneState, TwinCorrection
from foretwin.sim_worker.mirror.cast import Cast
from foretwin.sim_worker.mirror.member import Member
from foretwin.sim_worker.mirror.track import Measured


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


def with_cast(
    sample: MirrorSample,
    cast: Cast,
    car_id: str,
    *,
    drive_frame: LocalFrame,
    world_frame: LocalFrame,
) -> MirrorSample:
    """Return the sample of the car with its roles and all other vehicles that are there."""

    def plane(motion: Measured) -> PlaneState:
        return plane_state(
            motion.pose, _speed(motion), drive_frame=drive_frame, world_frame=world_frame
        )

    car = cast.members[car_id]
    box = plane(car.box(car.track.at(sample.stamp_ns)))
    changes: dict[str, object] = {"shadow": box, "ghost": box}
    if car.has_twin and car.present:
        twin_now = _twin_at(cast, car, sample.stamp_ns)
        changes["twin"] = plane(twin_now)
        changes["twin_yaw_rate_radps"] = float(twin_now.rate[2])
        changes["free"] = sample.twin
    others = []
    for name, member in cast.members.items():
        if name == car_id or not member.present:
            continue
        measured = member.track.at(sample.stamp_ns)
        twin = member.has_twin
        shown = _twin_at(cast, member, sample.stamp_ns) if twin else member.box(measured)
        size = member.who.vehicle
        others.append(
            MirroredVehicle(
                vehicle_id=name,
                role=member.role,
                real=plane(measured),
                shown=plane(shown),
                length_m=size.length_m.value,
                width_m=size.width_m.value,
                height_m=size.height_m.value,
                rear_overhang_m=size.rear_overhang_m.value,
                correction=_correction(cast, member),
            )
        )
    return msgspec.structs.replace(
        sample,
        **changes,
        role=car.role,
        correction=_correction(cast, car),
        others=tuple(others),
        touches=tuple(sorted(cast.touches)),
    )


def _speed(motion: Measured) -> float:
    """Return the speed along the heading."""
    yaw = motion.pose[2]
    return float(np.cos(yaw) * motion.rate[0] + np.sin(yaw) * motion.rate[1])


def _twin_at(cast: Cast, member: Member, stamp_ns: int) -> Measured:
    """Return the twin, carried on by the part of a step that is left."""
    assert cast.stamp_ns is not None
    twin = member.twin()
    return Measured(twin.pose + (stamp_ns - cast.stamp_ns) / 1e9 * twin.rate, twin.rate)


def _correction(cast: Cast, member: Member) -> TwinCorrection | None:
    if not (member.has_twin and (cast.correction == "follow" or not member.drawn.at_rest)):
        return None
    along, across, yaw = member.drawn.acceleration.tolist()
    return TwinCorrection(along_mps2=along, across_mps2=across, yaw_radps2=yaw)
