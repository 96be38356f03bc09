"""What ten minutes with a telephone's positions give, beside what any filter could make of them.

    python -m tests.telemetry.phone_figures [SEEDS [map]]

prints a table; each of the SEEDS (6) takes about a minute of CPU. Errors of positions are alike
over 30 s and come once a second; 3 m may be meant on each axis or in the plane. `map` prints alone
what they give with a map of the way, whose streets lie beside where they really are.
"""

from __future__ import annotations

import functools
import math
import sys
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import geo_from_local, wrap_angle
from foretwin.telemetry.estimator.motion_noise import GNSS_CORRELATION_S, SPEED_SCALE_STD
from foretwin.telemetry.estimator.motion_track import MotionTrack
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.path import DrivenPath
from foretwin.telemetry.standin.source import START_STAMP_NS
from tests.telemetry.city_drive import antenna_xy, phone_positions, xy_of
from tests.telemetry.known_standin import KnownStandin
from tests.telemetry.standin_drive import FRAME, Drive
from tests.telemetry.town_map import Leg, MapSeer, seer

DURATION_S = 600.0
STD_M = {"3 m on each axis": 3.0, "3 m in the plane (2.1 m on each axis)": 3.0 / math.sqrt(2.0)}
WINDOWS_S = {
    "30 s": (25, 35),
    "1 min": (50, 70),
    "2 min": (110, 130),
    "5 min": (280, 320),
    "10 min": (560, 600),
}
GYRO_BIAS_STD_RADPS = 2e-4
"""What two seconds of standing leave unknown of a gyro with 0.002 rad/s of white noise."""
MAP_ERRORS_M = (1.0, 2.0)
"""How far beside its place a map has each street: one standard deviation."""
_MEANDER_MPS = 9.5


class Errors(NamedTuple):
    """At N instants: what the estimate is off, and what it says of that itself."""

    time_s: Array
    position_m: Array
    yaw_rad: Array
    position_std_m: Array
    yaw_std_rad: Array


class Streets(NamedTuple):
    """A way (N, 2) through a town, the speed wished along it (N,), and its legs."""

    xy_m: Array
    wish_mps: Array
    legs: list[Leg]


def town_streets(seed: int, duration_s: float = DURATION_S) -> Streets:
    """Return streets, turns and stops drawn at random."""
    random = np.random.default_rng(seed)
    xy, wish, legs = [np.zeros(2)], [12.0], []
    yaw = 0.0
    while len(xy) < duration_s * _MEANDER_MPS:
        turn = float(random.choice([-1.0, 1.0]) * random.choice([0.3, math.pi / 4, math.pi / 2]))
        radius = random.uniform(10.0, 35.0) if abs(turn) > 1.0 else random.uniform(40.0, 80.0)
        straight_m, stops = random.uniform(60.0, 220.0), random.random() < 0.3
        legs.append(Leg(straight_m, turn, radius))
        for length, curvature in (
            (straight_m, 0.0),
            (abs(turn) * radius, turn / abs(turn) / radius),
        ):
            step = length / round(length)
            for _ in range(round(length)):
                course = yaw + 0.5 * step * curvature
                xy.append(xy[-1] + step * np.array([math.cos(course), math.sin(course)]))
                yaw += step * curvature
                wish.append(12.0)
            if stops and curvature == 0.0:
                wish[-3] = 0.0
    return Streets(np.array(xy), np.array(wish), legs)


@functools.cache
def town_drive(seed: int, duration_s: float = DURATION_S) -> Drive:
    """Return a drive through `town_streets`."""
    streets = town_streets(seed, duration_s)
    geo = geo_from_local(FRAME, streets.xy_m)
    parameters = read_parameters()
    path = DrivenPath(geo[:, 0], geo[:, 1], streets.wish_mps, driver=parameters.driver)
    source = KnownStandin(path, parameters, vehicle_id="standin", seed=seed)
    samples = source.advance(START_STAMP_NS + round(duration_s * 1e9))
    heard = ("gnss", "imu", "speed", "steering")
    return Drive(source, [sample for sample in samples if sample[0] in heard])


def estimated(drive: Drive, *, seed: int, std_m: float, roads: MapSeer | None = None) -> Errors:
    """Return the errors ten times a second, from samples in their order; `roads` knows a map."""
    track = MotionTrack(drive.source.info, steering=drive.source.steering)
    rows, due_ns = [], START_STAMP_NS
    for channel, message in phone_positions(drive, seed=seed, std_m=std_m):
        track.take(channel, message)
        if not track.started or message.stamp_ns < due_ns:
            continue
        due_ns = message.stamp_ns + 100_000_000
        state, truth = track.state(message.stamp_ns), drive.source.truth(message.stamp_ns)
        line = None if roads is None else roads.line(state)
        if line is not None:
            track.take("map", line)
        rows.append(
            (
                (message.stamp_ns - START_STAMP_NS) * 1e-9,
                float(np.hypot(*(xy_of(state) - xy_of(truth)))),
                abs(float(wrap_angle(state.yaw_rad - truth.yaw_rad))),
                state.position_std_m,
                state.yaw_std_rad,
            )
        )
    return Errors(*np.array(rows, dtype=np.float64).T)


