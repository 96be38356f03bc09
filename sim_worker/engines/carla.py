"""The engine `carla`: a client of a CARLA server that somebody has started.

Nobody here has run it against a server: of CARLA, tests judge the map alone, by its own parser.
The package `carla` is imported when a job first asks for it.
"""

from __future__ import annotations

import importlib
import importlib.util
import math
from typing import Any

import numpy as np

from foretwin.contracts.arrays import Array, Indices
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.engines.engine import Demand, Seeds
from foretwin.sim_worker.vehicle.timestep import TIMESTEP_S

HOST, PORT, ANSWER_S = "127.0.0.1", 2000, 10.0
"""Where CARLA's server listens by default."""
_BLUEPRINT, _CLEAR_M = "vehicle.tesla.model3", 0.3


def trouble_with_carla() -> str | None:
    """Return why there is no client of CARLA here, in one line; None where there is."""
    if importlib.util.find_spec("carla") is None:
        return "engine 'carla' needs CARLA's Python package and a server of it, both started by you"
    return None


class Carla:
    """One car in the server's world: CARLA's physics, in which several would meet.

    CARLA's y axis points right and its angles go clockwise; its cars are its own, so that of
    `vehicle` only limits and places of axles count.
    """

    def __init__(self, vehicle: VehicleParameters, *, package: Any = None) -> None:
        """Join the server; raises ValueError, in one line, where it does not answer."""
        if package is None:
            if (trouble := trouble_with_carla()) is not None:
                raise ValueError(trouble)
            package = importlib.import_module("carla")
        self._carla, self._vehicle = package, vehicle
        client = package.Client(HOST, PORT)
        client.set_timeout(ANSWER_S)
        try:
            self._world = client.get_world()
        except RuntimeError as error:
            raise ValueError(f"engine 'carla' at {HOST}:{PORT}: {error}") from error
        self._before = self._world.get_settings()
        ours = self._world.get_settings()
        ours.synchronous_mode, ours.fixed_delta_seconds = True, TIMESTEP_S
        self._world.apply_settings(ours)
        self._middle_m = vehicle.wheelbase_m.value / 2.0
        """CARLA places a car by the middle between its axles."""
        self._actor: Any = None
        self._angle_rad = 0.0

    def reset(self, rows: Indices, seeds: Seeds) -> None:
        """Put the one car where it begins; raises ValueError for more than one."""
        if len(rows) != 1 or rows[0] != 0:
            raise ValueError("engine 'carla' plays jobs of one future: its cars would meet")
        carla, (x, y, yaw, vx, vy, rate, steer, _) = self._carla, seeds.states[0].tolist()
        x, y = x + self._middle_m * math.cos(yaw), y + self._middle_m * math.sin(yaw)
        place = carla.Transform(
            carla.Location(x=x, y=-y, z=_CLEAR_M), carla.Rotation(yaw=-math.degrees(yaw))
        )
        if self._actor is None:
            blueprint = self._world.get_blueprint_library().find(_BLUEPRINT)
            self._actor = self._world.spawn_actor(blueprint, place)
        self._actor.set_transform(place)
        vy += self._middle_m * rate
        east = vx * math.cos(yaw) - vy * math.sin(yaw)
        north = vx * math.sin(yaw) + vy * math.cos(yaw)
        self._actor.set_target_velocity(carla.Vector3D(east, -north, 0.0))
        self._actor.set_target_angular_velocity(carla.Vector3D(0.0, 0.0, -math.degrees(rate)))
        self._angle_rad = steer

    def step(self, demand: Demand) -> Array:
        """Advance by one control tick; return base_link's columns (7, 1)."""
        car, carla = self._vehicle, self._carla
        drive = float(demand.drive_mps2[0])
        for angle in demand.tire_angle_rad[:, 0].tolist():
            self._angle_rad = angle
            self._actor.apply_control(
                carla.VehicleControl(
                    throttle=min(abs(drive) / car.max_drive_accel_mps2.value, 1.0),
                    brake=min(float(demand.brake_mps2[0]) / car.max_brake_decel_mps2.value, 1.0),
                    steer=-angle / car.max_tire_angle_rad.value,
                    reverse=drive < 0.0,
                )
            )
            self._world.tick()
        place, velocity = self._actor.get_transform(), self._actor.get_velocity()
        rate = -math.radians(self._actor.get_angular_velocity().z)
        yaw = -math.radians(place.rotation.yaw)
        along = velocity.x * math.cos(yaw) - velocity.y * math.sin(yaw)
        across = -velocity.x * math.sin(yaw) - velocity.y * math.cos(yaw)
        back_x, back_y = self._middle_m * math.cos(yaw), self._middle_m * math.sin(yaw)
        at = (place.location.x - back_x, -place.location.y - back_y, yaw)
        across -= self._middle_m * rate
        return np.array([*at, along, across, rate, self._angle_rad])[:, None]

    def close(self) -> None:
        """Take the car away, and leave the server's clock as it was."""
        if self._actor is not None:
            self._actor.destroy()
            self._actor = None
        self._world.apply_settings(self._before)
