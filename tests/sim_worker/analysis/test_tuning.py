"""What is watched of a vehicle goes on after its clock was set, and after a wrong stamp."""

from __future__ import annotations

import functools
from typing import Any

import msgspec
import pytest

from foretwin.contracts.drive import SpeedSample
from foretwin.contracts.gap import GapSample
from foretwin.sim_worker.analysis.tuning import SAMPLES, VehicleWatch
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.estimator.estimator import StateEstimator
from foretwin.telemetry.standin.source import START_STAMP_NS
from tests.telemetry.city_drive import city_drive
from tests.telemetry.standin_drive import FRAME

HOUR_NS = 3_600_000_000_000
UNTIL_NS = START_STAMP_NS + 8_000_000_000


@functools.cache
def messages() -> tuple[tuple[str, Any], ...]:
    """The first seconds of the city drive: samples, and the states that follow from them."""
    drive = city_drive()
    estimator = StateEstimator(drive.source.info)
    found: list[tuple[str, Any]] = []
    for channel, message in drive.samples:
        if message.stamp_ns > UNTIL_NS:
            break
        if channel in SAMPLES:
            found.append((channel, message))
            state = estimator.handle(channel, message)
            if state is not None:
                found.append(("state", state))
    return tuple(found)


def gaps(watch: VehicleWatch, *, later_ns: int = 0) -> list[GapSample]:
    """Drive with all stamps so much later; return the gaps found."""
    found = []
    for channel, message in messages():
        moved = msgspec.structs.replace(message, stamp_ns=message.stamp_ns + later_ns)
        found += [one for one in watch.handle(channel, moved) if isinstance(one, GapSample)]
    return found


@pytest.fixture
def watch() -> VehicleWatch:
    return VehicleWatch(city_drive().source.info, load_vehicle(), frame=FRAME)


def test_a_clock_that_is_set_back_begins_anew(watch: VehicleWatch) -> None:
    before = gaps(watch)
    after = gaps(watch, later_ns=-HOUR_NS)
    assert len(before) >= 6
    assert [one.along_m for one in after] == [one.along_m for one in before]


def test_one_wrong_stamp_makes_no_later_sample_late(watch: VehicleWatch) -> None:
    first = next(message for channel, message in messages() if channel == "state")
    watch.handle("state", first)
    wrong = SpeedSample(stamp_ns=first.stamp_ns + HOUR_NS, speed_mps=3.0)
    assert watch.handle("speed", wrong) == []
    found = gaps(watch)
    assert len(found) >= 6
    assert all(one.independent for one in found)
