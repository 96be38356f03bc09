"""A minute of the stand-in car in a town, and its positions as other receivers say."""

from __future__ import annotations

import functools
import math
from typing import Any

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import GnssFix, VehicleState
from foretwin.contracts.frames import GeoPoint, geo_from_local, local_from_geo, local_from_geo_yaw
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.path import DrivenPath
from foretwin.telemetry.standin.source import START_STAMP_NS, StandinSource
from tests.telemetry.standin_drive import FRAME, Drive

Sample = tuple[str, Any]
LEGS = (
    (90.0, 0.0),
    (6.0 * math.pi, 1 / 12),
    (70.0, 0.0),
    (7.5 * math.pi, -1 / 15),
    (60.0, 0.0),
    (95.0, 1 / 32),
    (90.0, 0.0),
)
"""Length and curvature of each."""
STOP_AT_M = 140.0
LONG_BEND_FROM_M = 262.5
"""Where the bend of 32 m radius begins, which takes over ten seconds."""


@functools.cache
def city_drive(
    *, ratio: float | None = None, compliance: float = 0.0, hill_m: float = 0.0, seed: int = 3
) -> Drive:
    """Return the drive from rest to rest, simulated once.

    With another steering ratio, a steering column that gives, or hills `hill_m` high.
    """
    x, y, yaw = 0.0, 0.0, 0.0
    points = [(x, y)]
    for length, curvature in LEGS:
        count = round(length)
        step = length / count
        for _ in range(count):
            x += step * math.cos(yaw + 0.5 * step * curvature)
            y += step * math.sin(yaw + 0.5 * step * curvature)
            yaw += step * curvature
            points.append((x, y))
    geo = geo_from_local(FRAME, np.array(points))
    wish = np.full(len(points), 12.0)
    wish[round(STOP_AT_M)] = 0.0
    parameters = read_parameters()
    car = msgspec.structs.replace(
        parameters.car,
        steering_ratio=ratio or parameters.car.steering_ratio,
        steering_compliance_rad_per_mps2=compliance,
    )
    parameters = msgspec.structs.replace(parameters, car=car)
    way_m = np.arange(len(points))
    heights = hill_m * (1.0 - np.cos(2.0 * math.pi * way_m / 150.0)) / 2.0 if hill_m else None
    path = DrivenPath(geo[:, 0], geo[:, 1], wish, driver=parameters.driver, altitude_m=heights)
    source = StandinSource(path, parameters, vehicle_id="standin", seed=seed)
    return Drive(source, list(source.advance(START_STAMP_NS + 200_000_000_000)))


def phone_positions(drive: Drive, *, seed: int, std_m: float = 3.0) -> list[Sample]:
    """Return the samples with the positions of a telephone: 1 Hz, alike over 30 s, no lever."""
    random = np.random.default_rng(seed)
    fading = math.exp(-1.0 / 30.0)
    error = random.normal(0.0, std_m, 2)
    samples: list[Sample] = []
    for channel, message in drive.samples:
        if channel != "gnss":
            samples.append((channel, message))
        elif (message.stamp_ns - START_STAMP_NS) % 1_000_000_000 == 0:
            lat, lon = geo_from_local(FRAME, antenna_xy(drive, message.stamp_ns) + error)
            place = GeoPoint(float(lat), float(lon), 1.45)
            samples.append(
                ("gnss", GnssFix(stamp_ns=message.stamp_ns, position=place, std_m=std_m))
            )
            step = random.normal(0.0, std_m * math.sqrt(1.0 - fading * fading), 2)
            error = fading * error + step
    return samples


def antenna_xy(drive: Drive, stamp_ns: int) -> Array:
    truth = drive.source.truth(stamp_ns)
    lever = drive.source.info.body_from_antenna_m
    assert lever is not None
    yaw = yaw_of(truth)
    cos, sin = math.cos(yaw), math.sin(yaw)
    return xy_of(truth) + np.array(
        [cos * lever[0] - sin * lever[1], sin * lever[0] + cos * lever[1]]
    )


def xy_of(state: VehicleState) -> Array:
    return local_from_geo(FRAME, state.position.lat_deg, state.position.lon_deg)


def yaw_of(state: VehicleState) -> float:
    place = state.position
    return float(local_from_geo_yaw(FRAME, state.yaw_rad, place.lat_deg, place.lon_deg))
