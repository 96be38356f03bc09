"""The measures of trust themselves: what counts as a slip, a false standstill, an honest error."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import ImuSample
from foretwin.contracts.frames import LocalFrame
from foretwin.telemetry.estimator.estimator import StateEstimator
from foretwin.telemetry.logs import Log
from tests.telemetry.position_track import FRAME, info
from tests.telemetry.smoothing import SmoothedTrack
from tests.trust.consistency import consistency_of
from tests.trust.drives import given_drives
from tests.trust.states import States, states_of
from tests.trust.truth import Truth, slips_of, smoothed, torn_at, truth_of, turned_by_gyro

STAMPS = (np.arange(0.0, 40.0, 0.2) * 1e9).astype(np.int64)


def driven(*, speed_mps: float = 8.0) -> Array:
    """A bend of 20 m radius, as (N, 2)."""
    angle = speed_mps / 20.0 * STAMPS * 1e-9
    noise = np.random.default_rng(1).normal(0.0, 0.005, (len(STAMPS), 2))
    return 20.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1) + noise


def perfect(truth: Truth, frame: LocalFrame = FRAME) -> States:
    """States that are the truth, and say 0.1 m, 0.02 rad and 0.1 m/s of themselves."""
    track, ones = truth.track, np.ones(len(STAMPS))
    estimator = StateEstimator(info())
    return States(
        STAMPS, track.xy_m.copy(), track.yaw_rad.copy(), track.speed_mps.copy(),
        0.1 * ones, 0.02 * ones, 0.1 * ones, estimator, estimator.skipped, len(ones), 0.0,
    )  # fmt: skip


def test_a_lasting_slip_and_a_single_wrong_fix_are_found_and_a_bend_is_none() -> None:
    clean = driven()
    slipped = clean.copy()
    slipped[60:] += [0.6, -0.4]
    slipped[120] += [0.0, 1.0]
    assert not slips_of(STAMPS, clean, position_std_m=0.01).any()
    slip = slips_of(STAMPS, slipped, position_std_m=0.01)
    assert slip[60] == pytest.approx([0.6, -0.4], abs=0.1)
    assert slip[120] - slip[119] == pytest.approx([0.0, 1.0], abs=0.1)
    assert slip[-1] == pytest.approx([0.6, -0.4], abs=0.15)


def test_a_tight_bend_of_fixes_once_a_second_is_no_slip() -> None:
    seldom = (np.arange(0.0, 60.0) * 1e9).astype(np.int64)
    angle = np.clip(np.arange(0.0, 60.0) - 30.0, 0.0, 3.0) * np.pi / 6.0
    steps = 5.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    assert not slips_of(seldom, np.cumsum(steps, axis=0), position_std_m=0.01).any()


def test_slips_leave_the_true_speed_alone() -> None:
    slipped = driven()
    slipped[60:] += [0.6, -0.4]
    truth = smoothed(FRAME, STAMPS, slipped, position_std_m=0.01)
    assert truth.track.speed_mps[5:-5] == pytest.approx(8.0, abs=0.15)
    assert truth.track.xy_m[5:-5] == pytest.approx(slipped[5:-5], abs=0.1)


def test_a_reference_that_was_bridged_by_a_chord_is_torn_at_its_ends_and_a_bend_is_not() -> None:
    clean = driven()
    bridged = clean.copy()
    share = np.linspace(0.0, 1.0, 12)[:, None]
    bridged[60:72] = bridged[60] + share * (bridged[71] - bridged[60])
    assert not torn_at(STAMPS, clean).any()
    assert np.flatnonzero(torn_at(STAMPS, bridged)).tolist() == [59, 70]


def test_a_bend_that_the_receiver_has_smoothed_is_as_sharp_in_the_truth_as_the_gyro_felt_it() -> (
    None
):
    time_s = np.arange(0.0, 120.0, 0.1)
    rate = np.where(np.abs(time_s - 60.0) < 1.5, np.pi / 6.0, 0.0)
    yaw = np.cumsum(rate) * 0.1
    late = np.interp(time_s, [0.0, 58.0, 66.0, 120.0], [0.0, 0.0, yaw[-1], yaw[-1]])
    stamps = (time_s * 1e9).astype(np.int64)
    speed, still = np.full(len(stamps), 8.0), np.zeros(len(stamps))
    track = SmoothedTrack(stamps, np.zeros((len(stamps), 2)), late, speed, rate, still)
    drifting = [
        ImuSample(stamp_ns=int(at), accel_mps2=(0.0, 0.0, 9.8), rate_radps=(0.0, 0.0, turn + 0.002))
        for at, turn in zip(stamps, rate, strict=True)
    ]
    told = turned_by_gyro(track, drifting).yaw_rad
    assert np.abs(late - yaw).max() > np.radians(40.0)
    assert np.abs(told - yaw).max() < np.radians(4.0)


def test_where_the_reference_is_torn_it_says_nothing_against_a_state() -> None:
    truth = smoothed(FRAME, STAMPS, driven(), position_std_m=0.01)
    states = perfect(truth)
    states.yaw_rad[120:122] += np.radians(25.0)
    states.yaw_rad[150] += np.radians(25.0)
    found = consistency_of(states, truth._replace(torn=STAMPS[[120]]))
    assert found.yaw_losses_s == (pytest.approx(30.0),)
    assert found.torn_s == (pytest.approx(24.0),)


def test_states_that_are_true_are_found_faultless_and_others_not() -> None:
    truth = smoothed(FRAME, STAMPS, driven(), position_std_m=0.01)
    states = perfect(truth)
    good = consistency_of(states, truth)
    assert good.false_standstills_s == good.yaw_losses_s == ()
    assert (good.position_within, good.yaw_within, good.speed_within) == (1.0, 1.0, 1.0)
    states.speed_mps[100:103] = 0.0
    states.speed_mps[150] = 0.0
    states.yaw_rad[120] += np.radians(25.0)
    states.xy_m[:] += [0.3, 0.0]
    bad = consistency_of(states, truth)
    assert bad.false_standstills_s == (pytest.approx(20.0),)
    assert bad.yaw_losses_s == (pytest.approx(24.0),)
    assert bad.position_within == 0.0
    assert bad.position_rms_m == pytest.approx(0.3)
    assert bad.speed_rms_mps > 0.5


@pytest.mark.parametrize(("better", "share"), [(1.0, 0.95), (0.5, 0.936), (0.1, 0.918)])
def test_one_deviation_for_both_axes_holds_less_where_one_is_known_better(
    better: float, share: float
) -> None:
    truth = smoothed(FRAME, STAMPS, driven(), position_std_m=0.01)
    random, within = np.random.default_rng(2), []
    for _ in range(50):
        off = random.normal(0.0, 0.1, (len(STAMPS), 2)) * [1.0, better]
        told_m = np.full(len(STAMPS), 0.1 * np.sqrt(0.5 * (1.0 + better**2)))
        states = perfect(truth)._replace(xy_m=truth.track.xy_m + off, position_std_m=told_m)
        within.append(consistency_of(states, truth).position_within)
    assert np.mean(within) == pytest.approx(share, abs=0.008)


@pytest.mark.real_data
def test_a_survey_receivers_slips_are_found_on_a_real_drive(data_dir: Path) -> None:
    drive = next(d for d in given_drives(data_dir) if d.name == "potsdamer-platz")
    truth = truth_of(drive)
    seconds = (truth.slips - truth.track.stamp_ns[0]) * 1e-9
    for known_s in (152.9, 241.9, 276.9):
        assert np.abs(seconds - known_s).min() < 0.31
    beside = next(d for d in given_drives(data_dir) if d.name == "potsdamer-platz-odometry")
    wheels = [m for channel, m in beside.log().samples() if channel == "speed"]
    at = np.array([sample.stamp_ns for sample in wheels])
    measured = np.array([sample.speed_mps for sample in wheels])
    off = truth.at(at, "speed_mps") - measured
    assert np.sqrt(np.mean(off**2)) < 0.3
    assert len(states_of(drive.log(), truth.frame).stamp_ns) > 1300


@pytest.mark.real_data
def test_by_its_receivers_clock_the_dresden_logger_drives_evenly(data_dir: Path) -> None:
    """The computer's clock stands still and hurries: by it the car went 7 and 20 m/s at 15."""
    speeds = {}
    for name in ("dresden-2", "dresden-2-own-clock"):
        drive = next(d for d in given_drives(data_dir) if d.name == name)
        track = truth_of(drive).track
        speeds[name] = np.ptp(track.speed_mps[20:-20])
        samples = list(drive.log().samples())
        assert [s[1].stamp_ns for s in samples] == sorted(s[1].stamp_ns for s in samples)
    assert speeds["dresden-2"] > 10.0
    assert speeds["dresden-2-own-clock"] < 3.0


@pytest.mark.real_data
@pytest.mark.parametrize("name", ["comma2k19-ublox", "potsdamer-platz-pseudoranges"])
def test_receivers_that_state_nothing_are_told_as_far_off_as_another_has_them(
    name: str, data_dir: Path
) -> None:
    drive = next(d for d in given_drives(data_dir) if d.name == name)
    log, truth = drive.log(), truth_of(drive)
    silent = [
        (channel, msgspec.structs.replace(message, std_m=None) if channel == "gnss" else message)
        for channel, message in log.samples()
    ][:6000]
    states = states_of(Log(info=log.info, read=lambda _: iter(silent)), truth.frame)
    assert consistency_of(states, truth).position_within > 0.9
