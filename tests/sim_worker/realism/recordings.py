"""Cars recorded at two crossings, at even times: Mcity's test track and Karlsruhe's K729."""

from __future__ import annotations

import csv
import json
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.signal import savgol_filter

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo

STEP_S = 0.1
FILTER_S = 1.5
"""Positions are fitted by parabolas over so long: tracked cars shake, and stand still while they
are not seen. Simulated ones are fitted alike."""
_LEAST_S, _JUMP_M = 3.0, 5.0
_MCITY = LocalFrame(GeoPoint(42.300947, -83.698649))
_CAR_M = (4.6, 1.9)


class Track(NamedTuple):
    """One car: from step `first` of its recording on, `xy_m` (N, 2) every `STEP_S`."""

    name: str
    first: int
    xy_m: Array
    size_m: tuple[float, float]


class Recording(NamedTuple):
    """Cars that were there at the same time."""

    name: str
    tracks: tuple[Track, ...]


class Motion(NamedTuple):
    """What a track's positions tell at each step (N,): speed, acceleration along, yaw rate."""

    speed_mps: Array
    along_mps2: Array
    across_mps2: Array


def motion(xy_m: Array) -> Motion:
    """Return the motion of positions (N, 2), by parabolas over `FILTER_S`."""
    window = min(round(FILTER_S / STEP_S) | 1, (len(xy_m) - 1) | 1)
    window = window if window <= len(xy_m) else window - 2
    velocity, accel = (
        savgol_filter(xy_m, window, 2, deriv=n, delta=STEP_S, axis=0, mode="interp") for n in (1, 2)
    )
    speed = np.hypot(*velocity.T)
    ahead = velocity / np.maximum(speed, 0.5)[:, None]
    along = (accel * ahead).sum(axis=1)
    across = ahead[:, 0] * accel[:, 1] - ahead[:, 1] * accel[:, 0]
    return Motion(speed, along, across)


def mcity(data: Path) -> tuple[Recording, ...]:
    """Return the cars with satellite receivers of Mcity's trials."""
    found = []
    for path in sorted((data / "traffic-mcity-rtk").glob("gts/gps_data_*.json")):
        rows: dict[str, list[tuple[float, float, float]]] = defaultdict(list)
        for instant in json.loads(path.read_text(encoding="utf-8")):
            for one in instant["objs"]:
                rows[str(one["id"])].append((instant["timestamp"], one["lat"], one["lon"]))
        places = {}
        for key, row in rows.items():
            time, lat, lon = np.array(row).T
            places[key] = (time, local_from_geo(_MCITY, lat, lon), _CAR_M)
        found.append(Recording(path.stem, tuple(_even(places))))
    return tuple(found)


def karlsruhe(data: Path) -> tuple[Recording, ...]:
    """Return the cars that cameras tracked at Karlsruhe's crossing."""
    found = []
    for path in sorted((data / "traffic-karlsruhe-k729").glob("vehicle_tracks_*.csv")):
        rows: dict[str, list[tuple[float, ...]]] = defaultdict(list)
        with path.open(encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                if row["agent_type"] == "Car":
                    number = [float(row[name]) for name in ("x", "y", "length", "width")]
                    rows[row["track_id"]].append((float(row["timestamp_ms"]) / 1e3, *number))
        places = {}
        for key, lines in rows.items():
            time, x, y, length, width = np.array(lines).T
            size = (float(np.median(length)), float(np.median(width)))
            places[key] = (time, np.stack([x, y], axis=1), size)
        found.append(Recording(path.stem, tuple(_even(places))))
    return tuple(found)


Places = Mapping[str, tuple[Array, Array, tuple[float, float]]]


def _even(places: Places) -> Iterator[Track]:
    """Yield tracks at even times; where a car jumps or is lost for a second, another one begins."""
    if not places:
        return
    begin = min(float(time[0]) for time, *_ in places.values())
    for name, (time, xy, size) in places.items():
        moved = np.append(True, (np.diff(xy, axis=0) != 0.0).any(axis=1))
        # A place that was told again was not measured again; who stands is told anew each second.
        fresh = moved | (np.arange(len(time)) % 10 == 0)
        time, xy = time[fresh] - begin, xy[fresh]
        apart = (np.diff(time) > 1.5) | (np.hypot(*np.diff(xy, axis=0).T) > _JUMP_M)
        cuts = np.flatnonzero(apart) + 1
        pieces = zip(np.split(time, cuts), np.split(xy, cuts), strict=True)
        for number, (when, where) in enumerate(pieces):
            if when[-1] - when[0] < _LEAST_S:
                continue
            steps = np.arange(np.ceil(when[0] / STEP_S), np.floor(when[-1] / STEP_S) + 1)
            even = np.stack([np.interp(steps * STEP_S, when, column) for column in where.T], axis=1)
            yield Track(f"{name}.{number}", int(steps[0]), even, size)
