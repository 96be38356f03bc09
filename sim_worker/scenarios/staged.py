"""How a case begins: its road users as players, and the state of its ego."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.driver_model import BEND_DECEL_MPS2
from foretwin.sim_worker.road_users.cast import Player
from foretwin.sim_worker.road_users.paces import square_bound
from foretwin.sim_worker.scenarios.roles import StagedActor, StagedCase
from foretwin.sim_worker.vehicle.seeding import kinematic_tire_angle, rear_slip_velocity


def staged_players(played: StagedCase, path: FrenetPath) -> tuple[Player, ...]:
    """Return the road users of a case; `path` is the ego's way, shared by all that go along it."""
    ego = played.place.ego
    players = []
    for actor in played.actors:
        way = played.place.way_named(actor.way)
        players.append(player_on(actor, path if way is ego else way.path, actor.start_on(way)))
    return tuple(players)


def player_on(actor: StagedActor, path: FrenetPath, start_arc_m: float) -> Player:
    """Return an actor of a case as one that starts at `start_arc_m` of a path."""
    path, lawful = path.eased, actor.conduct == "law_abiding"
    speed = actor.speed_mps
    if lawful:
        node = int(np.argmin(np.abs(path.arc_m - start_arc_m)))
        speed = min(speed, float(np.sqrt(square_bound(path, decel_mps2=BEND_DECEL_MPS2)[node])))
    return Player(
        name=actor.name,
        kind=actor.kind,
        path=path,
        start_arc_m=start_arc_m,
        speed_mps=speed,
        desired_mps=actor.speed_mps if lawful else None,
        conduct=actor.conduct,
        lateral_m=actor.lateral_m,
        acts_after_s=actor.acts_after_s,
        decel_mps2=actor.decel_mps2,
        hidden_by=actor.hidden_by,
    )


def staged_start(played: StagedCase, vehicle: VehicleParameters) -> Array:
    """Return (8,) the ego's state as a case begins: in steady motion along its path.

    Backwards it moves against its heading.
    """
    path, arc = played.place.ego.path, np.array([played.ego_arc_m])
    pose = path.pose_at(arc, played.ego_lateral_m)
    yaw, speed = float(pose.yaw_rad[0]), played.ego_speed_mps
    yaw_rate = float(path.at_nodes(path.curvature_pm, arc)[0]) * speed
    if played.place.reverse:
        yaw, speed, yaw_rate = yaw + np.pi, -speed, yaw_rate
    slip = rear_slip_velocity(vehicle, speed, yaw_rate)
    angle = kinematic_tire_angle(vehicle, speed, yaw_rate)
    return np.array([*pose.xy_m[0], yaw, speed, slip, yaw_rate, angle, 0.0])
