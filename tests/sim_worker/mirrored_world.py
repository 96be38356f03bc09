"""The mirror image, east for west, of a flat World, and of a job in it: it is known to the bit."""

from __future__ import annotations

import math
from typing import TypeVar

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.beside_road import Building, Obstacle
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.contracts.futures import Future, Job, SeenRoadUser
from foretwin.contracts.world import Area, IntersectionSummary, World, WorldJunction
from tests.world_gen.transformed_maps import OTHER

replace = msgspec.structs.replace
TO_THE_LEFT = ("lateral_shift_m", "position_offset_m", "steering_offset_rad")
"""Numbers of a future that have a side."""


Outlined = TypeVar("Outlined", Area, Building, Obstacle)


def image(points: Array) -> Array:
    """Points (…, 2) or (…, 3) as they lie in the mirror."""
    return points * np.array([-1.0, 1.0, 1.0])[: points.shape[-1]]


def _turned(line: Array) -> Array:
    """What keeps its sense of turning, or runs from left to right."""
    return image(line)[::-1].copy()


def _area(one: Outlined) -> Outlined:
    return replace(one, outline=_turned(one.outline), holes=tuple(map(_turned, one.holes)))


def _summary(one: IntersectionSummary, frame: LocalFrame) -> IntersectionSummary:
    lon_deg = 2.0 * frame.origin.lon_deg - one.lon
    return replace(one, lon=lon_deg, driving_side=OTHER[one.driving_side])


def mirrored_world(world: World) -> World:
    """Lanes and what stops or waits where in the mirror, driven on the other side."""
    frame = world.frame

    def junction(one: WorldJunction) -> WorldJunction:
        arms = tuple(replace(arm, bearing_rad=math.pi - arm.bearing_rad) for arm in one.arms)
        area = None if one.area is None else _area(one.area)
        return replace(one, summary=_summary(one.summary, frame), arms=arms, area=area)

    return replace(
        world,
        intersection=_summary(world.intersection, frame),
        junctions=tuple(map(junction, world.junctions)),
        lanes=tuple(
            replace(
                lane,
                centerline=image(lane.centerline),
                turns=tuple(OTHER.get(turn, turn) for turn in lane.turns),
                left_id=lane.right_id,
                right_id=lane.left_id,
                change=OTHER.get(lane.change, lane.change),
                left_of_reference_m=-lane.left_of_reference_m,
            )
            for lane in world.lanes
        ),
        connections=tuple(
            replace(one, centerline=image(one.centerline), turn=OTHER.get(one.turn, one.turn))
            for one in world.connections
        ),
        roads=tuple(
            replace(
                road,
                reference_line=image(road.reference_line),
                left_m=-road.right_m,
                right_m=-road.left_m,
                lane_ids=road.lane_ids[::-1],
            )
            for road in world.roads
        ),
        conflicts=tuple(
            replace(one, point=image(one.point), area=_turned(one.area)) for one in world.conflicts
        ),
        stop_lines=tuple(replace(one, ends=_turned(one.ends)) for one in world.stop_lines),
        crossings=tuple(replace(one, line=_turned(one.line)) for one in world.crossings),
        signals=tuple(
            replace(one, position=image(one.position), yaw_rad=math.pi - one.yaw_rad)
            for one in world.signals
        ),
        kerbs=tuple(map(_turned, world.kerbs)),
        islands=tuple(map(_area, world.islands)),
        road_surface=tuple(map(_area, world.road_surface)),
        sidewalks=tuple(map(_area, world.sidewalks)),
        buildings=tuple(map(_area, world.buildings)),
        obstacles=tuple(map(_area, world.obstacles)),
    )


def mirrored_job(job: Job, frame: LocalFrame) -> Job:
    """The same job for the mirrored World."""
    return replace(
        job,
        state=_state(job.state, frame),
        path=replace(job.path, xy_m=image(job.path.xy_m)),
        futures=tuple(map(_future, job.futures)),
        road_users=tuple(map(_user, job.road_users)),
    )


def _state(state: VehicleState, frame: LocalFrame) -> VehicleState:
    lon_deg = 2.0 * frame.origin.lon_deg - state.position.lon_deg
    return replace(
        state,
        position=GeoPoint(state.position.lat_deg, lon_deg),
        yaw_rad=math.pi - state.yaw_rad,
        yaw_rate_radps=-state.yaw_rate_radps,
        tire_angle_rad=None if state.tire_angle_rad is None else -state.tire_angle_rad,
    )


def _future(future: Future) -> Future:
    sides = {*TO_THE_LEFT, "ego.lateral_shift_m", *(f"faults.{name}" for name in TO_THE_LEFT)}

    def numbers(given: dict[str, float]) -> dict[str, float]:
        return {name: -value if name in sides else value for name, value in given.items()}

    return replace(future, numbers=numbers(future.numbers), values=numbers(future.values))


def _user(user: SeenRoadUser) -> SeenRoadUser:
    return replace(user, x_m=-user.x_m, yaw_rad=math.pi - user.yaw_rad)
