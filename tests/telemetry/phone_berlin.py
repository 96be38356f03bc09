"""A real drive through Berlin with a telephone's positions, with and without OpenStreetMap.

    python -m tests.telemetry.phone_berlin DATA [SEEDS]

The recorded positions (NovAtel SPAN) are the truth; the telephone's are these with errors of 3 m on
each axis, alike over 30 s, once a second. The drive recorded no wheels and no gyro: they are made
from its smoothed course, with noise, a wheel 1 % too large and a bias of 0.002 rad/s.
"""

from __future__ import annotations

import functools
import math
import sys
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.drive import GnssFix, ImuSample, SpeedSample, VehicleInfo
from foretwin.contracts.frames import GeoPoint, geo_from_local, local_from_geo, local_from_geo_yaw
from foretwin.orchestrator.routing.route_ahead import WayAhead
from foretwin.telemetry.estimator.motion_track import MotionTrack
from foretwin.telemetry.logs.opening import open_log
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from foretwin.world_gen.roads.road_graph import RoadGraph
from tests.telemetry.phone_figures import Errors
from tests.telemetry.smoothing import SmoothedTrack, smooth_positions
from tests.telemetry.town_map import MapSeer

ON_MAP_S = 262.0
"""So long the drive stays within the map's bounds."""
STD_M, CORRELATION_S = 3.0, 30.0
PERIOD_NS = 40_000_000
GYRO_BIAS_RADPS, WHEEL_SCALE = 0.002, 1.01


class Real(NamedTuple):
    """The drive's smoothed motion in the frame of the map's graph."""

    info: VehicleInfo
    track: SmoothedTrack
    graph: RoadGraph


@functools.cache
def berlin(data: Path) -> Real:
    graph = build_road_graph(read_map(data / "osm-berlin-mitte" / "berlin-mitte.osm"))
    log = open_log(data / "drive-berlin-gendarmenmarkt" / "Berlin_Gendarmenmarkt_GT.txt")
    fixes = [m for _, m in log.samples() if isinstance(m, GnssFix)]
    stamps = np.array([fix.stamp_ns for fix in fixes], dtype=np.int64)
    kept = stamps - stamps[0] <= ON_MAP_S * 1e9
    lat, lon = (
        np.array([getattr(f.position, name) for f in fixes]) for name in ("lat_deg", "lon_deg")
    )
    xy = local_from_geo(graph.frame, lat[kept], lon[kept])
    info = msgspec.structs.replace(log.info, sends=("gnss", "imu", "speed"))
    return Real(info, _turning_on_the_way(smooth_positions(stamps[kept], xy)), graph)


def _turning_on_the_way(track: SmoothedTrack) -> SmoothedTrack:
    """Return the track with headings where it is slow that follow the way: none jumps at a stop.

    A course of positions is none below walking speed; a gyro's rates must add up to the headings.
    """
    base = (track.stamp_ns - track.stamp_ns[0]) * 1e-9
    way = np.concatenate([[0.0], np.cumsum(track.speed_mps[1:] * np.diff(base))])
    fast = track.speed_mps > 1.5
    yaw = np.interp(way, way[fast], np.unwrap(track.yaw_rad[fast]))
    return track._replace(yaw_rad=yaw)


