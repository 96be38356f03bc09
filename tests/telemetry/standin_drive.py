"""A short drive of the stand-in car that several tests look at: two bends, one stop, 150 m."""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.path import DrivenPath
from tests.telemetry.known_standin import KnownStandin

FRAME = LocalFrame(GeoPoint(52.51, 13.39))
STOP_AT_M = 75.0


class Wish(NamedTuple):
    """Positions (N,) in degrees and wished speeds (N,)."""

    lat_deg: Array
    lon_deg: Array
    speed_mps: Array


def wished_path(*, speed_mps: float = 9.0, stop: bool = True) -> Wish:
    """Return 50 m east, a left bend of 10 m radius, a stop at 75 m, and a right bend of 14 m."""
    legs = [
        (50.0, 0.0),
        (5.0 * math.pi, 0.1),
        (18.0, 0.0),
        (7.0 * math.pi, -1.0 / 14.0),
        (45.0, 0.0),
    ]
    x, y, yaw = 0.0, 0.0, 0.0
    points = [(x, y)]
    for length, curvature in legs:
        count = round(length)
        for _ in range(count):
            step = length / count
            x += step * math.cos(yaw + 0.5 * step * curvature)
            y += step * math.sin(yaw + 0.5 * step * curvature)
            yaw += step * curvature
            points.append((x, y))
    geo = geo_from_local(FRAME, np.array(points))
    speed = np.full(len(points), speed_mps)
    if stop:
        speed[round(STOP_AT_M)] = 0.0
    return Wish(geo[:, 0], geo[:, 1], speed)


def new_source(*, seed: int = 1, **options: Any) -> KnownStandin:
    """Return a car at the beginning of the path."""
    parameters = read_parameters()
    path = DrivenPath(*wished_path(), driver=parameters.driver)
    return KnownStandin(path, parameters, vehicle_id="standin", seed=seed, **options)


class Drive(NamedTuple):
    """A car that has arrived, and everything that it sent."""

    source: KnownStandin
    samples: list[tuple[str, Any]]


@functools.cache
def whole_drive() -> Drive:
    """Return the drive from rest to rest, simulated once."""
    source = new_source()
    samples = list(source.advance(source.first_stamp_ns + 120_000_000_000))
    return Drive(source, samples)
