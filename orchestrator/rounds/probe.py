"""The probe of a drive: fixed futures that a worker of another machine must play to the same bits.

They are a round of the drive's own settings on the first connection of a World, so that they go
through what the drive's rounds go through: scenarios, road users, faults, accidents and metrics.
"""

from __future__ import annotations

import numpy as np

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import GeoPoint, geo_from_local, geo_from_local_yaw
from foretwin.contracts.futures import PathAhead
from foretwin.contracts.job_identity import job_bytes
from foretwin.contracts.runner import Task, job_task
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.geometry.polyline import densified, headings_rad, length, without_repeats
from foretwin.orchestrator.config import DriveConfig
from foretwin.orchestrator.instructions import LatestReports, RoundIntent
from foretwin.orchestrator.rounds.jobs import RoundPlanner
from foretwin.sim_worker.driver_model import LATERAL_ACCEL_MPS2

_ROUND_ID = 2**31 - 1
"""That of no round."""
_SPEED_MPS = 8.0
_BEFORE_JUNCTION_M = 40.0
_BEHIND_M = 5.0


def probe_task(
    config: DriveConfig, world: World, vehicle: VehicleParameters, version: int
) -> Task | None:
    """Return the probe in a World, None where nothing can be driven in it."""
    lanes = {lane.id: lane for lane in world.lanes}
    ways = [
        one for one in world.connections if one.from_lane_id in lanes and one.to_lane_id in lanes
    ]
    if not ways:
        return None
    # Where most meet, most can happen.
    across = min(
        ways,
        key=lambda one: (
            one.junction_id != world.intersection.id,
            -len(one.conflicts_with),
            one.id,
        ),
    )
    into, out = lanes[across.from_lane_id], lanes[across.to_lane_id]
    before = into.centerline
    xy_m = without_repeats(np.concatenate([before, across.centerline, out.centerline]))
    start_m = max(0.0, length(before) - _BEFORE_JUNCTION_M - _BEHIND_M)
    xy_m = densified(xy_m, spacing_m=1.0)[int(start_m) :]
    if len(xy_m) < 2 * _BEFORE_JUNCTION_M:
        xy_m = np.concatenate([xy_m, xy_m[-1] + np.outer(np.arange(1, 100), xy_m[-1] - xy_m[-2])])
    here = xy_m[int(_BEHIND_M)]
    lat, lon = geo_from_local(world.frame, here)
    state = VehicleState(
        vehicle_id=config.vehicle_id,
        stamp_ns=0,
        position=GeoPoint(float(lat), float(lon)),
        yaw_rad=float(geo_from_local_yaw(world.frame, headings_rad(xy_m)[int(_BEHIND_M)], here)),
        speed_mps=_SPEED_MPS,
        yaw_rate_radps=0.0,
        accel_mps2=0.0,
        tire_angle_rad=0.0,
    )
    intent = RoundIntent(
        junction_id=world.intersection.id,
        world_id=world.id,
        path=PathAhead(xy_m=xy_m, speed_limit_mps=np.full(len(xy_m), into.speed_limit_mps.value)),
        cruise_speed_mps=_SPEED_MPS,
        speed_ahead_mps=np.array([_SPEED_MPS]),
        bend_accel_mps2=LATERAL_ACCEL_MPS2,
    )
    planner = RoundPlanner(config, vehicle)
    planner.use_vehicle(vehicle, version)
    job = planner.plan(
        _ROUND_ID,
        intent,
        state,
        LatestReports(None, None, ()),
        world,
        start_stamp_ns=0,
        count=config.futures,
    )[0]
    return job_task(job, job_bytes(job))
