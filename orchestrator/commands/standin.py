"""The command `standin`: the stand-in car on a lot, where a real one with Autoware would be."""

from __future__ import annotations

import logging
import math
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from foretwin.contracts.anchor_file import AnchorFile, read_anchor
from foretwin.contracts.arrays import Array
from foretwin.contracts.bus import BusUnreachable
from foretwin.contracts.errors import UserError
from foretwin.contracts.foreign_bus import ZenohForeignBus
from foretwin.contracts.frames import geo_from_local
from foretwin.contracts.setup import BusSetup
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.telemetry.logs import read_line
from foretwin.telemetry.lot_car.lot_car import LotCar, LotReport
from foretwin.telemetry.ros2.mapping import read_mapping
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.path import DrivenPath
from foretwin.telemetry.standin.source import StandinSource


class LotDrive(NamedTuple):
    """What was asked for on the command line."""

    ros2: Path
    anchor: Path
    route: Path | None
    way_m: float
    """On the lot."""
    speed_mps: float
    """On the lot."""
    end_s: float


def drive_on_lot(asked: LotDrive) -> CommandResult:
    """Drive until the path or the time is over, and return what it came to.

    Raises UserError, in one line, for files and numbers that cannot be used.
    """
    for name, value in (("--way", asked.way_m), ("--speed", asked.speed_mps)):
        if not 0.0 < value < 10_000.0:
            raise UserError(f"{name} {value}: above 0")
    if not 0.0 < asked.end_s < math.inf:
        raise UserError(f"--end {asked.end_s}: above 0")
    mapping = read_mapping(asked.ros2).mapping
    if mapping.endpoint is None:
        raise UserError(f"{asked.ros2}: endpoint must be named: where the car's router listens")
    parameters = read_parameters()
    file = read_anchor(asked.anchor)
    way = way_in_world(file, route=asked.route, way_m=asked.way_m, speed_mps=asked.speed_mps)
    path = DrivenPath(*way, driver=parameters.driver)
    source = StandinSource(path, parameters, vehicle_id="standin")
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    try:
        with ZenohForeignBus(BusSetup(endpoint=mapping.endpoint)) as foreign:
            car = LotCar(
                mapping,
                source,
                foreign=foreign,
                steering_ratio=parameters.car.steering_ratio,
                anchor=file.anchor,
            )
            until_s = time.monotonic() + asked.end_s
            while not car.ended and time.monotonic() < until_s:
                car.step()
    except BusUnreachable as nobody:
        raise UserError(
            f"{asked.ros2}: endpoint {mapping.endpoint}: nobody listens there"
        ) from nobody
    return CommandResult(car.report(), told(car.report()))


class WorldWay(NamedTuple):
    """A line (N,) in the World, and how fast a stand-in drives along it."""

    lat_deg: Array
    lon_deg: Array
    speed_mps: Array


def way_in_world(
    anchor: AnchorFile, *, route: Path | None, way_m: float, speed_mps: float
) -> WorldWay:
    """Return a stand-in's way: a line of the World, or straight on from the anchor's point.

    `way_m` and `speed_mps` are of the lot.
    """
    if route is not None:
        lat_deg, lon_deg = read_line(route).lat_lon_deg.T
    else:
        yaw_rad = anchor.world.yaw_rad
        ends_m = np.outer([0.0, anchor.scale * way_m], [math.cos(yaw_rad), math.sin(yaw_rad)])
        lat_deg, lon_deg = geo_from_local(anchor.world.frame, ends_m).T
    return WorldWay(lat_deg, lon_deg, np.full(len(lat_deg), anchor.scale * speed_mps))


def told(report: LotReport) -> str:
    """Return in a line or two what a drive on the lot came to."""
    if not report.lists:
        return "heard of no objects, and did not set off"
    late = f"{report.latency_ms_p50:.0f} ms (95 %: {report.latency_ms_p95:.0f} ms)"
    heard = f"{report.lists} lists of objects, {late} after the state that they are of"
    if not report.brakes:
        return f"{heard}; braked for nobody on {report.driven_m:.3g} m"
    stood = report.stood_before_m
    who = ", ".join(report.brakes)
    how = "did not have to stand" if stood is None else f"stood {stood:.1f} m before"
    return f"{heard}; braked for {who}, at first {report.braked_at_m:.1f} m ahead: {how}"
