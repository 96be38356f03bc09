"""Sound cars whose logs are late, rough or stuck: nobody is accused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np
import pytest

from foretwin.contracts.drive import GnssFix
from foretwin.contracts.frames import GeoPoint
from foretwin.sim_worker.analysis.gap.verdict import FaultDetector
from tests.sim_worker.analysis.gap.judging_faults import verdicts_on
from tests.sim_worker.analysis.gap.test_verdict import END_S, SEED, judged_as
from tests.sim_worker.faulty_standin import drive_of, model_with, said_as
from tests.telemetry.standin_drive import FRAME


def test_positions_late_by_150_ms_make_no_bias_of_a_gyro() -> None:
    late = said_as(GnssFix, lambda m: {"stamp_ns": m.stamp_ns + 150_000_000})
    drive = drive_of(5, end_s=18.0).with_fault(late)
    detector = FaultDetector(drive.info, model_with(None), frame=FRAME)
    assert list(verdicts_on(detector, drive)) == []


def rough(message: GnssFix) -> dict[str, Any]:
    """A fix some metres beside where it says to the centimetre that the car is."""
    beside = np.random.default_rng(message.stamp_ns % 2**32).normal(0.0, 1e-5, 2)
    lat_deg, lon_deg = np.array([message.position.lat_deg, message.position.lon_deg]) + beside
    return {"position": GeoPoint(float(lat_deg), float(lon_deg), message.position.alt_m)}


def stuck() -> Callable[[GnssFix], dict[str, Any]]:
    """Fixes of a receiver that says each twelfth one again and again, with new stamps."""
    said: list[GeoPoint] = []

    def again(message: GnssFix) -> dict[str, Any]:
        said.append(message.position)
        return {"position": said[(len(said) - 1) // 12 * 12]}

    return again


@pytest.mark.parametrize("lie", [rough, stuck()], ids=["rough", "stuck"])
def test_positions_that_are_not_what_they_say_accuse_nobody(
    lie: Callable[[GnssFix], dict[str, Any]],
) -> None:
    told, _ = judged_as(said_as(GnssFix, lie))
    assert told == []


def test_positions_that_leap_accuse_no_speed() -> None:
    begin_ns = drive_of(SEED, end_s=END_S).info.start_stamp_ns + 7_000_000_000

    def leapt(message: GnssFix) -> dict[str, Any]:
        lat_deg = message.position.lat_deg + 1e-4 * (message.stamp_ns > begin_ns)
        return {"position": msgspec.structs.replace(message.position, lat_deg=lat_deg)}

    told, _ = judged_as(said_as(GnssFix, leapt))
    assert told == []