def phone_samples(real: Real, *, seed: int, wheels: bool) -> list[tuple[str, Any]]:
    """Return what a telephone, and with `wheels` the car's own sensors, would have sent."""
    random = np.random.default_rng(seed)
    track, fading = real.track, math.exp(-1.0 / CORRELATION_S)
    error = random.normal(0.0, STD_M, 2)
    first_ns = int(track.stamp_ns[0])
    times = np.arange(first_ns, int(track.stamp_ns[-1]), PERIOD_NS, dtype=np.int64)
    base = (track.stamp_ns - first_ns) * 1e-9
    speed, yaw, accel, x, y = (
        np.interp((times - first_ns) * 1e-9, base, column)
        for column in (track.speed_mps, track.yaw_rad, track.accel_mps2, *track.xy_m.T)
    )
    rate = np.gradient(yaw, PERIOD_NS * 1e-9)
    samples: list[tuple[str, Any]] = []
    for row, stamp in enumerate(times.tolist()):
        if wheels:
            stands = speed[row] < 0.1
            turning = 0.0 if stands else float(rate[row])
            turning += GYRO_BIAS_RADPS + float(random.normal(0.0, 0.002))
            force = float(accel[row] + random.normal(0.0, 0.05))
            samples.append(
                (
                    "imu",
                    ImuSample(
                        stamp_ns=stamp,
                        accel_mps2=(force, 0.0, 9.81),
                        rate_radps=(0.0, 0.0, turning),
                    ),
                )
            )
            said = 0.0 if stands else float(WHEEL_SCALE * speed[row] + random.normal(0.0, 0.02))
            samples.append(("speed", SpeedSample(stamp_ns=stamp, speed_mps=said)))
        if (stamp - first_ns) % 1_000_000_000 == 0:
            lat, lon = geo_from_local(real.graph.frame, np.array([x[row], y[row]]) + error)
            place = GeoPoint(float(lat), float(lon))
            samples.append(("gnss", GnssFix(stamp_ns=stamp, position=place, std_m=STD_M)))
            step = random.normal(0.0, STD_M * math.sqrt(1.0 - fading * fading), 2)
            error = fading * error + step
    return samples


def estimated(real: Real, *, seed: int, wheels: bool, roads: MapSeer | None) -> Errors:
    """Return the errors ten times a second; headings are compared with the course, while moving."""
    motion, track = MotionTrack(real.info), real.track
    base = (track.stamp_ns - track.stamp_ns[0]) * 1e-9
    rows, due_ns = [], 0
    for channel, message in phone_samples(real, seed=seed, wheels=wheels):
        motion.take(channel, message)
        if not motion.started or message.stamp_ns < due_ns:
            continue
        due_ns = message.stamp_ns + 100_000_000
        state = motion.state(message.stamp_ns)
        time_s = (message.stamp_ns - int(track.stamp_ns[0])) * 1e-9
        place = state.position
        xy = local_from_geo(real.graph.frame, place.lat_deg, place.lon_deg)
        yaw = local_from_geo_yaw(real.graph.frame, state.yaw_rad, place.lat_deg, place.lon_deg)
        truth = [
            np.interp(time_s, base, column)
            for column in (*track.xy_m.T, track.yaw_rad, track.speed_mps)
        ]
        moves = truth[3] > 3.0
        off = abs(math.remainder(float(yaw) - truth[2], math.tau)) if moves else math.nan
        away = math.hypot(xy[0] - truth[0], xy[1] - truth[1])
        rows.append((time_s, away, off, state.position_std_m, state.yaw_std_rad))
        line = None if roads is None else roads.line(state)
        if line is not None:
            motion.take("map", line)
    return Errors(*np.array(rows, dtype=np.float64).T)


def with_map(real: Real) -> MapSeer:
    return MapSeer(WayAhead(real.graph, (), ()))


def text(found: list[Errors], *, from_s: float = 60.0) -> str:
    late = [np.array(one)[:, one.time_s >= from_s] for one in found]
    errors = Errors(*np.concatenate(late, axis=1))
    position, yaw = errors.position_m, np.degrees(errors.yaw_rad)
    said = 2.448 * errors.position_std_m
    return (
        f"position p50 {np.median(position):4.2f} p95 {np.percentile(position, 95):4.2f} m, says "
        f"{said.mean():4.2f} m (within: {100 * np.mean(position < said):3.0f} %); "
        f"heading p95 {np.nanpercentile(yaw, 95):4.2f} deg"
    )


def main(arguments: list[str]) -> int:
    """Print the errors from a minute on, with wheels and gyro and with positions alone."""
    real = berlin(Path(arguments[0]))
    seeds = range(int(arguments[1]) if len(arguments) > 1 else 10)
    for wheels in (True, False):
        print("wheels and gyro:" if wheels else "positions alone:")
        for mapped in (False, True):
            found = [
                estimated(
                    real, seed=100 + k, wheels=wheels, roads=with_map(real) if mapped else None
                )
                for k in seeds
            ]
            print(f"  {'with' if mapped else 'without'} map: {text(found)}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
