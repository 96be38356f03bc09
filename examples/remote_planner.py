"""A driving stack in a process of its own, as planner under test: copy it and put yours in.

    foretwin drive --planner remote
    python examples/remote_planner.py     # in a second terminal, same folder

It follows the path at the target speed, brakes for red lights and for who is ahead.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from foretwin import UserError
from foretwin.bus import (
    Bus,
    BusSetup,
    BusUnreachable,
    Mailbox,
    PlannedMotions,
    PlannerScene,
    Received,
    ZenohBus,
    newest_running,
)

Array = npt.NDArray[np.float64]
TIME_S = np.linspace(0.0, 3.0, 16)
ACCEL_MPS2, DECEL_MPS2, LATERAL_MPS2 = 1.5, 2.5, 2.0
JOIN_S = 30.0


class PathProfile(NamedTuple):
    """Of the path's points, 1 m apart: arc length, heading, and the speed that bends allow."""

    arc_m: Array
    heading_rad: Array
    bends_mps: Array


def plan(scene: PlannerScene) -> PlannedMotions:
    """Return where each car of a scene should be over the next three seconds."""
    steps = np.hypot(*np.diff(scene.path_xy_m, axis=0).T)
    path_arc = np.concatenate([[0.0], np.cumsum(steps)])
    heading = np.unwrap(np.arctan2(*np.gradient(scene.path_xy_m, axis=0).T[::-1]))
    bend = np.abs(np.gradient(heading, path_arc)) + 1e-6
    ahead = np.lib.stride_tricks.sliding_window_view(np.pad(bend, (0, 14), mode="edge"), 15)
    road = PathProfile(path_arc, heading, np.sqrt(LATERAL_MPS2 / ahead.max(axis=1)))
    rows = range(len(scene.futures))
    xy, yaw, speed = zip(*(_drive(scene, row, road) for row in rows), strict=True)
    return PlannedMotions(
        job=scene.job,
        question=scene.question,
        futures=scene.futures,
        time_s=TIME_S,
        xy_m=np.stack(xy),
        yaw_rad=np.stack(yaw),
        speed_mps=np.stack(speed),
    )


def _drive(scene: PlannerScene, row: int, road: PathProfile) -> tuple[Array, Array, Array]:
    """Return positions (N, 2), yaws (N,) and speeds (N,) of one car."""
    path_arc, heading, bends_mps = road
    arc, present = float(scene.arc_m[row]), max(float(scene.states[row, 3]), 0.0)
    front = scene.length_m - scene.rear_overhang_m
    stop = min(scene.stop_arc_m[row] - 1.0, _rear_of_who_is_ahead(scene, row, path_arc) - 3.0)
    arcs, speeds = [arc], [present]
    for step_s in np.diff(TIME_S):
        room = max(stop - front - arcs[-1], 0.0)
        curve = bends_mps[min(max(int(arcs[-1]), 0), len(bends_mps) - 1)]
        wanted = min(scene.target_speed_mps[row], curve, math.sqrt(2.0 * DECEL_MPS2 * room))
        change = wanted - speeds[-1]
        change = min(max(change, -2.0 * DECEL_MPS2 * step_s), ACCEL_MPS2 * step_s)
        speeds.append(max(speeds[-1] + change, 0.0))
        arcs.append(arcs[-1] + 0.5 * (speeds[-2] + speeds[-1]) * step_s)
    xy = np.column_stack([np.interp(arcs, path_arc, scene.path_xy_m[:, k]) for k in (0, 1)])
    return xy, np.interp(arcs, path_arc, heading), np.array(speeds)


def _rear_of_who_is_ahead(scene: PlannerScene, row: int, path_arc: Array) -> float:
    """Return the arc length where the nearest other in the lane ahead begins, or infinity."""
    nearest = np.inf
    for x, y, _, _, length, width, _ in scene.road_users[row]:
        away = np.hypot(scene.path_xy_m[:, 0] - x, scene.path_xy_m[:, 1] - y)
        if np.isnan(x) or away.min() > 0.5 * (scene.width_m + width) + 0.5:
            continue
        arc = float(path_arc[away.argmin()])
        if arc > scene.arc_m[row]:
            nearest = min(nearest, arc - 0.5 * length)
    return nearest


def serve(bus: Bus) -> None:
    """Answer every scene of every run on the bus, for ever."""
    scenes = Mailbox(8)
    bus.subscribe("planner_scene", scenes, run="*", process="*")
    print("ready", flush=True)
    while True:
        item = scenes.take(1.0)
        if isinstance(item, Received):
            scene = item.message()
            ids = {"run": scene.run_id, "process": scene.worker_id}
            bus.publish("planned_motions", plan(scene), **ids)


def main() -> int:
    """Join the bus, waiting for a run to begin, and serve until Ctrl-C."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("runs"), help="folder of the runs")
    parser.add_argument("--endpoint", help="where a run listens that asks nobody who it is")
    given = parser.parse_args()
    end = time.monotonic() + JOIN_S
    while True:
        try:
            if given.endpoint is None:
                setup = newest_running(given.out).bus("planner")
            else:
                setup = BusSetup(endpoint=given.endpoint)
            with ZenohBus(setup) as bus:
                serve(bus)
        except (BusUnreachable, UserError) as error:
            if time.monotonic() > end:
                print(error, file=sys.stderr)
                return 2
            time.sleep(0.2)
        except KeyboardInterrupt:
            return 0


if __name__ == "__main__":
    sys.exit(main())
