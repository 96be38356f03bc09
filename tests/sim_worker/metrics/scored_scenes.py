"""Seventeen scenes at the drawn crossroads for the parts of the extended score.

In each the ego drives 4 s by itself in the first future, and steadily along its lane in the second.
"""

from __future__ import annotations

from typing import NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import Area, World
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.metrics.ground import DrivableGround
from foretwin.sim_worker.metrics.lane_areas import LaneAreas
from foretwin.sim_worker.metrics.rollout import Context, Rollout
from foretwin.sim_worker.metrics.route_rules import RouteRules
from tests.sim_worker.metrics.junction import junction
from tests.sim_worker.metrics.motions import (
    VEHICLE,
    Mover,
    states_of_centre,
    steady_poses,
    times,
)
from tests.sim_worker.places import straight_path

TIME_S = times(4.0)
JUNCTION = np.array([[-4.0, -4.0], [4.0, -4.0], [4.0, 4.0], [-4.0, 4.0]])
ALL_KEPT = dict.fromkeys(("nc", "dac", "ddc", "tlc", "ttc", "lk", "hc"), 1.0)


class Scored(NamedTuple):
    """One scene: poses (N, 3) of the ego's middle, others, when it begins by the lights' plan,
    the parts that are not 1, and what the published scorer says instead.

    Where the other is as it will be touched is looked up from where the ego is now, so that who
    hits it from behind may be ahead for `ttc`: so the published scorer has it too.
    """

    poses: Array
    others: tuple[Mover, ...] = ()
    start_s: float = 0.0
    parts: dict[str, float] = {}  # noqa: RUF012
    theirs: dict[str, float] = {}  # noqa: RUF012


def along(x: float, speed: float, y: float = -1.5, accel: float = 0.0) -> Array:
    """Poses along x with a constant acceleration, until it stands."""
    t = TIME_S if accel >= 0.0 else np.minimum(TIME_S, speed / -accel)
    return np.column_stack([x + speed * t + accel * t * t / 2, 0 * t + y, 0 * t])


def swerving(x: float, speed: float, y: float, over_s: float = 3.0) -> Array:
    """Poses that leave the lane's middle for `y` on a smooth curve, and stay there."""
    share = np.clip(TIME_S / over_s, 0.0, 1.0)
    aside = -1.5 + (y + 1.5) * share**3 * (10 - 15 * share + 6 * share**2)
    way = x + speed * TIME_S
    return np.column_stack([way, aside, np.arctan2(np.gradient(aside), np.gradient(way))])


NORTH = np.pi / 2
SCENES = {
    "alone": Scored(along(-50, 8)),
    "into_who_stands": Scored(
        along(-50, 10), (Mover(-30, -1.5, 0, 0),), parts={"nc": 0.0, "ttc": 0.0}
    ),
    "into_who_goes_slowly": Scored(
        along(-50, 10), (Mover(-38, -1.5, 0, 4),), parts={"nc": 0.0, "ttc": 0.0}
    ),
    "hit_from_behind": Scored(
        along(-50, 5), (Mover(-62, -1.5, 0, 10),), parts={"ttc": 0.0}
    ),
    "hit_in_the_side": Scored(
        along(-30, 5), (Mover(-19.5, -14, NORTH, 5),), parts={"ttc": 0.0}
    ),
    "hit_in_the_side_between_lanes": Scored(
        along(-30, 5, y=0.0),
        (Mover(-19.5, -14, NORTH, 5),),
        parts={"nc": 0.0, "ddc": 0.5, "ttc": 0.0, "lk": 0.0},
    ),
    "on_the_wrong_side": Scored(
        along(-50, 7, y=1.5), parts={"ddc": 0.0, "lk": 0.0}
    ),
    "a_little_on_the_wrong_side": Scored(
        along(-50, 4, y=1.5), parts={"ddc": 0.5, "lk": 0.0}
    ),
    "beside_the_middle": Scored(along(-50, 7, y=-0.9), parts={"lk": 0.0}),
    "slowly_on_the_wrong_side": Scored(along(-50, 1.9, y=1.5), parts={"ddc": 0.5, "lk": 0.0}),
    "beside_the_middle_before_and_behind": Scored(along(-14, 7, y=-0.9), parts={"lk": 0.0}),
    "backwards_into_who_stands": Scored(
        along(-50, -3),
        (Mover(-58, -1.5, 0, 0),),
        parts={"nc": 0.0, "ttc": 0.0},
        theirs={"ttc": 1.0},
    ),
    "off_the_road": Scored(
        swerving(-50, 8, -4.2), parts={"dac": 0.0, "ddc": 0.0, "lk": 0.0}
    ),
    "near_behind": Scored(along(-50, 12, accel=-3.9), (Mover(-36, -1.5, 0, 7.0),)),
    "over_red": Scored(along(-30, 10), start_s=16.0, parts={"tlc": 0.0}),
    "crossing_close_ahead": Scored(along(-16, 8), (Mover(4.5, -15, NORTH, 10),)),
    "hard_brakes": Scored(along(-50, 14, accel=-6.0), parts={"hc": 0.0}),
}  # fmt: skip


def world() -> World:
    """The crossroads with lights, and its junction as an area."""
    plain = junction(lights=True)
    area = Area(id="junction", outline=JUNCTION)
    return msgspec.structs.replace(
        plain, junctions=(msgspec.structs.replace(plain.junctions[0], area=area),)
    )


def scored(scene: Scored) -> tuple[Rollout, Context]:
    """Return a scene as a rollout of its two futures, and what it is judged against."""
    way = FrenetPath(straight_path().xy_m)
    place, here = scene.poses[0], world()
    calm = steady_poses(Mover(float(place[0]), -1.5, 0.0, 4.0), TIME_S)
    users = [steady_poses(other, TIME_S) for other in scene.others]
    users_at = np.stack(users, axis=1) if users else np.zeros((len(TIME_S), 0, 3))
    speeds = np.array([other.speed for other in scene.others], dtype=np.float64)
    sizes = np.array([(o.length, o.width) for o in scene.others]).reshape(-1, 2)
    return Rollout(
        time_s=TIME_S,
        states=np.stack([states_of_centre(poses, TIME_S) for poses in (scene.poses, calm)]),
        users=np.stack([users_at] * 2),
        user_speed_mps=np.broadcast_to(speeds, (2, len(TIME_S), len(speeds))),
        user_size_m=np.stack([sizes] * 2),
        valid=np.ones(2, dtype=bool),
        vehicle=VEHICLE,
    ), Context(
        path=way,
        ground=DrivableGround(here),
        rules=RouteRules(here, way),
        lanes=LaneAreas(here),
        start_s=scene.start_s,
    )
