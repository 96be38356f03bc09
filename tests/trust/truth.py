"""What a whole log says a car did: smoothed, looking ahead, and proof against a receiver's slips.

A survey receiver's positions are good to centimetres but for slips: from one fix to the next they
step by 0.3 to 2 m and go on as before. The car did not. So the slips are found, the track without
them is smoothed, which gives motion and heading, and the slips are put back, which gives the place
as the receiver means it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import GnssFix, HeadingSample, ImuSample
from foretwin.contracts.frames import LocalFrame, grid_convergence, local_from_geo
from tests.telemetry.smoothing import SmoothedTrack, smooth_positions
from tests.trust.drives import RealDrive

_REACH = 4
"""Intervals before and after one that say what it should have been."""
_DENSE_S = 0.5
"""Between fixes that come more seldom a car turns as far as a receiver slips."""
_LEAST_SLIP_M = 0.08
_CAR_MPS2 = 2.0
"""What a car's motion may differ from its neighbours' straight line: jerk and curvature."""
JERK_DENSITY = 4.0
_STRAIGHT_S, _STRAIGHT_MPS, _STRAIGHT_RAD = 5.0, 4.0, 0.1
"""Who has been so fast and has turned no farther for so long before and after goes straight."""
_DRIFT_S = 15.0
_TYRES_MPS2 = 10.0
"""No car on tyres accelerates, brakes or turns harder (1 g)."""


class Truth(NamedTuple):
    """A car's motion in a frame at N stamps; `slip_m` (N, 2) is what the receiver has slipped.

    `track.xy_m` holds the slips. Headings come from the course; `moving` (N,) tells where it says
    something. `torn` (K,) are the stamps at which the reference, without its slips, still moves as
    no car can: there it was bridged or joined, and says nothing of heading and speed.
    """

    frame: LocalFrame
    track: SmoothedTrack
    slip_m: Array
    torn: npt.NDArray[np.int64]

    @property
    def way_m(self) -> Array:
        """(N,) how far the car had come."""
        speed, since_s = self.track.speed_mps, (self.track.stamp_ns - self.track.stamp_ns[0]) * 1e-9
        steps_m = 0.5 * np.diff(since_s) * (speed[1:] + speed[:-1])
        return np.concatenate([[0.0], np.cumsum(steps_m)])

    def at(self, stamp_ns: npt.NDArray[np.int64], name: str) -> Array:
        """Return a field of the track, interpolated at (M,) stamps; positions are (M, 2)."""
        base = self.track.stamp_ns
        values = np.asarray(getattr(self.track, name))
        shape = (len(stamp_ns), *values.shape[1:])
        columns = values.reshape(len(base), -1).T
        since = (stamp_ns - base[0]) * 1e-9
        return np.stack(
            [np.interp(since, (base - base[0]) * 1e-9, column) for column in columns], axis=1
        ).reshape(shape)

    @property
    def slips(self) -> npt.NDArray[np.int64]:
        """The stamps (K,) of fixes that slipped."""
        stepped = np.hypot(*np.diff(self.slip_m, axis=0).T) > 0.0
        return self.track.stamp_ns[1:][stepped]


def truth_of(drive: RealDrive) -> Truth:
    """Return the truth that a drive's reference gives."""
    samples = [message for _, message in drive.reference().samples()]
    fixes = [message for message in samples if isinstance(message, GnssFix)]
    frame = LocalFrame(fixes[0].position)
    stamps = np.array([fix.stamp_ns for fix in fixes], dtype=np.int64)
    lat, lon = (
        np.array([getattr(f.position, name) for f in fixes]) for name in ("lat_deg", "lon_deg")
    )
    truth = smoothed(
        frame, stamps, local_from_geo(frame, lat, lon), position_std_m=drive.position_std_m
    )
    if drive.gyro_heading:
        turning = [message for message in samples if isinstance(message, ImuSample)]
        return truth._replace(track=turned_by_gyro(truth.track, turning))
    if not drive.true_heading:
        return truth
    said = [message for message in samples if isinstance(message, HeadingSample)]
    yaw = np.unwrap([one.yaw_rad for one in said])
    measured = np.interp(stamps, [one.stamp_ns for one in said], yaw)
    yaw = measured + np.asarray(grid_convergence(frame, lat, lon))
    return truth._replace(track=truth.track._replace(yaw_rad=yaw))


