"""Plots for notebooks, by matplotlib: each draws into given axes or its own, and returns them.

Whose data the map is stands in each picture that shows one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize

from foretwin.checks import expect
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import local_from_geo
from foretwin.contracts.terminal import plain
from foretwin.contracts.world import World
from foretwin.recordings import MotionArrays, Recording
from foretwin.sim_worker.futures.case_picture import draw_lanes
from foretwin.simulation import Futures
from foretwin.world_gen.export.picture_ground import draw_ground
from foretwin.world_gen.export.picture_marks import scale_bar
from foretwin.world_gen.export.picture_style import view_around

CLEARANCE_M = Normalize(0.0, 5.0, clip=True)
"""Of the colours of futures: from touching to nobody near."""
_COLOURS = "cividis"


def plot_junction(world: World, axes: Axes | None = None, *, reach_m: float = 45.0) -> Axes:
    """Draw a World from above, `reach_m` metres around its intersection; x east, y north."""
    axes = _axes(axes)
    view = view_around(np.zeros(2), reach_m, 1.0, close=True)
    draw_ground(axes, expect("world", world, World), view)
    draw_lanes(axes, world, view)
    scale_bar(axes, view)
    place = world.intersection
    axes.set_title(plain(f"{place.name or place.id} ({place.kind})"), parse_math=False)
    axes.text(
        0.99, 0.01, plain(world.attribution), transform=axes.transAxes, ha="right", fontsize=7,
        parse_math=False,
    )  # fmt: skip
    return axes


def plot_futures(
    futures: Futures,
    world: World | None = None,
    axes: Axes | None = None,
    *,
    reach_m: float = 45.0,
) -> Axes:
    """Draw the car's ways in futures, by the least clearance of each, over the World if given."""
    expect("futures", futures, Futures)
    axes = _axes(axes) if world is None else plot_junction(world, axes, reach_m=reach_m)
    clearance = [row.get("min_clearance_m") for row in futures.rows]
    by_index = dict(zip((row["index"] for row in futures.rows), clearance, strict=True))
    values = [by_index.get(index) for index in futures.result.future_indices]
    # Of nobody there is no clearance, and nothing to be near to.
    told = np.array([CLEARANCE_M.vmax if one is None else one for one in values], float)
    lines = LineCollection(
        list(futures.states[:, :, :2]), cmap=_COLOURS, norm=CLEARANCE_M, linewidths=1.2, zorder=60
    )
    lines.set_array(told)
    axes.add_collection(lines)
    if world is None:
        axes.autoscale()
        axes.set_aspect("equal")
    axes.figure.colorbar(lines, ax=axes, label="least clearance, m", shrink=0.7)
    return axes


def plot_driven(way: MotionArrays, world: World, axes: Axes | None = None) -> Axes:
    """Draw where a car drove over a World, by its speed."""
    axes = plot_junction(world) if axes is None else axes
    xy = local_from_geo(world.frame, way.lat_deg, way.lon_deg)
    drawn = axes.scatter(xy[:, 0], xy[:, 1], c=way.speed_mps, s=4, cmap="viridis", zorder=61)
    axes.figure.colorbar(drawn, ax=axes, label="speed, m/s", shrink=0.7)
    return axes


def plot_gap(recording: Recording, axes: Axes | None = None) -> Axes:
    """Draw how far the model was from the car by horizon: RMS along and across, of table `gaps`.

    Rows by estimated commands count where there are no others. Raises UserError without any.
    """
    table = expect("recording", recording, Recording).table("gaps")
    commanded = table.filter(table["independent"])
    table = commanded if commanded.num_rows else table
    if not table.num_rows:
        raise UserError(f"{recording.folder}: no gap was measured in this drive")
    axes = _axes(axes)
    horizon_s = table["horizon_s"].to_numpy()
    horizons = np.unique(horizon_s)
    for name, label in (("along_m", "along"), ("across_m", "across")):
        error_m = table[name].to_numpy()
        rms = [float(np.sqrt(np.mean(error_m[horizon_s == one] ** 2))) for one in horizons]
        axes.plot(horizons, rms, marker="o", label=label)
    axes.set(xlabel="seconds ahead", ylabel="model minus car, RMS, m", title="gap")
    axes.legend()
    axes.grid(visible=True, alpha=0.3)
    return axes


def plot_outcomes(recording: Recording, axes: Axes | None = None) -> Axes:
    """Draw the share of collided futures by scenario, a bar for each planner.

    Counts futures that were played; nominal ones have no scenario.
    """
    table = expect("recording", recording, Recording).table("futures")
    rows = table.select(["scenario", "planner", "collided", "valid"]).to_pylist()
    played = [row for row in rows if row["valid"]]
    if not played:
        raise UserError(f"{recording.folder}: no future was played")
    axes = _axes(axes)
    scenarios = sorted({row["scenario"] for row in played})
    planners = sorted({row["planner"] for row in played})
    height = 0.8 / len(planners)
    for number, planner in enumerate(planners):
        shares = [_share(played, scenario, planner) for scenario in scenarios]
        places = np.arange(len(scenarios)) + height * (number - (len(planners) - 1) / 2.0)
        axes.barh(places, shares, height=height, label=planner)
    axes.set_yticks(range(len(scenarios)), [one or "nominal" for one in scenarios])
    axes.set(xlabel="share that collided", xlim=(0.0, 1.0))
    axes.legend()
    return axes


def _share(rows: Sequence[dict[str, object]], scenario: str, planner: str) -> float:
    of = [row for row in rows if (row["scenario"], row["planner"]) == (scenario, planner)]
    return sum(bool(row["collided"]) for row in of) / len(of) if of else 0.0


def _axes(given: Axes | None) -> Axes:
    return plt.subplots(figsize=(6.0, 5.0), layout="constrained")[1] if given is None else given
