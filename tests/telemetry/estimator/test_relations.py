"""The same drive told in another way gives the same states: no truth is needed to see that."""

from __future__ import annotations

import bisect
import math
from collections.abc import Iterable
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.drive import (
    GnssFix,
    HeadingSample,
    ImuSample,
    SteeringSample,
    VehicleState,
)
from foretwin.contracts.frames import GeoPoint
from foretwin.telemetry.estimator.estimator import StateEstimator
from tests.telemetry.position_track import FRAME, Sample, fix, info, states_of
from tests.telemetry.winding_drive import WINDING, measured, truly

COVERS = ("foretwin.telemetry.estimator.motion_track",)

replace = msgspec.structs.replace
CHANNELS = ("gyro", "wheels", "heading", "steering")
ALIKE = pytest.approx(0.0, abs=2e-6)
"""Degrees are rounded anew elsewhere: metres, radians and so on, after a while."""


def winding_drive(
    channels: Iterable[str], *, fix_every: int = 5, from_s: float = 0.0, until_s: float = 15.0
) -> list[Sample]:
    """A stretch of a drive to both sides, with these channels beside fixes good to 5 cm."""
    noise_m = np.random.default_rng(7).normal(0.0, 0.05, (len(WINDING), 2))
    samples: list[Sample] = []
    for tick in range(round(from_s * 50.0), round(until_s * 50.0)):
        samples += measured(tick, **dict.fromkeys(channels, truly))
        if tick % fix_every == 0:
            _, _, _, x_m, y_m = WINDING[tick]
            off = noise_m[tick]
            samples.append(fix(tick * 0.02, x_m + off[0], y_m + off[1]))
    return samples


def mirrored(message: Any) -> Any:
    """The image of a message in the meridian through the frame's origin."""
    match message:
        case GnssFix(position=place):
            lon_deg = 2.0 * FRAME.origin.lon_deg - place.lon_deg
            return replace(message, position=GeoPoint(place.lat_deg, lon_deg))
        case HeadingSample(yaw_rad=yaw):
            return replace(message, yaw_rad=math.pi - yaw)
        case ImuSample(accel_mps2=(ahead, left, up), rate_radps=(roll, pitch, turn)):
            return replace(message, accel_mps2=(ahead, -left, up), rate_radps=(-roll, pitch, -turn))
        case SteeringSample(tire_angle_rad=angle):
            return replace(message, tire_angle_rad=-angle)
    return message


def moved(message: Any, by_deg: float) -> Any:
    if not isinstance(message, GnssFix):
        return message
    lat_deg, lon_deg = message.position.lat_deg, message.position.lon_deg + by_deg
    return replace(message, position=GeoPoint(lat_deg, (lon_deg + 180.0) % 360.0 - 180.0))


def rows(states: Iterable[VehicleState], *, image: bool = False, east_deg: float = 0.0) -> Any:
    """Place (m), speed, acceleration, cosine and sine of the heading, turning: (N, 8)."""
    side = -1.0 if image else 1.0
    origin = FRAME.origin
    found = []
    for state in states:
        east = math.remainder(state.position.lon_deg - origin.lon_deg - east_deg, 360.0)
        found.append((
            side * east * 111_195.0 * math.cos(math.radians(origin.lat_deg)),
            (state.position.lat_deg - origin.lat_deg) * 111_195.0,
            state.speed_mps,
            state.accel_mps2,
            (side if state.yaw_valid else 1.0) * math.cos(state.yaw_rad),
            math.sin(state.yaw_rad),
            side * state.yaw_rate_radps,
            side * (state.tire_angle_rad or 0.0),
        ))  # fmt: skip
    return np.array(found)


drives = st.builds(
    winding_drive, st.sets(st.sampled_from(CHANNELS)), fix_every=st.sampled_from((5, 10, 50))
)


@settings(max_examples=4, deadline=None)
@given(samples=drives, shift_ns=st.integers(1, 4 * 10**18))
def test_time_has_no_beginning(samples: list[Sample], shift_ns: int) -> None:
    later = [(name, replace(said, stamp_ns=said.stamp_ns + shift_ns)) for name, said in samples]
    expected = [replace(one, stamp_ns=one.stamp_ns + shift_ns) for one in states_of(samples)]
    assert states_of(later) == expected


@settings(max_examples=4, deadline=None)
@given(samples=drives)
def test_a_mirrored_drive_has_the_mirrored_states(samples: list[Sample]) -> None:
    image = rows(states_of((name, mirrored(said)) for name, said in samples), image=True)
    assert np.abs(image - rows(states_of(samples))).max() == ALIKE


@settings(max_examples=4, deadline=None)
@given(samples=drives, by_deg=st.sampled_from((-13.39, 46.61, 166.61, 166.6097)))
def test_every_meridian_is_alike(samples: list[Sample], by_deg: float) -> None:
    """Greenwich, the border of a zone of UTM, and the date line, also in the middle of a drive."""
    elsewhere = states_of((name, moved(said, by_deg)) for name, said in samples)
    assert np.abs(rows(elsewhere, east_deg=by_deg) - rows(states_of(samples))).max() == ALIKE


@settings(max_examples=4, deadline=None)
@given(samples=drives)
def test_what_a_network_brings_twice_counts_once(samples: list[Sample]) -> None:
    twice = [sample for sample in samples for _ in range(2)]
    assert received(twice) == received(samples)


def received(samples: Iterable[Sample]) -> list[VehicleState]:
    estimator = StateEstimator(info())
    found = (
        estimator.handle(name, said, received_ns=said.stamp_ns + 10**12) for name, said in samples
    )
    return [state for state in found if state is not None]


@settings(max_examples=4, deadline=None)
@given(
    channels=st.sets(st.sampled_from(("wheels", "heading"))),
    fix_every=st.sampled_from((5, 10, 50)),
    cut_s=st.floats(3.0, 12.0),
)
def test_a_drive_cut_in_two_goes_on_as_it_was(
    channels: set[str], fix_every: int, cut_s: float
) -> None:
    """What begins while the car drives claims no speed that it is not sure of, nor a place."""
    options = {"fix_every": fix_every, "until_s": cut_s + 4.0}
    whole = states_of(winding_drive(channels, **options))
    stamps = [state.stamp_ns for state in whole]
    for state in states_of(winding_drive(channels, from_s=cut_s, **options)):
        before = whole[bisect.bisect_left(stamps, state.stamp_ns)]
        assert before.stamp_ns == state.stamp_ns
        if state.yaw_valid and state.speed_std_mps is not None:
            off_mps = abs(state.speed_mps - before.speed_mps)
            assert off_mps < 4.0 * state.speed_std_mps
            (x_m, y_m), (x0_m, y0_m) = (rows([one])[0, :2] for one in (state, before))
            assert math.hypot(x_m - x0_m, y_m - y0_m) < 1.5
