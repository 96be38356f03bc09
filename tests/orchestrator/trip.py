"""Drives for tests: states along a drawn line, the embedded town, and a mission that is driven."""

from __future__ import annotations

import datetime
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import (
    GeoPoint,
    LocalFrame,
    geo_from_local,
    geo_from_local_yaw,
    local_from_geo,
)
from foretwin.contracts.world import World
from foretwin.orchestrator.config import DriveConfig
from foretwin.orchestrator.drive.mission import Mission, MissionSettings
from foretwin.orchestrator.drive.plan import make_plan, read_inputs
from foretwin.orchestrator.instructions import BuildWorld, Instruction, Notice, UseWorld
from foretwin.orchestrator.plan import DriveInputs, DrivePlan
from foretwin.orchestrator.routing.route_ahead import WayAhead
from foretwin.world_gen.build import build_world
from tests.orchestrator.grid_map import headings

NOW = datetime.datetime(2030, 1, 2, 3, 4, 5)
START_NS = 5_000_000_000
"""The clock of a vehicle need not begin at zero."""


def states_along(
    frame: LocalFrame,
    xy: Array,
    *,
    speed_mps: float = 10.0,
    start_s: float = 0.0,
    yaw_valid: bool = True,
    rate_hz: float = 10.0,
) -> list[VehicleState]:
    """States of a car that drives along `xy` (N, 2) in `frame` at a steady speed."""
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))])
    at = np.arange(0.0, arc[-1], speed_mps / rate_hz)
    points = np.stack([np.interp(at, arc, xy[:, k]) for k in (0, 1)], axis=-1)
    geo = geo_from_local(frame, points)
    yaw = geo_from_local_yaw(frame, headings(points), points)
    return [
        VehicleState(
            vehicle_id="ego",
            stamp_ns=START_NS + round((start_s + k / rate_hz) * 1e9),
            position=GeoPoint(float(geo[k, 0]), float(geo[k, 1])),
            yaw_rad=float(yaw[k]),
            speed_mps=speed_mps,
            yaw_rate_radps=0.0,
            accel_mps2=0.0,
            yaw_valid=yaw_valid,
        )
        for k in range(len(points))
    ]


@lru_cache(maxsize=1)
def town() -> DriveInputs:
    """The embedded map with its route, as `foretwin drive` reads them."""
    return read_inputs(DriveConfig(view="none").validate())


@lru_cache(maxsize=8)
def town_world(junction_id: str) -> World:
    """The World of one of the town's junctions."""
    inputs = town()
    (junction,) = (j for j in inputs.junctions if j.summary.id == junction_id)
    return build_world(inputs.osm, inputs.graph, junction, radius_m=150.0)


def town_plan(folder: Path, **settings: Any) -> DrivePlan:
    """A drive through the town; its files lie below `folder`, nothing listens at its endpoint."""
    config = DriveConfig(
        view="none",
        out=str(folder / "runs"),
        **{"endpoint": "tcp/127.0.0.1:7447", "insecure": True, **settings},
    )
    return make_plan(replace(town(), config=config.validate()), NOW)


def town_line() -> Array:
    """Where the stand-in car drives, in metres (N, 2)."""
    inputs = town()
    assert inputs.standin is not None
    return local_from_geo(inputs.graph.frame, inputs.standin.lat_deg, inputs.standin.lon_deg)


class Trip:
    """Drives a mission, answers what it asks for, and keeps what it said and when.

    `world_of` gives a junction's World, "failed", or None where it never comes.
    """

    def __init__(
        self,
        way: WayAhead,
        *,
        world_of: Callable[[str], World | Literal["failed"] | None],
        settings: MissionSettings | None = None,
    ) -> None:
        self.mission = Mission(way, settings or MissionSettings(), start_stamp_ns=START_NS)
        self.told: list[tuple[float, Instruction]] = []
        self.rounds: list[tuple[float, Any]] = []
        self._world_of = world_of
        self._asked: set[str] = set()

    def go(self, states: Sequence[VehicleState]) -> Trip:
        for number, state in enumerate(states):
            mono_s = 1000.0 + (state.stamp_ns - START_NS) / 1e9
            self._take(self.mission.on_state(state, mono_s=mono_s), mono_s)
            if number % 5 == 0:
                self.rounds.append((self.mission.drive_time_s, self.mission.plan_round()))
        return self

    def _take(self, told: Iterable[Instruction], mono_s: float) -> None:
        for instruction in told:
            self.told.append((self.mission.drive_time_s, instruction))
            if isinstance(instruction, BuildWorld):
                self._answer(instruction, mono_s)

    def _answer(self, wanted: BuildWorld, mono_s: float) -> None:
        """Answer as the world handler does: what is asked for again has been answered already."""
        if wanted.junction_id in self._asked:
            return
        self._asked.add(wanted.junction_id)
        world = self._world_of(wanted.junction_id)
        if world == "failed":
            self.mission.on_world_failed(wanted.junction_id, "torn")
        elif world is not None:
            self._take(self.mission.on_world(wanted.junction_id, world, mono_s=mono_s), mono_s)

    @property
    def built(self) -> list[tuple[str, bool]]:
        """Junctions whose World was asked for, and whether workers should load it."""
        return [(t.junction_id, t.load) for _, t in self.told if isinstance(t, BuildWorld)]

    @property
    def used(self) -> list[tuple[float, str | None]]:
        """Which World counted from when on."""
        return [(at_s, t.world_id) for at_s, t in self.told if isinstance(t, UseWorld)]

    def texts(self, level: str) -> list[str]:
        return [t.text for _, t in self.told if isinstance(t, Notice) and t.level == level]


def world_named(junction_id: str, frame: LocalFrame) -> World:
    """Some World under a junction's name, for maps that are no OSM."""
    world = town_world("n4")
    summary = msgspec.structs.replace(world.intersection, id=junction_id)
    return msgspec.structs.replace(
        world, id=f"world-{junction_id}", intersection=summary, frame=frame
    )
