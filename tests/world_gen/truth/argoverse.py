"""Argoverse 2 vector maps with the poses of the car that recorded them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.feather as feather
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import GeoPoint, LocalFrame
from tests.world_gen.truth.even_cuts import evenly_cut
from tests.world_gen.truth.hd_map import HdLane, HdMap, Track

CITY = LocalFrame(GeoPoint(40.4418, -80.0129))
"""Pittsburgh. A map's own metres are laid about this point: its shape is kept, its place not."""
_KINDS = {"VEHICLE": "driving", "BUS": "bus", "BIKE": "bicycle"}


def argoverse_maps(folder: Path) -> list[HdMap]:
    """Return the maps of a folder, each about its own middle."""
    return [_read(path) for path in sorted(folder.glob("log_map_archive_*.json"))]


def drivable_area(folder: Path) -> list[shapely.Geometry]:
    """Return where cars can drive by each of the maps of `argoverse_maps`, in its metres."""
    found = []
    for path in sorted(folder.glob("log_map_archive_*.json")):
        data = json.loads(path.read_text(encoding="utf-8"))
        outlines = [_line(area["area_boundary"]) for area in data["drivable_areas"].values()]
        rings = [shapely.Polygon(line - _middle(data)).buffer(0.0) for line in outlines]
        found.append(shapely.union_all(rings))
    return found


def _middle(data: dict[str, Any]) -> Array:
    segments = data["lane_segments"].values()
    middle: Array = np.mean([_line(s["left_lane_boundary"]).mean(axis=0) for s in segments], axis=0)
    return middle


def _read(path: Path) -> HdMap:
    data = json.loads(path.read_text(encoding="utf-8"))
    segments, middle = data["lane_segments"].values(), _middle(data)
    name = path.stem.removeprefix("log_map_archive_")[:8]
    lanes = {
        str(s["id"]): HdLane(
            id=str(s["id"]),
            left=_line(s["left_lane_boundary"]) - middle,
            right=_line(s["right_lane_boundary"]) - middle,
            kind=_KINDS[s["lane_type"]],
            inside=s["is_intersection"],
            successors=tuple(str(n) for n in s["successors"]),
        )
        for s in segments
    }
    crossings = [
        (_line(c["edge1"]) + _line(c["edge2"])) / 2.0 - middle
        for c in data["pedestrian_crossings"].values()
        if len(c["edge1"]) == len(c["edge2"]) == 2
    ]
    poses = feather.read_table(path.parent / f"{name}_city_SE3_egovehicle.feather")
    xy_m = np.stack([poses["tx_m"].to_numpy(), poses["ty_m"].to_numpy()], axis=1)
    track = Track(id=name, recording=name, xy_m=xy_m - middle)
    return HdMap(
        name=f"pittsburgh {name}",
        frame=CITY,
        lanes=evenly_cut(lanes),
        crossings=tuple(crossings),
        signals=False,
        tracks=(track,),
    )


def _line(points: list[dict[str, Any]]) -> Array:
    return np.array([[p["x"], p["y"]] for p in points])
