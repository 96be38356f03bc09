"""Which columns are positions."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.telemetry.logs.declare.places import places_of

METRE_DEG = 1.0 / 111_195.0


def held(values: Array, *, first: int) -> Array:
    """What a receiver that measures in each tenth row, from one on, has told until then."""
    rows = np.arange(len(values))
    return values[np.maximum(rows - (rows - first) % 10, 0)]


def test_latitude_and_longitude_are_of_one_receiver() -> None:
    time_s = np.arange(0.0, 200.0, 0.1)
    yaw = np.cumsum(0.02 * np.sin(time_s / 7.0))
    north, east = np.cumsum(0.9 * np.sin(yaw)), np.cumsum(0.9 * np.cos(yaw))
    lat, lon = 48.1 + north * METRE_DEG, 11.6 + east * METRE_DEG / np.cos(np.radians(48.1))
    columns = {
        f"{name} of {which}": held(values, first=first)
        for which, first in (("one", 0), ("another", 5))
        for name, values in (("lat", lat), ("lon", lon))
    }
    found = {
        tuple(sorted(place.fields.values()))
        for places in places_of(columns, time_s)
        for place in places
    }
    assert ("lat of one", "lon of one") in found
    assert ("lat of another", "lon of another") in found
    assert ("lat of one", "lon of another") not in found
    assert ("lat of another", "lon of one") not in found


def test_positions_that_share_times_are_not_timed_by_that_clock() -> None:
    time_s = np.arange(0.0, 200.0, 0.2)
    columns = {"x": 8.0 * time_s + 30.0 * np.sin(time_s / 9.0), "y": 100.0 * np.sin(time_s / 20.0)}
    assert places_of(columns, time_s)
    assert not places_of(columns, np.floor(time_s))
