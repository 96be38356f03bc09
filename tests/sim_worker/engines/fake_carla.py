"""A CARLA server of a few lines: a car that rolls on where it is, with CARLA's axes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any


@dataclass
class Vector3D:
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


Location = Vector3D


@dataclass
class Rotation:
    pitch: float = 0.0
    yaw: float = 0.0
    roll: float = 0.0


@dataclass
class Transform:
    location: Vector3D
    rotation: Rotation


@dataclass
class VehicleControl:
    throttle: float = 0.0
    brake: float = 0.0
    steer: float = 0.0
    reverse: bool = False


@dataclass
class Actor:
    place: Transform
    speed: Vector3D = field(default_factory=Vector3D)
    turning: Vector3D = field(default_factory=Vector3D)
    controls: list[VehicleControl] = field(default_factory=list)
    there: bool = True

    def set_transform(self, place: Transform) -> None:
        self.place = place

    def set_target_velocity(self, speed: Vector3D) -> None:
        self.speed = speed

    def set_target_angular_velocity(self, turning: Vector3D) -> None:
        self.turning = turning

    def apply_control(self, control: VehicleControl) -> None:
        self.controls.append(control)

    def get_transform(self) -> Transform:
        return self.place

    def get_velocity(self) -> Vector3D:
        return self.speed

    def get_angular_velocity(self) -> Vector3D:
        return self.turning

    def destroy(self) -> None:
        self.there = False


class World:
    def __init__(self) -> None:
        self.settings = SimpleNamespace(synchronous_mode=False, fixed_delta_seconds=None)
        self.actors: list[Actor] = []

    def get_settings(self) -> Any:
        return SimpleNamespace(**vars(self.settings))

    def apply_settings(self, settings: Any) -> None:
        self.settings = settings

    def get_blueprint_library(self) -> Any:
        return SimpleNamespace(find=lambda name: name)

    def spawn_actor(self, _: str, place: Transform) -> Actor:
        self.actors.append(Actor(place))
        return self.actors[-1]

    def tick(self) -> None:
        for actor in self.actors:
            actor.place.location.x += actor.speed.x * self.settings.fixed_delta_seconds
            actor.place.location.y += actor.speed.y * self.settings.fixed_delta_seconds
            turned = actor.turning.z * self.settings.fixed_delta_seconds
            actor.place.rotation.yaw = math.fmod(actor.place.rotation.yaw + turned, 360.0)


class Client:
    answers = True

    def __init__(self, host: str, port: int) -> None:
        self.place = host, port
        self.timeout_s = 0.0

    def set_timeout(self, seconds: float) -> None:
        self.timeout_s = seconds

    def get_world(self) -> World:
        if not self.answers:
            raise RuntimeError("time-out of 10000ms while waiting for the simulator")
        return WORLDS[-1]


WORLDS = [World()]
"""The last one is the server's."""
