"""The command `anchor`: where a lot can be anchored, as the table that an anchor file needs."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import GeoPose, geo_pose, local_from_geo
from foretwin.contracts.world import Lane, World
from foretwin.geometry.polyline import arc_lengths, interpolated
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.worlds.choice import choose_junctions, parse_place
from foretwin.world_gen.build import build_world


class LanePose(NamedTuple):
    """A pose on a lane that leads to a junction."""

    lane: Lane
    before_m: float
    """As far before the lane's end, at most its length."""
    off_m: float
    """From the place that was asked for to the lane."""
    pose: GeoPose

    def world_table(self) -> dict[str, str]:
        """Return the keys of the table [world] of an anchor file, and what stands there."""
        point = self.pose.position
        return {
            "lat_deg": f"{point.lat_deg:.7f}",
            "lon_deg": f"{point.lon_deg:.7f}",
            "yaw_deg": f"{np.degrees(self.pose.yaw_rad):.2f}",
        }

    def as_object(self) -> dict[str, object]:
        """Return the pose as JSON has it."""
        far_m = {"before_m": round(self.before_m, 2), "off_m": round(self.off_m, 2)}
        world = {key: float(text) for key, text in self.world_table().items()}
        return {"lane": self.lane.name, **far_m, "world": world}


def show_anchors(map_file: Path, *, at: str, before_m: float) -> CommandResult:
    """Return the poses on the lanes that lead to the junction nearest to a place, best first.

    In words the first is a table of an anchor file as it stands, the others are comments of one.
    """
    if not 0.0 <= before_m <= 1000.0:
        raise UserError(f"--before {before_m}: 0 to 1000 m")
    opened, (junction, *_) = choose_junctions(map_file, at=at, radius_m=150.0)
    world = build_world(opened.osm, opened.graph, junction, radius_m=150.0)
    found = lane_poses(world, parse_place(at), before_m=before_m)
    if not found:
        raise UserError(f"--at {at}: no lane leads to {junction.summary.id}")
    lines = []
    for place, one in enumerate(found):
        name = one.lane.name or "a road without a name"
        lines.append(f"# {name}, {one.before_m:.0f} m before its end at {junction.summary.name}")
        table = ("[world]", *(f"{key} = {text}" for key, text in one.world_table().items()))
        lines += [f"# {line}" if place else line for line in table]
    lines.append(f"# {world.attribution}")
    body = {
        "junction_id": junction.summary.id,
        "junction": junction.summary.name,
        "poses": [one.as_object() for one in found],
        "attribution": world.attribution,
    }
    return CommandResult(body, "\n".join(lines))


def lane_poses(world: World, place: tuple[float, float], *, before_m: float) -> list[LanePose]:
    """Return the poses on a World's approaches, those nearest to latitude and longitude first."""
    xy_m = local_from_geo(world.frame, *place)
    poses = []
    for lane in world.lanes:
        if lane.role != "approach":
            continue
        line = np.asarray(lane.centerline)[:, :2]
        s_m = arc_lengths(line)
        there_m = max(0.0, float(s_m[-1]) - before_m)
        (x_m, y_m), ahead = (
            interpolated(s, s_m, line) for s in (there_m, min(there_m + 1.0, float(s_m[-1])))
        )
        if there_m == s_m[-1]:
            ahead = 2.0 * np.array([x_m, y_m]) - interpolated(there_m - 1.0, s_m, line)
        yaw_rad = float(np.arctan2(ahead[1] - y_m, ahead[0] - x_m))
        dense = interpolated(np.linspace(0.0, s_m[-1], 200), s_m, line)
        off_m = float(np.hypot(*(dense - xy_m).T).min())
        pose = geo_pose(world.frame, float(x_m), float(y_m), yaw_rad)
        poses.append(LanePose(lane, float(s_m[-1]) - there_m, off_m, pose))
    return sorted(poses, key=lambda one: one.off_m)
