"""A driving stack in a process of its own, as planner under test: copy it and put yours in.

    foretwin sweep examples/remote_planner.toml      # starts it itself

or beside a drive, in two terminals in the same folder:

    foretwin drive --planner remote
    python examples/remote_planner.py

It follows the path at the target speed, brakes for red lights and for who is ahead.
"""

from __future__ import annotations

import argparse
import math
import sys

import numpy as np
import numpy.typing as npt

from foretwin.bus import PlannedMotions, PlannerScene, serve_planner

Array = npt.NDArray[np.float64]
TIME_S = np.linspace(0.0, 3.0, 16)
ACCEL_MPS2, DECEL_MPS2, LATERAL_MPS2 = 1.5, 2.5, 2.0


def plan(scene: PlannerScene) -> PlannedMotions:
    """Return where each car of a scene should be over the next three seconds."""
    path_arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(scene.path_xy_m, axis=0).T))])
    heading = np.unwrap(np.arctan2(*np.gradient(scene.path_xy_m, axis=0).T[::-1]))
    bend = np.abs(np.gradient(heading, path_arc)) + 1e-6
    ahead = np.lib.stride_tricks.sliding_window_view(np.pad(bend, (0, 14), mode="edge"), 15)
    bends_mps = np.sqrt(LATERAL_MPS2 / ahead.max(axis=1))
    driven = [_drive(scene, row, path_arc, bends_mps) for row in range(len(scene.futures))]
    arcs, speeds = np.moveaxis(np.array(driven), 1, 0)
    xy = [np.interp(arcs, path_arc, scene.path_xy_m[:, axis]) for axis in (0, 1)]
    return PlannedMotions(
        job=scene.job,
        question=scene.question,
        futures=scene.futures,
        time_s=TIME_S,
        xy_m=np.stack(xy, axis=-1),
        yaw_rad=np.interp(arcs, path_arc, heading),
        speed_mps=speeds,
    )


def _drive(scene: PlannerScene, row: int, path_arc: Array, bends_mps: Array) -> tuple[Array, Array]:
    """Return arc lengths and speeds (N,) of one car."""
    front = scene.length_m - scene.rear_overhang_m
    stop = min(scene.stop_arc_m[row] - 1.0, _rear_of_who_is_ahead(scene, row, path_arc) - 3.0)
    arcs, speeds = [float(scene.arc_m[row])], [max(float(scene.states[row, 3]), 0.0)]
    for step_s in np.diff(TIME_S):
        room = max(stop - front - arcs[-1], 0.0)
        curve = bends_mps[min(max(int(arcs[-1]), 0), len(bends_mps) - 1)]
        wanted = min(scene.target_speed_mps[row], curve, math.sqrt(2.0 * DECEL_MPS2 * room))
        least, most = -2.0 * DECEL_MPS2 * step_s, ACCEL_MPS2 * step_s
        speeds.append(max(speeds[-1] + min(max(wanted - speeds[-1], least), most), 0.0))
        arcs.append(arcs[-1] + 0.5 * (speeds[-2] + speeds[-1]) * step_s)
    return np.array(arcs), np.array(speeds)


def _rear_of_who_is_ahead(scene: PlannerScene, row: int, path_arc: Array) -> float:
    """Return the arc length where the nearest other in the lane ahead begins, or infinity."""
    nearest = np.inf
    for x, y, _, _, length, width, _ in scene.road_users[row]:
        away = np.hypot(scene.path_xy_m[:, 0] - x, scene.path_xy_m[:, 1] - y)
        arc = 0.0 if np.isnan(x) else float(path_arc[away.argmin()])
        if arc > scene.arc_m[row] and away.min() < 0.5 * (scene.width_m + width) + 0.5:
            nearest = min(nearest, arc - 0.5 * length)
    return nearest


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", default="runs", help="folder of the runs to join")
    parser.add_argument("--endpoint", help="where a run listens that asks nobody who it is")
    sys.exit(serve_planner(plan, name="example", version="1.0", **vars(parser.parse_args())))
