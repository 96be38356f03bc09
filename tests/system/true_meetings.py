"""Circles that cross, on which stand-in cars meet again and again, and how they truly met."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import (
    GeoPoint,
    LocalFrame,
    geo_from_local,
    local_from_geo,
    local_from_geo_yaw,
)
from foretwin.geometry.rectangles import clearance
from foretwin.orchestrator.other_vehicles.encounters import NEAR_M
from foretwin.sim_worker.batch.collision_detection import ego_rectangles
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.orchestrator.other_vehicles.test_far_apart import narrower
from tests.orchestrator.other_vehicles.two_cars import TRUTH_S

CAR = load_vehicle(None)
WORLD = LocalFrame(GeoPoint(45.0015, -30.002))
"""Where they meet: beside the streets of the drawn town."""
RADIUS_M, LAP_S = 16.0, 22.0
APART_M = math.sqrt(2.0) * RADIUS_M
"""Between the middles of two circles that cross at right angles."""
LATE_S = 0.8, 2.2
"""Nobody touches who comes (length + width) / speed = 1.3 s before or after the other."""
SETTLED_S, WITHIN_M = 8.0, 0.2
MIDDLES_M = {"ego": 0.0, "second": APART_M, "third": -APART_M}
FIRST_TURN = {"second": 170.0 / 360.0, "third": 350.0 / 360.0}
"""Turns until the first meeting."""


def path_of(name: str, random: np.random.Generator, *, laps: int) -> dict[str, list[float]]:
    """A circle, again and again; who meets the car comes to the crossing somewhat late or early."""
    length_m = 2.0 * math.pi * RADIUS_M
    along_m = np.arange(0.0, (laps + 1.0) * length_m, 0.5)
    turns = along_m / length_m
    begins_rad = math.radians(235.0 if name == "ego" else 325.0)
    angle = begins_rad + math.tau * turns
    xy_m = RADIUS_M * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    lat, lon = geo_from_local(WORLD, xy_m + np.array([MIDDLES_M[name], 0.0])).T
    speed = np.full(len(turns), length_m / LAP_S)
    if name != "ego":
        late_s = random.choice((-1.0, 1.0), laps + 3) * random.uniform(*LATE_S, laps + 3)
        lap = np.maximum(np.ceil(turns - FIRST_TURN[name]), 0).astype(int)
        first_s = LAP_S * FIRST_TURN[name]
        stretched = np.where(
            lap == 0, 1.0 + late_s[0] / first_s, 1.0 + np.diff(late_s)[lap - 1] / LAP_S
        )
        speed = speed / stretched
    return {"lat_deg": lat.tolist(), "lon_deg": lon.tolist(), "speed_mps": speed.tolist()}


class TrueMeeting(NamedTuple):
    """An encounter as it was."""

    other: str
    from_s: float
    least_m: float
    touched: bool
    clear: bool
    """Whether it was none of a hair's breadth."""


def poses(folder: Path, name: str, time_s: Array) -> Array:
    """Return (N, 3) true poses in the World at times since they set off."""
    told = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
    lat, lon, yaw = (np.array(told[key]) for key in ("lat_deg", "lon_deg", "yaw_rad"))
    xy_m = local_from_geo(WORLD, lat, lon)
    yaw_rad = np.unwrap(local_from_geo_yaw(WORLD, yaw, lat, lon))
    columns = (*xy_m.T, yaw_rad)
    return np.stack([np.interp(time_s, told["since_s"], one) for one in columns], axis=1)


def truly(folder: Path, other: str, until_s: float) -> list[TrueMeeting]:
    """Return the encounters of the car with another as those see them who stand beside."""
    time_s = np.arange(SETTLED_S, until_s, TRUTH_S)
    own, theirs = poses(folder, "ego", time_s), poses(folder, other, time_s)
    apart = clearance(ego_rectangles(CAR, own), ego_rectangles(CAR, theirs))
    less = clearance(ego_rectangles(CAR, own), ego_rectangles(narrower(CAR, WITHIN_M), theirs))
    found, k = [], 0
    while (near := np.flatnonzero(apart[k:] < NEAR_M)).size:
        first = k + int(near[0])
        gone = np.flatnonzero(apart[first:] > 2.0 * NEAR_M)
        if not gone.size:
            break
        k = first + int(gone[0])
        least_m = float(apart[first:k].min())
        clear = least_m > WITHIN_M or float(less[first:k].min()) == 0.0
        if first:  # else it began before all had settled
            found.append(TrueMeeting(other, float(time_s[first]), least_m, least_m == 0.0, clear))
    return found
