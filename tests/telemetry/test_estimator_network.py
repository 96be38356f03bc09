"""The estimator on telemetry as it is: lost, late, out of order, doubled, with a foreign clock."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from foretwin.contracts.frames import local_from_geo
from foretwin.telemetry.standin.source import START_STAMP_NS
from tests.telemetry.city_drive import (
    FRAME,
    LONG_BEND_FROM_M,
    antenna_xy,
    city_drive,
    phone_positions,
)
from tests.telemetry.city_errors import Heard, heard, without
from tests.telemetry.impaired import PERFECT, ForeignClock, Network

LOST_S = 10.0
SILENT_S = (12.0, 13.0)


@functools.cache
def bend_from_s() -> float:
    """Return when the car enters the long bend."""
    source = city_drive().source
    driven_m, time_s = 0.0, 0.0
    while driven_m < LONG_BEND_FROM_M + 2.0:
        driven_m += 0.1 * source.truth(START_STAMP_NS + round(time_s * 1e9)).speed_mps
        time_s += 0.1
    return time_s


@functools.cache
def rtk() -> Heard:
    """Return the drive with good positions, lost for 10 s in a bend, and once without speed."""
    at_s = bend_from_s()
    samples = without(city_drive().samples, "gnss", at_s, at_s + LOST_S)
    return heard(without(samples, "speed", *SILENT_S))


def test_the_clock_is_found_up_to_the_least_delay() -> None:
    """One-way data cannot part the offset from the 10 ms that every sample takes at least."""
    clock = rtk().estimator.clock
    end_s = (rtk().states[-1].stamp_ns - START_STAMP_NS) * 1e-9
    assert clock.offset_ns is not None
    assert clock.drift_ppm is not None
    assert clock.offset_ns * 1e-9 == pytest.approx(-1.0 + 0.01 - 50e-6 * end_s, abs=0.001)
    assert clock.drift_ppm == pytest.approx(50.0, abs=10.0)
    assert clock.steps == ()


def test_with_good_positions_place_and_heading_are_close() -> None:
    drive = rtk()
    lost_from_s = bend_from_s()
    held = ~drive.between(lost_from_s, lost_from_s + LOST_S + 0.3)
    assert np.percentile(drive.position_m[held], 95) < 0.15
    assert np.degrees(np.percentile(drive.yaw_rad, 95)) < 1.0
    assert np.sqrt(np.mean(drive.speed_mps**2)) < 0.05
    assert np.sqrt(np.mean(drive.yaw_rate_radps**2)) < 0.01
    assert drive.time_s[0] < 4.0
    gaps_s = np.diff([state.stamp_ns for state in drive.states]) * 1e-9
    assert gaps_s.min() >= 0.0
    assert gaps_s.max() < 0.2


def test_ten_seconds_in_a_bend_without_positions_are_bridged() -> None:
    drive = rtk()
    end_s = bend_from_s() + LOST_S
    last = drive.between(end_s - 1.0, end_s - 0.05)
    assert drive.position_m[last].max() < 3.0
    assert drive.position_m[last].max() < 3.0 * np.sqrt(2.0) * drive.stated_std_m[last].max()
    assert all("gnss" in state.stale for state, at in zip(drive.states, last, strict=True) if at)


def test_silence_of_one_channel_is_flagged_within_200_ms_and_ends_with_it() -> None:
    drive = rtk()
    flagged = np.array(["speed" in state.stale for state in drive.states])
    silent = drive.between(*SILENT_S)
    assert drive.time_s[flagged & silent][0] - SILENT_S[0] < 0.2
    assert not flagged[drive.between(SILENT_S[1] + 0.1, 60.0)].any()
    assert not any("imu" in state.stale for state in drive.states[50:])


def test_doubled_samples_are_counted_and_change_nothing() -> None:
    drive = rtk()
    assert set(drive.estimator.doubled) >= {"imu", "speed", "steering"}
    assert not drive.estimator.late
    assert not drive.estimator.skipped


def test_a_perfect_network_gives_what_the_log_gives() -> None:
    samples = [s for s in city_drive().samples if s[1].stamp_ns < START_STAMP_NS + 8 * 10**9]
    live = heard(samples, network=PERFECT, clock=ForeignClock())
    log = heard(samples, network=PERFECT, with_receipt=False)
    assert live.states == log.states
    assert len(live.states) > 300


@pytest.mark.judge
def test_other_seeds_and_clocks_hold_too() -> None:
    for seed in range(1, 6):
        clock = ForeignClock(ahead_s=(-1.0) ** seed, fast_ppm=50.0 * (-1.0) ** seed)
        drive = heard(city_drive().samples, clock=clock, seed=seed)
        assert np.percentile(drive.position_m, 95) < 0.15
        assert np.degrees(np.percentile(drive.yaw_rad, 95)) < 1.0


@pytest.mark.judge
def test_rough_positions_that_wander_are_better_than_their_source_and_honest() -> None:
    """3 m that stay alike over 30 s: their mean error of a minute is nobody's to know.

    The best that any filter can do after T seconds is 3 m sqrt(2 / (2 + T / 30 s)) on each axis.
    """
    raw, found, within = [], [], []
    for seed in range(8):
        samples = phone_positions(city_drive(), seed=seed)
        drive = heard(samples, seed=seed)
        for channel, fix in samples:
            if channel == "gnss":
                at = local_from_geo(FRAME, fix.position.lat_deg, fix.position.lon_deg)
                raw.append(np.hypot(*(at - antenna_xy(city_drive(), fix.stamp_ns))))
        late = drive.time_s > 30.0
        found.append(drive.position_m[late])
        within.append(drive.position_m[late] < 2.448 * drive.stated_std_m[late])
        assert np.degrees(np.percentile(drive.yaw_rad[late], 95)) < 4.0
    assert np.percentile(np.concatenate(found), 95) < 0.9 * np.percentile(raw, 95)
    assert np.mean(np.concatenate(within)) > 0.85


@pytest.mark.judge
def test_a_network_that_stalls_is_survived() -> None:
    drive = heard(city_drive().samples, network=Network(loss=0.4, jitter_s=0.25))
    assert np.percentile(drive.position_m, 95) < 0.3
