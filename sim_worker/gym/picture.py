"""A small picture from above: the road, the path, the car and the road users around it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from foretwin.geometry.rectangles import Rectangles, corners
from foretwin.sim_worker.batch.collision_detection import ego_rectangles
from foretwin.sim_worker.gym.rows import EpisodeRows

Picture = npt.NDArray[np.uint8]

SIZE_PX, AROUND_M = 320, 40.0
_DPI = 100
_GRASS, _ROAD, _BUILDING, _PATH = "#dfe6d5", "#b9bcc0", "#c9b8a8", "#ffffff"
_EGO, _OTHER = "#c0392b", "#2c5d8f"


def draw_row(rows: EpisodeRows, row: int) -> Picture:
    """Return (320, 320, 3) the 40 m around the car of a row, north up."""
    figure = Figure(figsize=(SIZE_PX / _DPI, SIZE_PX / _DPI), dpi=_DPI)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_facecolor(_GRASS)
    axes.set_xticks([])
    axes.set_yticks([])
    world, scene = rows.episodes.world, rows.scene
    for areas, colour in ((world.road_surface, _ROAD), (world.islands, _GRASS)):
        axes.add_collection(PolyCollection([a.outline for a in areas], facecolors=colour))
    holes = [hole for area in world.road_surface for hole in area.holes]
    axes.add_collection(PolyCollection(holes, facecolors=_GRASS))
    buildings = [building.outline for building in world.buildings]
    axes.add_collection(PolyCollection(buildings, facecolors=_BUILDING))
    axes.plot(*scene.path.node_poses[:, :2].T, color=_PATH, linewidth=1.0)
    state = rows.stage.states[row]
    ego = corners(ego_rectangles(rows.stage.vehicle, state[None]))
    axes.add_collection(PolyCollection(list(ego), facecolors=_EGO, zorder=4))
    if scene.traffic is not None:
        poses, crowd = scene.traffic.poses[row], scene.traffic.crowd
        boxes = Rectangles(poses[:, :2], poses[:, 2], crowd.length_m[row], crowd.width_m[row])
        outlines = corners(boxes)[np.isfinite(poses[:, 0])]
        axes.add_collection(PolyCollection(list(outlines), facecolors=_OTHER, zorder=3))
    x, y = state[:2]
    axes.set_xlim(x - AROUND_M, x + AROUND_M)
    axes.set_ylim(y - AROUND_M, y + AROUND_M)
    canvas.draw()  # type: ignore[no-untyped-call]
    pixels = canvas.buffer_rgba()  # type: ignore[no-untyped-call]
    return np.asarray(pixels, dtype=np.uint8)[..., :3].copy()
