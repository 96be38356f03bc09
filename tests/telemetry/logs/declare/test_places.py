"""Which columns are positions."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.telemetry.logs.declare import places
from foretwin.telemetry.logs.declare.motion import GridMotion, motion_of
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


def test_along_a_straight_road_one_coordinate_hardly_changes() -> None:
    """A motorway to the north, second by second, in numbers of single precision."""
    time_s = np.arange(900.0)
    north = np.cumsum(15.2 + 15.0 * np.sin(time_s / 40.0))
    lat = 41.65 + north * METRE_DEG
    lon = -93.5 + 40.0 * np.sin(north / 2_000.0) * METRE_DEG / np.cos(np.radians(41.65))
    columns = {"lat": lat.astype(np.float32) * 1.0, "lon": lon.astype(np.float32) * 1.0}
    together = np.mean((np.diff(columns["lat"]) != 0) & (np.diff(columns["lon"]) != 0))
    assert 0.3 < together < 0.6
    found = [place for alike in places_of(columns, time_s) for place in alike]
    assert {"latitude": "lat", "longitude": "lon"} in [place.fields for place in found]
    assert {place.unit for place in found} == {"deg"}


def test_beside_plain_degrees_no_pair_of_columns_is_looked_at_as_lengths(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What a car's own bus tells wanders as cars do: of fifty columns thousands of pairs."""
    time_s = np.arange(600.0)
    yaw = np.cumsum(0.05 * np.sin(time_s / 15.0))
    north, east = np.cumsum(9.0 * np.sin(yaw)), np.cumsum(9.0 * np.cos(yaw))
    columns = {
        "lat": 48.1 + north * METRE_DEG,
        "lon": 11.6 + east * METRE_DEG / np.cos(np.radians(48.1)),
    }
    for number in range(50):
        columns[f"pid{number}"] = 20.0 + number + 9.0 * np.sin(time_s / (3.0 + 0.1 * number))
    looked_at = 0

    def counted(time_s: Array, xy_m: Array) -> GridMotion | None:
        nonlocal looked_at
        looked_at += 1
        return motion_of(time_s, xy_m)

    monkeypatch.setattr(places, "motion_of", counted)
    ((*found,),) = places_of(columns, time_s)
    assert {"latitude": "lat", "longitude": "lon"} in [place.fields for place in found]
    assert looked_at == len(found) < 10
