"""Positions along a drawn path, and the states that an estimator makes of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from foretwin.contracts.drive import GnssFix, VehicleInfo, VehicleState
from foretwin.contracts.frames import (
    GeoPoint,
    LocalFrame,
    geo_from_local,
    local_from_geo,
    local_from_geo_yaw,
)
from foretwin.telemetry.estimator.estimator import StateEstimator

FRAME = LocalFrame(GeoPoint(52.51, 13.39, 0.0))
Sample = tuple[str, Any]


def info(**fields: Any) -> VehicleInfo:
    return VehicleInfo(vehicle_id="car", time_base="log", start_stamp_ns=0, **fields)


def fix(time_s: float, x_m: float, y_m: float, std_m: float | None = None) -> Sample:
    lat, lon = geo_from_local(FRAME, np.array([x_m, y_m]))
    position = GeoPoint(float(lat), float(lon))
    return "gnss", GnssFix(stamp_ns=round(time_s * 1e9), position=position, std_m=std_m)


def states_of(samples: Iterable[Sample], **options: Any) -> list[VehicleState]:
    estimator = StateEstimator(options.pop("info", info()), **options)
    states = (estimator.handle(channel, message) for channel, message in samples)
    return [state for state in states if state is not None]


def xy(state: VehicleState) -> np.ndarray:
    return local_from_geo(FRAME, state.position.lat_deg, state.position.lon_deg)


def yaw(state: VehicleState) -> float:
    position = state.position
    return float(local_from_geo_yaw(FRAME, state.yaw_rad, position.lat_deg, position.lon_deg))


def along(
    path: Callable[[float], tuple[float, float]], until_s: float, *, rate_hz: float = 5.0
) -> list[Sample]:
    return [fix(k / rate_hz, *path(k / rate_hz)) for k in range(round(until_s * rate_hz))]


def circle(time_s: float, *, radius_m: float = 15.0, speed_mps: float = 6.0) -> tuple[float, float]:
    angle = speed_mps / radius_m * time_s
    return radius_m * math.sin(angle), radius_m * (1.0 - math.cos(angle))
