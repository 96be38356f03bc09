"""Measure the paths of turns: over whole maps, and on tracks of cars at a signalised crossing.

`python -m tests.world_gen.measure_turns [NAME ...]` reads the folder named by FORETWIN_DATA and
prints one row for each map, one for all, and one for the tracks, which are measured alike:

- `turned`: connections whose heading leaves the angle from lane to lane by more than 30°; then
  those of them that leave so far the angle of lanes and of all the map's roads between them too,
  which turn where two arms of a crossing lie aside of one another; then the same of connections
  from, to or by way of a ring (R), and U-turns;
- `loops`: connections that turn by more than 270° from their lane, U-turns counted after them;
- `beside`: how many but those back into the same road lie by more than 1, 2 and 4 m outside the
  shape that their roads span, where these meet in one node: `beside_m`;
- `radius`: quartiles of the least radius of near-side turns at lights, as `least_radius_m` has it,
  of those that turn by 45 to 135°, then of those by 50 to 85° as the tracks do;
- `step`: 50 %, 90 % and 99 % of the greatest change of curvature in 0.5 m along a turn, in 1/m,
  and `rate` of its derivative by the way, in 1/m². Lines between points have no curvature: that of
  each point is its bend over the mean length of the lines beside it.

`--worst N` names the N connections that leave their angle farthest.
"""

from __future__ import annotations

import argparse
import csv
import math
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter1d

from foretwin.contracts.world import World
from foretwin.geometry.polyline import meeting, units
from foretwin.world_gen.build import build_region
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.osm.osm_map import LatLonBounds
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.data_maps import MAPS, data_folder, named
from tests.world_gen.roads_driven import RoadsDriven

TRACKS = "traffic-karlsruhe-k729"

CHORD_M = 4.0
"""A radius is that of the circle through a point of a path and those so far before and behind it:
so long a piece that tracks of tracked cars, which shake, have one."""
SHAKE_M = 1.0
"""Standard deviation along the way with which tracks are smoothed."""
STEP_M = 0.25
NEAR_SIDE_RAD = math.radians(45.0), math.radians(135.0)
TRACKED_RAD = math.radians(50.0), math.radians(85.0)
ALLOWED_RAD = math.radians(30.0)
LEAST_CROSSING_SIN, FARTHEST_CROSSING_M = math.sin(math.radians(3.0)), 30.0
BESIDE_M = 1.0, 2.0, 4.0
LOOP_RAD = math.radians(270.0)


class Turn(NamedTuple):
    """What is measured of one connection."""

    name: str
    kind: str
    turned_rad: float
    left_rad: float
    left_roads_rad: float
    beside_m: float
    radius_m: float
    near_side_at_lights_rad: float
    """How far is turned; 0 for all others."""
    step_pm: float
    rate_pm2: float


def least_radius_m(path: np.ndarray) -> float:
    """Return the least radius of circles through points (N, 2) of a path `CHORD_M` apart."""
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    if arc[-1] < 2.0 * CHORD_M:
        return math.inf
    at = np.arange(CHORD_M, arc[-1] - CHORD_M + 1e-9, STEP_M)
    a, b, c = (
        np.stack([np.interp(at + shift, arc, path[:, k]) for k in (0, 1)], axis=-1)
        for shift in (-CHORD_M, 0.0, CHORD_M)
    )
    twice = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    product = np.hypot(*(b - a).T) * np.hypot(*(c - b).T) * np.hypot(*(c - a).T)
    return float(1.0 / max(float((2.0 * twice / np.maximum(product, 1e-9)).max()), 1e-6))


def left_interval_rad(path: np.ndarray, *directions: np.ndarray) -> float:
    """Return how far a path's heading leaves the angle between directions (2,), that of entry
    first."""
    steps = np.diff(path, axis=0)
    yaws = np.arctan2(steps[:, 1], steps[:, 0])
    yaw = np.unwrap(np.concatenate([[_yaw(directions[0])], yaws]))
    turns = [math.remainder(_yaw(d) - yaw[0], math.tau) for d in directions]
    low, high = min(turns), max(turns)
    return float(max(yaw[0] + low - yaw.min(), yaw.max() - yaw[0] - high, 0.0))