def turned_by_gyro(track: SmoothedTrack, samples: list[ImuSample]) -> SmoothedTrack:
    """Return the track with the gyro's turning, and the course's direction over half a minute.

    For positions that their receiver has smoothed itself: a bend of 3 s takes 7 in them. Where the
    car is fast and goes straight before and after, course and gyro differ by the gyro's drift.
    """
    start_ns = track.stamp_ns[0]
    time_s = (track.stamp_ns - start_ns) * 1e-9
    at_s = np.array([(one.stamp_ns - start_ns) * 1e-9 for one in samples])
    rate = np.array([one.rate_radps[2] for one in samples])
    mean_rate = 0.5 * (rate[1:] + rate[:-1])
    turned = np.concatenate([[0.0], np.cumsum(mean_rate * np.diff(at_s))])
    turned = np.interp(time_s, at_s, turned)
    known = []
    for now_s, speed in zip(time_s, track.speed_mps, strict=True):
        around = turned[np.abs(time_s - now_s) < _STRAIGHT_S]
        known.append(float(speed > _STRAIGHT_MPS and np.ptp(around) < _STRAIGHT_RAD))
    drift = np.exp(1j * (track.yaw_rad - turned))
    weight = np.exp(-0.5 * ((time_s[:, None] - time_s) / _DRIFT_S) ** 2) * np.array(known)
    return track._replace(yaw_rad=np.unwrap(turned + np.angle(weight @ drift)))


def smoothed(
    frame: LocalFrame, stamp_ns: npt.NDArray[np.int64], xy_m: Array, *, position_std_m: float
) -> Truth:
    """Return the truth of N increasing stamps and (N, 2) positions."""
    slip = slips_of(stamp_ns, xy_m, position_std_m=position_std_m)
    track = smooth_positions(
        stamp_ns, xy_m - slip, position_std_m=position_std_m, jerk_density=JERK_DENSITY
    )
    torn = torn_at(stamp_ns, xy_m - slip)
    return Truth(frame, track._replace(xy_m=track.xy_m + slip), slip, stamp_ns[1:-1][torn])


def torn_at(stamp_ns: npt.NDArray[np.int64], xy_m: Array) -> npt.NDArray[np.bool_]:
    """Return (N - 2,) at which of N positions but first and last tyres could not hold the car.

    Steps across a gap are bridges, not courses; of white noise as the positions' own third
    differences have it five deviations are allowed for.
    """
    step_s = np.diff(stamp_ns) * 1e-9
    between_s = 0.5 * (step_s[1:] + step_s[:-1])
    accel = np.diff(np.diff(xy_m, axis=0) / step_s[:, None], axis=0) / between_s[:, None]
    # Third differences of white noise have 20 times its variance; 0.6745 is a normal's median.
    jolt = np.diff(accel, axis=0) * np.mean(between_s) ** 2
    noise_m = np.median(np.abs(jolt)) / (0.6745 * np.sqrt(20.0)) if len(jolt) else 0.0
    allowed = _TYRES_MPS2 + 5.0 * np.sqrt(6.0) * noise_m / between_s**2
    return np.asarray(np.hypot(*accel.T) > allowed)


def slips_of(stamp_ns: npt.NDArray[np.int64], xy_m: Array, *, position_std_m: float) -> Array:
    """Return (N, 2) how far each position has slipped since the first.

    An interval has slipped where its velocity lies further off what its neighbours' medians say
    than a car could go in it; two that undo each other are a single wrong fix. Of positions that
    come once a second none is found: nothing parts a slip from a bend.
    """
    step_s = np.diff(stamp_ns) * 1e-9
    velocity = np.diff(xy_m, axis=0) / step_s[:, None]
    middle = (stamp_ns[1:] + stamp_ns[:-1]) * 0.5e-9
    count = len(velocity)
    slip = np.zeros_like(xy_m)
    if count < 2 * _REACH + 1 or float(np.median(step_s)) > _DENSE_S:
        return slip
    index = np.arange(count)
    before = np.clip(index[:, None] - np.arange(1, _REACH + 1), 0, count - 1)
    after = np.clip(index[:, None] + np.arange(1, _REACH + 1), 0, count - 1)
    left, right = np.median(velocity[before], axis=1), np.median(velocity[after], axis=1)
    left_t, right_t = np.median(middle[before], axis=1), np.median(middle[after], axis=1)
    share = np.clip((middle - left_t) / np.maximum(right_t - left_t, 1e-9), 0.0, 1.0)
    expected = left + share[:, None] * (right - left)
    excess = (velocity - expected) * step_s[:, None]
    allowed = _LEAST_SLIP_M + 4.0 * position_std_m + _CAR_MPS2 * step_s * np.median(step_s)
    slipped = np.hypot(*excess.T) > allowed
    slip[1:] = np.cumsum(np.where(slipped[:, None], excess, 0.0), axis=0)
    return slip
