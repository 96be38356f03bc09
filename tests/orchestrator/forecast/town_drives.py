"""Drives through a town without a town: a car that follows limits, bends and stops, by numbers."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local
from foretwin.orchestrator.forecast.examples import Examples, examples_of

FRAME = LocalFrame(GeoPoint(52.5, 13.4))
STEP_S = 0.2


def town_states(*, seed: int, minutes: float, haste: float = 1.0) -> Iterator[VehicleState]:
    """Yield 5 states a second of a car that sets off, cruises and stops, again and again.

    `haste` multiplies its accelerations; some way bends as fast as the car is slow.
    """
    random = np.random.default_rng(seed)
    speed = target = x = y = yaw = 0.0
    hold_s = 1.0
    for k in range(round(minutes * 60.0 / STEP_S)):
        hold_s -= STEP_S
        if hold_s <= 0.0:
            target = float(random.choice([0.0, 4.0, 8.0, 12.0, 14.0]))
            hold_s = float(random.uniform(4.0, 15.0))
        limit = 1.5 * haste
        accel = float(np.clip((target - speed) / 1.5, -1.6 * limit, limit))
        accel *= float(random.uniform(0.7, 1.3))
        speed = max(0.0, speed + accel * STEP_S)
        rate = 0.25 if 2.0 < speed < 5.0 else 0.0
        yaw += rate * STEP_S
        x, y = x + speed * np.cos(yaw) * STEP_S, y + speed * np.sin(yaw) * STEP_S
        lat, lon = geo_from_local(FRAME, np.array([x, y]))
        yield VehicleState(
            vehicle_id="ego", stamp_ns=round(k * STEP_S * 1e9),
            position=GeoPoint(float(lat), float(lon)), yaw_rad=yaw, speed_mps=speed,
            yaw_rate_radps=rate, accel_mps2=accel,
        )  # fmt: skip


@cache
def town_examples(*, seed: int, minutes: float, haste: float = 1.0) -> Examples:
    return examples_of(town_states(seed=seed, minutes=minutes, haste=haste))
