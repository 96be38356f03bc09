"""A future as it was driven, seen from above: the ego, everybody else, and where they met."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from foretwin.contracts.arrays import Array
from foretwin.contracts.futures import FuturesResult, Job
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.geometry.rectangles import Rectangles
from foretwin.sim_worker.futures.case_picture import (
    IMPACT,
    OTHERS,
    PLANNED,
    draw_box,
    draw_lanes,
    framed,
)
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m
from foretwin.world_gen.export.picture_ground import draw_ground
from foretwin.world_gen.export.picture_marks import scale_bar
from foretwin.world_gen.export.picture_style import view_around

_ASPECT = 0.96 * 9.0 / 8.3


def write_future_picture(
    path: Path, job: Job, result: FuturesResult, place: int, world: World,
    vehicle: VehicleParameters,
) -> None:  # fmt: skip
    """Write the future at a place of the result as PNG, with the map's attribution.

    Hollow boxes are the starts, full ones the collision, or the end.
    """
    states = result.trajectory.states[place].astype(np.float64)
    users = result.road_users.poses[place].astype(np.float64)
    outcome = result.outcome
    end = len(states) - 1
    if outcome.collided[place]:
        end = min(
            int(np.searchsorted(result.trajectory.time_s, outcome.collision_time_s[place])), end
        )
    yaw = states[:, 2]
    ahead = box_centre_from_base_m(vehicle) * np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
    ego = np.column_stack([states[:, :2] + ahead, yaw])
    figure = Figure(figsize=(9.0, 10.0), dpi=110, facecolor="white")
    axes = figure.add_axes((0.02, 0.05, 0.96, 0.83))
    view = view_around(*framed(ego[:, :2], _ASPECT), _ASPECT, close=False)
    draw_ground(axes, world, view)
    draw_lanes(axes, world, view)
    size = (vehicle.length_m.value, vehicle.width_m.value)
    tracks = [(ego, size, PLANNED)]
    tracks += [
        (users[:, r], tuple(result.road_users.size_m[place, r].tolist()), OTHERS)
        for r in range(users.shape[1])
    ]
    for track, (length_m, width_m), colour in tracks:
        axes.plot(*track[:, :2].T, color=colour, linewidth=1.4, zorder=12.0)
        for instant, face in ((0, "none"), (end, colour)):
            box = _box_at(track, instant, length_m, width_m)
            draw_box(axes, box, facecolor=face, edgecolor=colour, linewidth=0.9, zorder=13.0)
    for accident in result.accidents:
        if accident.future == place:
            axes.plot(*accident.point_m, marker="*", markersize=11.0, color=IMPACT, zorder=14.0)
    scale_bar(axes, view)
    future = next(f for f in job.futures if f.index == result.future_indices[place])
    figure.text(0.02, 0.95, f"{future.name}, by {future.planner}", fontsize=12, weight="bold")
    told = "no collision"
    if outcome.collided[place]:
        told = f"collision after {outcome.collision_time_s[place]:.1f} s"
    figure.text(0.02, 0.915, f"{told}; {outcome.progress_m[place]:.0f} m along the path")
    figure.text(0.98, 0.012, world.attribution, fontsize=9, ha="right", weight="bold")
    path.parent.mkdir(parents=True, exist_ok=True)
    metadata = {"Copyright": world.attribution, "Software": "foretwin"}
    FigureCanvasAgg(figure).print_figure(str(path), format="png", metadata=metadata)


def _box_at(track: Array, instant: int, length_m: float, width_m: float) -> Rectangles:
    at = track[instant : instant + 1]
    return Rectangles(at[:, :2], at[:, 2], length_m, width_m)
