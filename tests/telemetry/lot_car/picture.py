"""Draws lot and World side by side: `python -m tests.telemetry.lot_car.picture MAP.osm`.

The stand-in drives on its lot as in test_braking; its fixes are drawn where they were measured, and
where the gateway says that they are.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame, local_from_geo
from foretwin.orchestrator.worlds.choice import choose_junctions
from foretwin.telemetry.anchored import lot_from_world_message
from foretwin.world_gen.build import build_world
from tests.telemetry.lot_car.test_braking import ANCHOR, FENCE_M, Meeting

PICTURE = Path(__file__).parents[3] / "docs" / "mixed-reality.png"
AHEAD_M = 62.0


def main(map_file: Path) -> None:
    """Drive, then draw what came of it."""
    meeting = Meeting("ros2dds", "PredictedObjects", ahead_m=AHEAD_M)
    track = []
    for _ in range(160):
        meeting.go_on(0.1)
        if meeting.fix is not None:
            track.append(meeting.fix.position)
    report = meeting.car.report()
    world_frame, lot_frame = ANCHOR.world.frame, ANCHOR.lot.frame
    there = np.array([local_from_geo(world_frame, p.lat_deg, p.lon_deg) for p in track])
    geo = [ANCHOR.lot_from_world(p, 0.0).position for p in track]
    here = np.array([local_from_geo(lot_frame, p.lat_deg, p.lon_deg) for p in geo])
    walker = meeting.gateway._virtual.own(0)
    figure, (lot, world) = plt.subplots(1, 2, figsize=(12, 5.4), constrained_layout=True)
    fence = np.array([*FENCE_M, FENCE_M[0]])
    lot.plot(*fence.T, color="tab:red", label="fence")
    _drawn(lot, here, local_xy(lot_frame, lot_from_world_message(ANCHOR, walker)))
    lot.set_title("The lot: nothing but the car (the pedestrian is what it was told of)")
    lot.set(xlim=(-45, 115), ylim=(-70, 115))
    opened, (junction, *_) = choose_junctions(map_file, at="52.5123,13.3915", radius_m=150.0)
    made = build_world(opened.osm, opened.graph, junction, radius_m=150.0)
    to_anchor = local_from_geo(world_frame, made.frame.origin.lat_deg, made.frame.origin.lon_deg)
    for lane in made.lanes:
        line = np.asarray(lane.centerline)[:, :2] + to_anchor
        world.plot(*line.T, color="0.75", linewidth=4, solid_capstyle="round", zorder=0)
    for building in made.buildings:
        world.fill(*(np.asarray(building.outline)[:, :2] + to_anchor).T, color="0.88", zorder=0)
    _drawn(world, there, local_xy(world_frame, walker))
    world.set_title(f"The World: {junction.summary.name}, Berlin")
    world.set(xlim=(-75, 75), ylim=(-110, 35))
    for axes in (lot, world):
        axes.set_aspect("equal")
        axes.set(xlabel="m east of the anchor", ylabel="m north")
        axes.legend(loc="upper left", fontsize=8)
    figure.suptitle(
        f"The stand-in began to brake {report.braked_at_m:.1f} m before the pedestrian, and stood "
        f"{report.stood_before_m:.1f} m before it"
    )
    figure.text(0.995, 0.005, made.attribution, ha="right", fontsize=7)
    figure.savefig(PICTURE, dpi=100)


def local_xy(frame: LocalFrame, users: Any) -> Array:
    (user,) = users.users
    return local_from_geo(frame, user.position.lat_deg, user.position.lon_deg)


def _drawn(axes: Any, track: Array, walker: Array) -> None:
    axes.plot(0.0, 0.0, "k+", markersize=12, label="anchor")
    axes.plot(*track.T, color="tab:blue", linewidth=2, label="the car's fixes")
    axes.plot(*track[-1], "s", color="tab:blue", markersize=7, label="where it stood (antenna)")
    axes.plot(*walker, "o", color="tab:orange", markersize=8, label="virtual pedestrian")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
