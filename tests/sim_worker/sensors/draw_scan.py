"""`python -m tests.sim_worker.sensors.draw_scan MAP OUT.png` draws docs/sensors.png: a turn of a
VLP-32C at a junction of Berlin among virtual road users, and the same put into a "real" cloud."""

from __future__ import annotations

import sys
from typing import Any

import matplotlib as mpl
import numpy as np

import foretwin

JUNCTION = "Leipziger Straße \u00d7 Markgrafenstraße"
REACH_M = 45.0


def main(map_file: str, out: str) -> None:
    mpl.use("Agg")
    from matplotlib import pyplot

    town = foretwin.open_map(map_file)
    (chosen,) = (one for one in town.intersections if one.name == JUNCTION)
    world = town.world(chosen.id)
    way = foretwin.ways_through(world)[0]
    car = foretwin.state_on(world, way, before_m=22.0, speed_mps=8.0)
    users = among(world, way)
    whole = foretwin.lidar_scan(world, car, users, "vlp_32c", seed=1)
    real = foretwin.lidar_scan(world, car, (), "vlp_32c", seed=2).points
    alone = foretwin.lidar_scan(world, car, users, "vlp_32c", users_alone=True, seed=3)
    merged = foretwin.merge_clouds(real, alone)
    figure, axes = pyplot.subplots(1, 3, figsize=(15, 5.4), constrained_layout=True)
    for plot, cloud, title in zip(
        axes, (real, merged, whole.points),
        ("a cloud of the junction without them", "the same, virtual road users put into it",
         "what is measured where they are there"), strict=True,
    ):  # fmt: skip
        show(plot, cloud, title)
    figure.supxlabel(world.attribution, fontsize=8)
    figure.savefig(out, dpi=100)


def among(world: foretwin.World, way: foretwin.Way) -> list[Any]:
    """A car ahead, a bus and a car that cross, two on foot."""
    found = []
    for kind, ahead_m, aside_m, turned in (
        ("car", -8.0, 0.0, 0.0), ("bus", 16.0, 9.0, 1.57), ("car", 10.0, -12.0, -1.57),
        ("pedestrian", -3.0, -6.0, 1.5), ("pedestrian", -12.0, 7.0, 0.3),
    ):  # fmt: skip
        at = np.array([way.entry_m + ahead_m])
        (x, y), yaw = way.path.point_at(at)[0], float(way.path.pose_at(at).yaw_rad[0])
        x, y = x - np.sin(yaw) * aside_m, y + np.cos(yaw) * aside_m
        found.append(foretwin.road_user(world, kind, x, y, yaw_rad=yaw + turned))
    return found


def show(plot: Any, cloud: Any, title: str) -> None:
    """Draw a cloud from above, brighter where it is higher."""
    order = np.argsort(cloud[:, 2])
    x, y, z = cloud[order, :3].T
    plot.scatter(-y, x, c=z, s=1.2, cmap="viridis", vmin=0.0, vmax=6.0, linewidths=0)
    plot.plot([-0.8, -0.8, 0.8, 0.8, -0.8], [-0.8, 3.7, 3.7, -0.8, -0.8], color="red", lw=1)
    plot.set(xlim=(-REACH_M, REACH_M), ylim=(-REACH_M, REACH_M), aspect="equal", title=title)


if __name__ == "__main__":
    main(*sys.argv[1:])