def beside_m(
    path: np.ndarray, before: np.ndarray, behind: np.ndarray, roads: Sequence[np.ndarray]
) -> float:
    """Return how far a path (N, 2) lies outside what its roads span, over what its ends lie aside.

    That is the hull of the roads from lane to lane, of the path's ends, and of where the lines of
    both lanes, of directions (2,), cross ahead. NaN where its roads do not meet in one node.
    """
    if len(roads) != 2:
        return math.nan
    ends, driven = path[[0, -1]], np.concatenate(roads)
    corners = [*ends, *driven]
    into, out = units(np.array([before, behind]))
    ahead_m, past_m = meeting(ends[0], into, ends[1], out, parallel=LEAST_CROSSING_SIN)
    if 0.0 < ahead_m < FARTHEST_CROSSING_M > -past_m > 0.0:
        corners.append(ends[0] + ahead_m * into)
    aside_m = shapely.distance(shapely.points(ends), shapely.LineString(driven)).max()
    hull = shapely.MultiPoint(np.array(corners)).convex_hull
    return float(shapely.distance(shapely.points(path), hull).max() - aside_m)


def turned_rad(path: np.ndarray) -> float:
    """Return how far a path's heading comes from that of its first piece at most."""
    steps = np.diff(path, axis=0)
    yaw = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    return float(np.abs(yaw - yaw[0]).max())


def curvature_changes(path: np.ndarray) -> tuple[float, float]:
    """Return the greatest change of curvature in 0.5 m along a path (N, 2), and its rate."""
    steps = np.diff(path, axis=0)
    length = np.hypot(*steps.T)
    yaw = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    if len(yaw) < 3:
        return 0.0, 0.0
    curvature = np.diff(yaw) / ((length[1:] + length[:-1]) / 2.0)
    rate = np.abs(np.diff(curvature)) / length[1:-1]
    step = np.minimum(np.abs(np.diff(curvature)), rate * 0.5)
    return float(step.max()), float(rate.max())


def region_of(path: Path) -> tuple[World, RoadsDriven]:
    """Return all of a map as one World without its ground, and the map's roads."""
    osm = read_map(path)
    graph = build_road_graph(osm)
    index = index_map(osm, graph, find_intersections(osm, graph))
    lat, lon = np.array(list(osm.locations.values())).T
    bounds = LatLonBounds(lat.min(), lon.min(), lat.max(), lon.max())
    world = build_region(osm, graph, bounds, index=index, ground=False)
    return world, RoadsDriven(graph, world.frame)


def turns_of(world: World, roads: RoadsDriven) -> Iterator[Turn]:
    """Yield what is measured of each connection of a World."""
    lanes = {lane.id: lane for lane in world.lanes}
    near_side = world.intersection.driving_side
    for c in world.connections:
        from_lane, to_lane = lanes[c.from_lane_id], lanes[c.to_lane_id]
        start, end = from_lane.centerline, to_lane.centerline
        whole = np.concatenate([start[-2:-1], c.centerline, end[1:2]])
        before, behind = start[-1] - start[-2], end[1] - end[0]
        angle = abs(math.remainder(_yaw(behind) - _yaw(before), math.tau))
        back = c.turn == "u_turn" or angle > math.radians(160.0)
        counts = c.turn == near_side and c.signal_group_id is not None
        beside = math.nan
        if c.turn != "u_turn":
            beside = beside_m(c.centerline, before, behind, roads.lines(from_lane, to_lane))
        longer = np.concatenate([start[:-1], c.centerline, end[1:]])
        yield Turn(
            name=c.id,
            kind="u_turn" if back else "ring" if roads.by_ring(from_lane, to_lane) else "turn",
            turned_rad=turned_rad(whole),
            left_rad=left_interval_rad(c.centerline, before, behind),
            left_roads_rad=left_interval_rad(
                c.centerline, before, behind, *roads.directions(from_lane, to_lane)
            ),
            beside_m=beside,
            radius_m=least_radius_m(longer),
            near_side_at_lights_rad=angle if counts else 0.0,
            step_pm=curvature_changes(whole)[0],
            rate_pm2=curvature_changes(whole)[1],
        )


def _yaw(direction: np.ndarray) -> float:
    return math.atan2(direction[1], direction[0])


