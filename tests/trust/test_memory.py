"""Route memory is measured along the way that was driven, with it and without."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.orchestrator.routing.driven_speeds import DrivenSpeeds
from tests.telemetry.smoothing import SmoothedTrack
from tests.trust.memory import Moment, errors_m, mean_up_to, track_of
from tests.trust.truth import Truth

FRAME = LocalFrame(GeoPoint(52.5, 13.4))


def drive(speed_mps: np.ndarray, *, begin_s: float) -> Truth:
    """Along a straight road, at 10 Hz."""
    count = len(speed_mps)
    way_m = np.concatenate([[0.0], np.cumsum(0.1 * speed_mps[1:])])
    track = SmoothedTrack(
        stamp_ns=np.round((begin_s + 0.1 * np.arange(count)) * 1e9).astype(np.int64),
        xy_m=np.column_stack([way_m, np.zeros(count)]),
        speed_mps=speed_mps,
        yaw_rad=np.zeros(count),
        accel_mps2=np.zeros(count),
        yaw_rate_radps=np.zeros(count),
    )
    return Truth(FRAME, track, np.zeros((count, 2)), np.zeros(0, dtype=np.int64))


def test_who_always_slows_down_at_a_place_is_expected_to_slow_down_there() -> None:
    speeds = np.where(np.arange(600) < 200, 12.0, 6.0).astype(float)
    later, before = drive(speeds, begin_s=5000.0), drive(speeds, begin_s=0.0)
    earlier = DrivenSpeeds((track_of(before, 10**18),), FRAME)
    seen = [Moment(int((5000.0 + at) * 1e9), 12.0, 0.0, 12.0 / (50.0 / 3.6)) for at in (14, 16, 18)]
    found = errors_m(later, seen, earlier)

    without, remembered = (mean_up_to(found[name]) for name in ("without", "with"))
    assert len(found["with"]) == 3
    assert remembered[3] < 0.8 * without[3]


def test_a_road_that_nobody_drove_before_does_not_count() -> None:
    later = drive(np.full(600, 10.0), begin_s=5000.0)
    elsewhere = drive(np.full(600, 10.0), begin_s=0.0)
    elsewhere.track.xy_m[:, 1] += 500.0
    earlier = DrivenSpeeds((track_of(elsewhere, 10**18),), FRAME)

    assert len(errors_m(later, [Moment(5010 * 10**9, 10.0, 0.0, 0.7)], earlier)["with"]) == 0


def test_a_track_ends_where_it_is_cut() -> None:
    whole = drive(np.full(600, 10.0), begin_s=0.0)

    assert len(track_of(whole, 10**18).stamp_ns) == pytest.approx(599, abs=3)
    assert track_of(whole, 30 * 10**9).stamp_ns[-1] <= 30 * 10**9
