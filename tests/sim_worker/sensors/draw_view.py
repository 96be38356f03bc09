"""`python -m tests.sim_worker.sensors.draw_view MAP OUT.png` draws docs/camera.png: what a camera
sees at a junction of Berlin, in colours, distances and by whom."""

from __future__ import annotations

import sys

import matplotlib as mpl
import numpy as np

import foretwin
from tests.sim_worker.sensors.draw_scan import JUNCTION, among

REACH_M = 80.0


def main(map_file: str, out: str) -> None:
    mpl.use("Agg")
    from matplotlib import pyplot

    town = foretwin.open_map(map_file)
    (chosen,) = (one for one in town.intersections if one.name == JUNCTION)
    world = town.world(chosen.id)
    way = foretwin.ways_through(world)[0]
    car = foretwin.state_on(world, way, before_m=22.0)
    view = foretwin.camera_view(world, car, among(world, way))
    figure, axes = pyplot.subplots(1, 3, figsize=(15, 4.2), constrained_layout=True)
    axes[0].imshow(view.rgb)
    axes[1].imshow(np.minimum(view.depth_m, REACH_M), cmap="viridis_r")
    axes[2].imshow(np.maximum(view.body, -2), cmap="tab10", vmin=-2, vmax=7)
    for plot, title in zip(axes, ("colours", f"distances up to {REACH_M:.0f} m", "whom"),
                           strict=True):  # fmt: skip
        plot.set_title(title)
        plot.set_axis_off()
    figure.supxlabel(world.attribution, fontsize=8)
    figure.savefig(out, dpi=80)


if __name__ == "__main__":
    main(*sys.argv[1:])
