"""The Karlsruhe crossing: a Lanelet2 file, and tracks of the vehicles recorded there."""

from __future__ import annotations

import csv
from collections import defaultdict
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from tests.world_gen.truth.even_cuts import evenly_cut
from tests.world_gen.truth.hd_map import HdLane, HdMap, Track

ORIGIN = LocalFrame(GeoPoint(49.01160993928274, 8.43856470258739))
_SPHERE_M_PER_DEG = 6378137.0 * np.pi / 180.0
"""Tracks are in a spherical Mercator projection scaled to be true at the origin."""
_LEAST_DRIVE_M = 15.0
_SAME_M = 0.5
"""Lanelets whose edges end and begin this near follow each other."""


def karlsruhe_map(folder: Path) -> HdMap:
    """Return the crossing with the tracks of vehicles that drove 15 m or more."""
    root = ElementTree.parse(next(folder.glob("*.lanelet2.osm"))).getroot()
    nodes = {
        node.get("id"): local_from_geo(
            ORIGIN, float(node.get("lat", "")), float(node.get("lon", ""))
        )
        for node in root.iter("node")
    }
    ways = {
        way.get("id"): np.array([nodes[nd.get("ref")] for nd in way.iter("nd")])
        for way in root.iter("way")
    }
    driven, crossings = {}, []
    for relation in root.iter("relation"):
        tags = {tag.get("k"): tag.get("v") for tag in relation.iter("tag")}
        sides = {m.get("role"): ways[m.get("ref")] for m in relation.iter("member")}
        subtype = tags.get("subtype", "")
        if subtype == "crosswalk":
            left, right = _side_by_side(sides["left"], sides["right"])
            crossings.append(np.array([(left[0] + right[0]) / 2.0, (left[-1] + right[-1]) / 2.0]))
        elif subtype in ("", "road"):
            driven[str(relation.get("id"))] = _one_way(sides["left"], sides["right"])
    return HdMap(
        name="karlsruhe",
        frame=ORIGIN,
        lanes=evenly_cut(_joined(driven)),
        crossings=tuple(crossings),
        signals=True,
        tracks=tuple(
            t for path in sorted(folder.glob("vehicle_tracks_*.csv")) for t in _tracks(path)
        ),
    )


def _side_by_side(left: Array, right: Array) -> tuple[Array, Array]:
    """Return both lines running the same way."""
    apart = np.hypot(*(left[0] - right[0])) + np.hypot(*(left[-1] - right[-1]))
    crossed = np.hypot(*(left[0] - right[-1])) + np.hypot(*(left[-1] - right[0]))
    return left, right if apart <= crossed else right[::-1]


def _one_way(left: Array, right: Array) -> tuple[Array, Array]:
    """Return a lanelet's edges in driving direction: the one in which `left` is on the left."""
    left, right = _side_by_side(left, right)
    along = left[-1] + right[-1] - left[0] - right[0]
    across = left[0] + left[-1] - right[0] - right[-1]
    if along[0] * across[1] - along[1] * across[0] < 0.0:
        return left[::-1], right[::-1]
    return left, right


def _joined(edges: dict[str, tuple[Array, Array]]) -> dict[str, HdLane]:
    begins = {key: np.stack([left[0], right[0]]) for key, (left, right) in edges.items()}
    ends = {key: np.stack([left[-1], right[-1]]) for key, (left, right) in edges.items()}
    follow = {
        key: tuple(other for other in edges if other != key and _same(ends[key], begins[other]))
        for key in edges
    }
    # Lanes through a junction cross others, or part from or join such.
    middles = {
        key: HdLane(id=key, left=a, right=b, kind="", inside=False, successors=()).centerline
        for key, (a, b) in edges.items()
    }
    lines = {key: shapely.LineString(middle) for key, middle in middles.items()}
    crossing = {key for key in edges if any(lines[key].crosses(one) for one in lines.values())}
    inside = {
        key
        for key in edges
        for other in crossing
        if key == other or _same(begins[key], begins[other]) or _same(ends[key], ends[other])
    }
    return {
        key: HdLane(
            id=key, left=left, right=right, kind="driving", inside=key in inside,
            successors=follow[key],
        )
        for key, (left, right) in edges.items()
    }  # fmt: skip


def _same(a: Array, b: Array) -> bool:
    return bool((np.hypot(*(a - b).T) < _SAME_M).all())


def _tracks(path: Path) -> list[Track]:
    rows = defaultdict(list)
    with path.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            if row["agent_type"] != "Pedestrian":
                rows[row["track_id"]].append((float(row["x"]), float(row["y"])))
    lat_deg, lon_deg = ORIGIN.origin.lat_deg, ORIGIN.origin.lon_deg
    east = _SPHERE_M_PER_DEG * np.cos(np.radians(lat_deg))
    found = []
    for key, places in rows.items():
        xy = np.array(places)
        if np.hypot(*(xy[-1] - xy[0])) >= _LEAST_DRIVE_M:
            lat, lon = lat_deg + xy[:, 1] / _SPHERE_M_PER_DEG, lon_deg + xy[:, 0] / east
            xy = local_from_geo(ORIGIN, lat, lon)
            found.append(Track(id=f"{path.stem[-3:]}.{key}", recording=path.stem[-3:], xy_m=xy))
    return found
