"""The path ahead beside the lanes of its World, and nominal futures beside what the car then did.

    python -m tests.orchestrator.routing.path_against_lanes DATA [PICTURES]

drives every recorded drive of DATA that has a map, once with its route predicted and once with it
from the log, through mission, Worlds and nominal futures as a drive in lock step does (the run's
table `comparisons` holds the same numbers), in this process and without other futures: about a
minute of CPU each. It prints how far the paths ahead lie from the lanes and connections of the
World in force, and by junction the mean errors of the nominal futures. In PICTURES it draws the ten
rounds whose paths lie farthest off.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from scipy.spatial import cKDTree

from foretwin.contracts.arrays import Array
from foretwin.contracts.futures import PathAhead
from foretwin.contracts.simulation import HORIZONS_S, Comparison
from foretwin.contracts.world import World
from foretwin.geometry.polyline import arc_lengths
from foretwin.orchestrator.config import DriveConfig
from foretwin.orchestrator.routing.rounding import TIGHT_M, TURN_ROOM_M
from foretwin.world_gen.export.picture_ground import draw_ground
from foretwin.world_gen.export.picture_style import view_around
from foretwin.world_gen.export.picture_traffic import draw_traffic
from foretwin.world_gen.extent import extent_of
from tests.orchestrator.in_process_drive import LockStep, Round

DRIVES = (
    (
        "Berlin",
        "osm-berlin-mitte/berlin-mitte.osm",
        "drive-berlin-gendarmenmarkt/Berlin_Gendarmenmarkt_GT.txt",
    ),
)
"""Of the recorded drives with times, those that a map of the data folder covers."""
ROUTES = (None, "from-log")
PICTURES = 10
FAR_M = 0.5
BESIDE_M = 3.5
SAME_WAY = math.cos(math.radians(45.0))
"""A lane farther off, or that heads more aside, is not the one that a path means to follow."""
_STEP_M = 0.25


class LanesOfWorld:
    """The lanes and connections of a World that cars drive, as points close together."""

    def __init__(self, world: World) -> None:
        lanes = [lane for lane in world.lanes if lane.kind in ("driving", "bus")]
        driven = {lane.id for lane in lanes}
        turns = [c for c in world.connections if {c.from_lane_id, c.to_lane_id} <= driven]
        left = {lane.id for lane in lanes if lane.successor_ids} | {c.id for c in turns}
        entered = {name for lane in lanes for name in lane.successor_ids}
        entered |= {c.to_lane_id for c in turns}
        dense = [(one.id, _dense(one.centerline)) for one in (*lanes, *turns)]
        ends = []
        for name, line in dense:
            dead = np.zeros(len(line), dtype=bool)
            dead[0], dead[-1] = name not in entered, name not in left
            ends.append(dead)
        self._world = world
        self._dead = np.concatenate(ends)
        self._tree = cKDTree(np.concatenate([line for _, line in dense]))
        self._yaw = np.concatenate([_yaw(line) for _, line in dense])
        tight = [_dense(c.centerline) for c in turns if _radius_m(c.centerline) < TIGHT_M]
        self._tight = cKDTree(np.concatenate([*tight, np.full((1, 2), 1e9)]))

    def beside(self, path: PathAhead) -> Beside:
        """Say of each point of a path how far from a lane that heads its way it is, and where."""
        near = self._tree.query_ball_point(path.xy_m, BESIDE_M)
        away = np.full(len(path.xy_m), np.inf)
        for number, (xy, yaw) in enumerate(zip(path.xy_m, _yaw(path.xy_m), strict=True)):
            found = np.array(near[number], dtype=int)
            found = found[np.cos(self._yaw[found] - yaw) > SAME_WAY]
            if len(found):
                gaps = np.hypot(*(self._tree.data[found] - xy).T)
                # What lies before or behind the end of a lane does not lie along it.
                if not self._dead[found[gaps.argmin()]]:
                    away[number] = gaps.min()
        turning = self._tight.query(path.xy_m)[0] < TURN_ROOM_M
        return Beside(away, extent_of(self._world).holds(path.xy_m), turning)


class Beside(NamedTuple):
    """Of each point (N,) of a path: metres from the nearest lane (infinite: none along it), whether
    the World covers it, and whether a connection of a small radius is near."""

    away_m: Array
    covered: np.ndarray
    turning: np.ndarray


def _yaw(line: Array) -> Array:
    tangent = np.gradient(line, axis=0)
    return np.asarray(np.arctan2(tangent[:, 1], tangent[:, 0]))


def _radius_m(line: Array) -> float:
    """The smallest radius of a line, over 2 m."""
    yaw = np.unwrap(_yaw(_dense(line)))
    over = round(2.0 / _STEP_M)
    turned = np.abs(yaw[over:] - yaw[:-over]).max() if len(yaw) > over else 0.0
    return float(over * _STEP_M / max(turned, 1e-3))


def _dense(line: Array) -> Array:
    arc = arc_lengths(line)
    at = np.linspace(0.0, arc[-1], max(2, round(arc[-1] / _STEP_M)))
    return np.stack([np.interp(at, arc, line[:, k]) for k in (0, 1)], axis=-1)


class Shares(NamedTuple):
    """Distances (N,) from lanes of the points along them: all, away from tight turns, near them."""

    rounds_off_lanes: int
    points: int
    along: Array
    elsewhere: Array
    turning: Array


def shares(rounds: list[Round]) -> Shares:
    """Lay the paths of rounds beside the lanes of their Worlds."""
    lanes = {one.world.id: LanesOfWorld(one.world) for one in rounds}
    beside = [lanes[one.world.id].beside(one.intent.path) for one in rounds]
    away, covered, turning = (np.concatenate(each) for each in zip(*beside, strict=True))
    along = covered & np.isfinite(away)
    return Shares(
        sum(one.intent.off_lanes_m > 0.0 for one in rounds), int(covered.sum()),
        away[along], away[along & ~turning], away[along & turning],
    )  # fmt: skip


def print_paths(rounds: list[Round]) -> None:
    found = shares(rounds)
    share = 100.0 * len(found.along) / found.points
    print(f"  {len(rounds)} rounds, {found.rounds_off_lanes} of them in part off lanes")
    print(f"  {found.points} points of their paths within the World, {share:.1f} % along a lane")
    for what, far in (("of those", found.along), ("elsewhere", found.elsewhere),
                      (f"near turns tighter than {TIGHT_M:g} m", found.turning)):  # fmt: skip
        share = 100.0 * (far > FAR_M).mean()
        text = f"    {what}: {len(far)}, farther than {FAR_M} m {share:.2f} %, "
        print(text + f"p99 {np.percentile(far, 99):.2f} m, worst {far.max():.2f} m")


def config_of(data: Path, map_file: str, log_file: str, route: str | None) -> DriveConfig:
    return DriveConfig(
        map=str(data / map_file), log=str(data / log_file), route=route, speed=None, futures=1,
        scenarios=(), view="none",
    )  # fmt: skip


def draw(rounds: list[Round], folder: Path, name: str) -> None:
    """Draw the rounds whose paths lie farthest from the lanes along them, one for each place."""
    lanes = {one.world.id: LanesOfWorld(one.world) for one in rounds}
    worst: list[tuple[float, Array, Round]] = []
    for one in rounds:
        found = lanes[one.world.id].beside(one.intent.path)
        away = np.where(found.covered & np.isfinite(found.away_m), found.away_m, 0.0)
        worst.append((float(away.max()), one.intent.path.xy_m[away.argmax()], one))
    worst.sort(key=lambda each: -each[0])
    drawn: list[tuple[str, Array]] = []
    for away_m, at, one in worst:
        if any(w == one.world.id and np.hypot(*(at - xy)) < 10.0 for w, xy in drawn):
            continue
        drawn.append((one.world.id, at))
        figure = Figure(figsize=(9.0, 9.0), layout="constrained")
        axes = figure.add_subplot()
        view = view_around(at, 25.0, 1.0, close=True)
        draw_ground(axes, one.world, view)
        draw_traffic(axes, one.world, view)
        axes.plot(*one.intent.path.xy_m.T, color="crimson", marker=".", linewidth=2.0, zorder=99)
        place = one.world.intersection.name or one.world.intersection.id
        axes.set_title(f"{name}: {away_m:.2f} m at {place}")
        figure.text(0.99, 0.01, one.world.attribution, ha="right")
        file = folder / f"{name}-{len(drawn):02d}.png"
        FigureCanvasAgg(figure).print_figure(str(file), dpi=80)
        if len(drawn) == PICTURES:
            return


def print_errors(comparisons: list[Comparison]) -> None:
    """Print the mean errors of the nominal futures, by junction and of all rounds."""
    names = [*dict.fromkeys(c.intersection_id for c in comparisons), ""]
    print("  " + "junction".ljust(12) + "".join(f"{h:g} s: ADE, FDE".rjust(20) for h in HORIZONS_S))
    for name in names:
        row = "  " + (name or "all").ljust(12)
        for horizon in HORIZONS_S:
            mine = [c.nominal for c in comparisons
                    if c.horizon_s == horizon and name in ("", c.intersection_id)]  # fmt: skip
            ade, fde = (np.mean([getattr(one, key) for one in mine]) for key in ("ade_m", "fde_m"))
            row += f"{ade:.4f} {fde:8.4f}".rjust(20)
        print(row)


def main(data: Path, pictures: Path | None) -> None:
    for name, map_file, log_file in DRIVES:
        for route in ROUTES:
            drive = LockStep(config_of(data, map_file, log_file, route)).run()
            print(f"{name}, route {route or 'predicted'}")
            print_paths(drive.rounds)
            print_errors(drive.comparisons)
            if pictures is not None:
                pictures.mkdir(parents=True, exist_ok=True)
                draw(drive.rounds, pictures, f"{name}-{route or 'predicted'}")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)
