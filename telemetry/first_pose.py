"""Where a car stands on its lot, once that is settled: the first pose, by which a lot is anchored.

Pure: samples in, a pose out. The estimate is made in lengths of the World, so that a small car's is
judged by the same bounds as a road car's.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from foretwin.contracts.anchor import Anchor, AnchorPose
from foretwin.contracts.drive import GnssFix, VehicleInfo, VehicleState
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.telemetry.anchored import world_from_lot_info, world_from_lot_message
from foretwin.telemetry.estimator.estimator import StateEstimator, estimator_of

MOST_POSITION_STD_M = 1.0
"""In the World; chosen: a third of a lane's width."""
MOST_YAW_STD_RAD = 0.05
"""Chosen: 60 m before a junction 3 m aside at its end, seen from a pose that is off by as much."""
SETTLED_NS = 1_000_000_000
"""So long both hold, without a gap; chosen."""


class FirstPose:
    """Takes a car's samples as it sends them on its lot, until its pose there is settled.

    Settled is: for a second, in each state that a position gives, the heading is known at all
    (measured, or from a way driven), its standard deviation is at most 0.05 rad and the position's
    at most 1 m, and positions are not overdue. `scale` is that of the anchor to be; metres are
    those of the World.
    """

    def __init__(self, info: VehicleInfo, vehicle: VehicleParameters, *, scale: float) -> None:
        self._info, self._vehicle, self._scale = info, vehicle, scale
        self._as_large: Anchor | None = None
        self._estimator: StateEstimator | None = None
        self._state: VehicleState | None = None
        self._good_since_ns: int | None = None

    def take(
        self, channel: str, message: Any, *, received_ns: int | None = None
    ) -> AnchorPose | None:
        """Return the pose on the lot where it is settled by this sample, None before."""
        if self._as_large is None or self._estimator is None:
            if not isinstance(message, GnssFix):
                return None
            at = message.position
            point = AnchorPose(lat_deg=at.lat_deg, lon_deg=at.lon_deg, alt_m=at.alt_m, yaw_deg=0.0)
            self._as_large = Anchor(lot=point, world=point, scale=self._scale)
            info = world_from_lot_info(self._as_large, self._info)
            self._estimator = estimator_of(info, self._vehicle)
        there = world_from_lot_message(self._as_large, message)
        state = self._estimator.handle(channel, there, received_ns=received_ns)
        if state is None or not (isinstance(message, GnssFix) or "gnss" in state.stale):
            return None
        self._state = state
        if _lacks(state):
            self._good_since_ns = None
            return None
        if self._good_since_ns is None:
            self._good_since_ns = state.stamp_ns
        if state.stamp_ns - self._good_since_ns < SETTLED_NS:
            return None
        pose = self._as_large.lot_from_world(state.position, state.yaw_rad)
        return AnchorPose(
            lat_deg=pose.position.lat_deg,
            lon_deg=pose.position.lon_deg,
            alt_m=pose.position.alt_m,
            yaw_deg=math.degrees(pose.yaw_rad),
        )

    @property
    def lacks(self) -> str:
        """What a settled pose lacks now, in words."""
        if self._estimator is None:
            return "no position has come"
        if self._state is None:
            return "no state could be estimated"
        return _lacks(self._state) or "it was not settled for a second"


def _lacks(state: VehicleState) -> str:
    if not state.yaw_valid or state.yaw_std_rad is None:
        return "the heading is not known: drive some metres, or send one"
    if state.yaw_std_rad > MOST_YAW_STD_RAD:
        off_deg, most_deg = math.degrees(state.yaw_std_rad), math.degrees(MOST_YAW_STD_RAD)
        return f"the heading is known to {off_deg:.1f}° alone, {most_deg:.1f}° are needed"
    if "gnss" in state.stale:
        return "positions are overdue"
    if state.position_std_m is None:
        return "nothing says how good the positions are"
    if state.position_std_m > MOST_POSITION_STD_M:
        return (
            f"the position is known to {state.position_std_m:.1f} m alone, "
            f"{MOST_POSITION_STD_M:.0f} m is needed"
        )
    return ""


def first_pose(watch: FirstPose, samples: Iterable[tuple[str, Any]]) -> AnchorPose | None:
    """Return the first settled pose of samples in stamp order, None where there is none."""
    for channel, message in samples:
        if (pose := watch.take(channel, message)) is not None:
            return pose
    return None
