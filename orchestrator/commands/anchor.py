"""The command `anchor`: where a lot can be anchored, as the table that an anchor file needs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from foretwin.contracts.did_you_mean import meant
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import GeoPose, geo_pose, local_from_geo
from foretwin.contracts.new_folder import named_in_errors
from foretwin.contracts.partial_file import partial_file
from foretwin.contracts.world import Lane, World
from foretwin.geometry.polyline import arc_lengths, interpolated
from foretwin.orchestrator.commands.anchor_page import anchor_page
from foretwin.orchestrator.commands.output import check_html_file
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.worlds.choice import (
    FARTHEST_M,
    choose_junctions,
    nearest_junction,
    parse_place,
)
from foretwin.orchestrator.worlds.opening import open_map
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.opening import NodeClip, OpenMap

_LANE_ID = re.compile(r"w-?\d{1,18}\.(-?\d{1,18})\.(-?\d{1,18})\.([fb])\d{1,2}", re.ASCII)
_RADIUS_M = 150.0


class _AnchorPlace(NamedTuple):
    """The junction whose World is meant, and where in it, by latitude and longitude."""

    opened: OpenMap
    junction: Junction
    place: tuple[float, float]


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
        return {"lane": self.lane.name, "lane_id": self.lane.id, **far_m, "world": world}


def show_anchors(
    map_file: Path, *, at: str | None, lane_id: str | None, before_m: float, page: Path | None
) -> CommandResult:
    """Return the poses on the lanes that lead to the junction nearest to a place, best first, or
    that on one lane.

    In words the first is a table of an anchor file as it stands, the others are comments of one.
    `page` is where a page is written that takes a click instead.
    """
    if not 0.0 <= before_m <= 1000.0:
        raise UserError(f"--before {before_m}: 0 to 1000 m")
    if page is not None:
        check_html_file(page, "--page", "the page")
    if at is not None and lane_id is None:
        opened, (junction, *_) = choose_junctions(map_file, at=at, radius_m=_RADIUS_M)
        asked = _AnchorPlace(opened, junction, parse_place(at))
    elif lane_id is not None and at is None:
        asked = _end_of(map_file, lane_id)
    else:
        raise UserError("either --at LAT,LON or --lane ID is needed")
    summary = asked.junction.summary
    world = build_world(asked.opened.osm, asked.opened.graph, asked.junction, radius_m=_RADIUS_M)
    found = lane_poses(world, asked.place, before_m=before_m, lane_id=lane_id)
    if not found and lane_id is not None:
        near = meant(lane_id, (lane.id for lane in world.lanes))
        none = f"--lane {lane_id}: the World of {summary.id} holds no such lane"
        raise UserError(f"{none}; {near.strip()}" if near else none)
    if not found:
        raise UserError(f"--at {at}: no lane leads to {summary.id}")
    lines = []
    if page is not None:
        page.parent.mkdir(parents=True, exist_ok=True)
        with named_in_errors(f"--page {page}"), partial_file(page) as partial:
            partial.write_text(anchor_page(world, radius_m=_RADIUS_M), encoding="utf-8")
        lines.append(f"# wrote {page}: a click on it tells the pose there")
    for number, one in enumerate(found):
        name = one.lane.name or "a road without a name"
        lines.append(
            f"# {name}, {one.before_m:.0f} m before its end at {summary.name}, {one.lane.id}"
        )
        table = ("[world]", *(f"{key} = {text}" for key, text in one.world_table().items()))
        lines += [f"# {line}" if number else line for line in table]
    lines.append(f"# {world.attribution}")
    body = {
        "junction_id": summary.id,
        "junction": summary.name,
        "poses": [one.as_object() for one in found],
        "page": None if page is None else str(page),
        "attribution": world.attribution,
    }
    return CommandResult(body, "\n".join(lines))


def _end_of(map_file: Path, lane_id: str) -> _AnchorPlace:
    """Return the junction nearest to where a lane ends; UserError where there is none."""
    if (parts := _LANE_ID.fullmatch(lane_id)) is None:
        raise UserError(
            f"--lane {lane_id}: lanes are named by way, nodes and number, as w10012.41.44.f0; "
            "`foretwin anchor MAP --at LAT,LON` tells those of a junction"
        )
    first, last, way = parts.groups()
    node = int(last if way == "f" else first)
    opened = open_map(map_file, clip=NodeClip(node, _RADIUS_M + FARTHEST_M))
    try:
        place = opened.osm.locations[node]
    except KeyError:
        raise UserError(f"--lane {lane_id}: {opened.file} holds no node {node}") from None
    return _AnchorPlace(opened, nearest_junction(opened, *place), place)


def lane_poses(
    world: World, place: tuple[float, float], *, before_m: float, lane_id: str | None = None
) -> list[LanePose]:
    """Return the poses on a World's approaches, or on the lane of an id, whatever leads where;
    those nearest to latitude and longitude first."""
    xy_m = local_from_geo(world.frame, *place)
    poses = []
    for lane in world.lanes:
        if lane.role != "approach" if lane_id is None else lane.id != lane_id:
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
