"""A future as it was driven, seen from above: the ego, everybody else, and where they met."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from foretwin.contracts.futures import FuturesResult, Job
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.geometry.rectangles import Rectangles
from foretwin.sim_worker.batch.collision_detection import ego_rectangles
from foretwin.sim_worker.futures.case_picture import (
    IMPACT,
    OTHERS,
    PLANNED,
    draw_box,
    draw_lanes,
    framed,
    upright_figure,
    write_upright,
)
from foretwin.sim_worker.futures.case_picture_runs import box_at
from foretwin.world_gen.export.picture_ground import draw_ground
from foretwin.world_gen.export.picture_marks import scale_bar
from foretwin.world_gen.export.picture_style import view_around

_ASPECT = 0.96 * 9.0 / 8.3


def write_future_picture(
    path: Path,
    job: Job,
    result: FuturesResult,
    place: int,
    world: World,
    vehicle: VehicleParameters,
) -> None:
    """Write the future at a place of the result as PNG, with the map's attribution.

    Hollow boxes are the starts, full ones the collision, or the end.
    """
    states, time = result.trajectory.states[place].astype(np.float64), result.trajectory.time_s
    outcome, users = result.outcome, result.road_users
    end, words = len(states) - 1, "no collision"
    if outcome.collided[place]:
        hit_s = outcome.collision_time_s[place]
        end, words = min(int(np.searchsorted(time, hit_s)), end), f"collision after {hit_s:.1f} s"
    ego, poses = ego_rectangles(vehicle, states), users.poses[place].astype(np.float64)
    figure, axes = upright_figure(0.05, 0.83)
    view = view_around(*framed(ego.centre_m, _ASPECT), _ASPECT, close=False)
    draw_ground(axes, world, view)
    draw_lanes(axes, world, view)
    others = [
        Rectangles(poses[:, r, :2], poses[:, r, 2], *size)
        for r, size in enumerate(users.size_m[place].tolist())
    ]
    for track, colour in [(ego, PLANNED), *((other, OTHERS) for other in others)]:
        axes.plot(*track.centre_m.T, color=colour, linewidth=1.4, zorder=12.0)
        for instant, face in ((0, "none"), (end, colour)):
            box = box_at(track, instant)
            draw_box(axes, box, facecolor=face, edgecolor=colour, linewidth=0.9, zorder=13.0)
    for accident in result.accidents:
        if accident.future == place:
            axes.plot(*accident.point_m, marker="*", markersize=11.0, color=IMPACT, zorder=14.0)
    scale_bar(axes, view)
    future = next(f for f in job.futures if f.index == result.future_indices[place])
    figure.text(0.02, 0.95, f"{future.name}, by {future.planner}", fontsize=12, weight="bold")
    figure.text(0.02, 0.915, f"{words}; {outcome.progress_m[place]:.0f} m along the path")
    write_upright(figure, path, world)