def tracked_radii_m(folder: Path) -> list[float]:
    """Return the least radius of each near-side turn of a car among the tracks."""
    tracks: dict[tuple[str, str], list[tuple[float, float]]] = defaultdict(list)
    for file in sorted(folder.glob("vehicle_tracks_*.csv")):
        with file.open(encoding="utf-8") as rows:
            for row in csv.DictReader(rows):
                if row["agent_type"] == "Car":
                    key = file.stem, row["track_id"]
                    tracks[key].append((float(row["x"]), float(row["y"])))
    radii = []
    for points in tracks.values():
        kept = [points[0]]
        for p in points[1:]:
            if math.dist(p, kept[-1]) > 0.4:  # a car that stands shakes on the spot
                kept.append(p)
        line = np.array(kept)
        arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
        if arc[-1] < 15.0:
            continue
        at = np.arange(0.0, arc[-1], STEP_M)
        even = np.stack([np.interp(at, arc, line[:, k]) for k in (0, 1)], axis=-1)
        smooth = gaussian_filter1d(even, SHAKE_M / STEP_M, axis=0, mode="nearest")
        yaw = np.unwrap([_yaw(step) for step in smooth[8::8] - smooth[:-8:8]])
        if -NEAR_SIDE_RAD[1] <= yaw[-1] - yaw[0] <= -NEAR_SIDE_RAD[0]:
            radii.append(least_radius_m(smooth))
    return radii


def row_of(turns: list[Turn]) -> str:
    """Return the figures of one map, or of several, as a row."""
    turned = [t for t in turns if t.kind != "u_turn" and t.left_rad > ALLOWED_RAD]
    off_roads = [t.kind for t in turned if t.left_roads_rad > ALLOWED_RAD]
    u_turned = [t for t in turns if t.kind == "u_turn" and t.left_rad > ALLOWED_RAD]
    radii = "  ".join(
        _quartiles([t.radius_m for t in turns if low <= t.near_side_at_lights_rad <= high])
        for low, high in (NEAR_SIDE_RAD, TRACKED_RAD)
    )
    step = np.percentile([t.step_pm for t in turns], [50, 90, 99])
    rate = np.percentile([t.rate_pm2 for t in turns], [50, 90, 99])
    looped = [t.kind for t in turns if t.turned_rad > LOOP_RAD]
    loops = f"loops {len(looped) - looped.count('u_turn')} + {looped.count('u_turn')} U"
    off = f"{off_roads.count('turn'):4d} + {off_roads.count('ring'):2d} R"
    counts = f"{len(turned):4d} {off} + {len(u_turned):3d} U  {loops}"
    aside = "/".join(str(sum(t.beside_m > m for t in turns)) for m in BESIDE_M)
    shape = f"step {_words(step)}  rate {_words(rate)}"
    return f"{len(turns):7d} turned {counts}  beside {aside}  radius {radii}  {shape}"


def _quartiles(values: list[float]) -> str:
    if not values:
        return "       -       (n=  0)"
    return f"{_words(np.percentile(values, [25, 50, 75]), 1)} (n={len(values):3d})"


def _words(values: np.ndarray, digits: int = 3) -> str:
    return "/".join(f"{value:.{digits}f}" for value in values)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(MAPS))
    parser.add_argument("--worst", type=int, default=0)
    chosen = parser.parse_args()
    data = data_folder()
    every: list[Turn] = []
    for name in named(chosen.names, MAPS):
        begin_s = time.process_time()
        turns = list(turns_of(*region_of(data / MAPS[name])))
        every += turns
        print(f"{name:14}{row_of(turns)}  ({time.process_time() - begin_s:.0f} s)", flush=True)
        worst = sorted(turns, key=lambda t: -t.left_roads_rad)
        for t in [t for t in worst if t.kind != "u_turn"][: chosen.worst]:
            turned = f"{math.degrees(t.left_roads_rad):5.0f}°"
            print(f"    {turned}  {t.radius_m:5.1f} m  {t.kind:4}  {t.name}")
    print(f"{'all':14}{row_of(every)}")
    print(f"{'tracks':14}{'':62}radius {_quartiles(tracked_radii_m(data / TRACKS))}")


if __name__ == "__main__":
    main()