def bound(drive: Drive, *, std_m: float, perfect: bool) -> Errors:
    """Return the least spread that positions leave (Cramér-Rao), second by second.

    Unknown are place and direction; unless wheels and gyro are `perfect`, also the wheels' radius
    and what the first stop leaves unknown of the gyro's bias. Later stops, which tell more of it,
    are not counted: with real wheels and gyro a filter may do better.
    """
    seconds = int(drive.samples[-1][1].stamp_ns - START_STAMP_NS) // 1_000_000_000
    stamps = [START_STAMP_NS + 1_000_000_000 * k for k in range(seconds + 1)]
    antenna = np.array([antenna_xy(drive, stamp) for stamp in stamps])
    steps = np.diff(antenna, axis=0, prepend=antenna[:1])
    # How the place now depends on the bias: all steps so far, turned by it for so long.
    turned = np.cumsum(np.arange(seconds + 1)[:, None] * steps[:, ::-1] * [-1.0, 1.0], axis=0)
    fading = math.exp(-1.0 / GNSS_CORRELATION_S)
    known = 1e-12 if perfect else 1.0
    prior = known * np.array([SPEED_SCALE_STD, GYRO_BIAS_STD_RADPS])
    information = np.diag([0.0, 0.0, 0.0, *(1.0 / prior**2)])
    before: Array | None = None
    rows = []
    for second, (x, y) in enumerate(antenna):
        (scale_x, scale_y), (bias_x, bias_y) = antenna[second] - antenna[0], turned[second]
        design = np.array([[1.0, 0.0, -y, scale_x, bias_x], [0.0, 1.0, x, scale_y, bias_y]])
        # Whitened by the error's own memory: each fix brings what the one before did not say.
        new = design if before is None else design - fading * before
        share = 1.0 if before is None else 1.0 - fading * fading
        information = information + new.T @ new / (std_m * std_m * share)
        before = design
        if second >= 10:
            spread = np.linalg.inv(information)
            place = design @ spread @ design.T
            heading = np.array([0.0, 0.0, 1.0, 0.0, float(second)])
            yaw = float(heading @ spread @ heading)
            rows.append((second, 0.0, 0.0, math.sqrt(np.trace(place) / 2.0), math.sqrt(yaw)))
    return Errors(*np.array(rows, dtype=np.float64).T)


def _between(errors: list[Errors], window_s: tuple[int, int]) -> Errors:
    cut = [
        np.array(one)[:, (one.time_s >= window_s[0]) & (one.time_s < window_s[1])] for one in errors
    ]
    return Errors(*np.concatenate(cut, axis=1))


def _print_with_map(drives: list[Drive], seeds: range) -> None:
    for error_m in MAP_ERRORS_M:
        print(f"3 m on each axis, with a map whose streets are off by {error_m:.0f} m:")
        found = [mapped(drives[k % 2], 1 + k % 2, seed=k, error_m=error_m) for k in seeds]
        for label, window_s in WINDOWS_S.items():
            at = _between(found, window_s)
            within = np.mean(at.position_m < 2.448 * at.position_std_m)
            print(
                f"  after {label:6s} position p95 {np.percentile(at.position_m, 95):4.1f} m "
                f"heading p95 {np.degrees(np.percentile(at.yaw_rad, 95)):4.2f} deg; "
                f"says {2.448 * at.position_std_m.mean():4.1f} m "
                f"{1.96 * np.degrees(at.yaw_std_rad.mean()):4.2f} deg; within {within:.2f}",
                flush=True,
            )


def mapped(drive: Drive, streets: int, *, seed: int, error_m: float) -> Errors:
    """Return the errors of `town_drive(streets)` with a map, found on it without a route."""
    roads = seer(town_streets(streets).legs, seed=seed, error_m=error_m)
    return estimated(drive, seed=100 + seed, std_m=3.0, roads=roads)


def main(arguments: list[str]) -> int:
    """Print 95 % of positions and headings after so long, with and without a map, and bounds."""
    seeds = range(int(arguments[0]) if arguments else 6)
    drives = [town_drive(1), town_drive(2)]
    _print_with_map(drives, seeds)
    if arguments[1:] == ["map"]:
        return 0
    for name, std_m in STD_M.items():
        print(f"{name}, {len(seeds)} seeds on two drives:")
        found = [estimated(drives[k % 2], seed=100 + k, std_m=std_m) for k in seeds]
        real, ideal = (
            [bound(drive, std_m=std_m, perfect=kind) for drive in drives] for kind in (False, True)
        )
        for label, window_s in WINDOWS_S.items():
            at = _between(found, window_s)
            line = (
                f"  after {label:6s} position p95 {np.percentile(at.position_m, 95):4.1f} m "
                f"heading p95 {np.degrees(np.percentile(at.yaw_rad, 95)):4.2f} deg; "
                f"says {2.448 * at.position_std_m.mean():4.1f} m "
                f"{1.96 * np.degrees(at.yaw_std_rad.mean()):4.2f} deg"
            )
            for what, least in (("wheels, gyro as they are", real), ("perfect ones", ideal)):
                it = _between(least, window_s)
                line += (
                    f"; bound, {what}: {2.448 * it.position_std_m.mean():4.1f} m "
                    f"{1.96 * np.degrees(it.yaw_std_rad.mean()):4.2f} deg"
                )
            print(line, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
