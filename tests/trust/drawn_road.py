"""A map for a drive of which no public map is at hand: its own road, drawn as mappers draw.

The driven line is simplified as roads in OpenStreetMap are, each node is put beside its place by
what maps are wrong by, and short side streets make junctions of it. Futures on it are led by a road
that is about where the car then drove, as on a real map; what they are spared is a map that lies.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame, geo_from_local

SIMPLIFIED_M = 1.5
NODE_STD_M = 0.7
"""Of both; with them the driven line lies 0.7 m from the drawn one, as it lies 1.2 m (medians) from
the roads of the real map on the Berlin drive, half a lane of which is no error."""
SIDE_STREET_EVERY_M = 120.0
_SIDE_STREET_M = 60.0
_LEAST_STEP_M = 3.0


class _Node(NamedTuple):
    """A node of the map, and its place."""

    id: int
    xy_m: Array


def draw_road(
    track_xy_m: Array, frame: LocalFrame, file: Path, *, seed: int, speed_limit_kmh: int = 50
) -> Path:
    """Write a map of the road along a track (N, 2) in `frame`; returns the file."""
    random = np.random.default_rng(seed)
    line = _simplified(track_xy_m)
    line = line + random.normal(0.0, NODE_STD_M, line.shape)
    main = [_Node(number + 1, xy) for number, xy in enumerate(line)]
    ways, nodes = [[node.id for node in main]], list(main)
    since_m = SIDE_STREET_EVERY_M
    for before, here, after in zip(main, main[1:], main[2:], strict=False):
        since_m += float(np.hypot(*(here.xy_m - before.xy_m)))
        if since_m < SIDE_STREET_EVERY_M:
            continue
        since_m = 0.0
        along = after.xy_m - before.xy_m
        aside = np.array([along[1], -along[0]]) / np.hypot(*along) * _SIDE_STREET_M
        nodes.append(_Node(len(nodes) + 1, here.xy_m + aside))
        ways.append([here.id, nodes[-1].id])
    file.write_text(_osm(nodes, ways, frame, speed_limit_kmh), encoding="utf-8")
    return file


def _simplified(track_xy_m: Array) -> Array:
    kept = [track_xy_m[0]]
    for xy in track_xy_m[1:]:
        if np.hypot(*(xy - kept[-1])) >= _LEAST_STEP_M:
            kept.append(xy)
    line = shapely.LineString(np.array(kept)).simplify(SIMPLIFIED_M, preserve_topology=False)
    # Long straights get nodes too, or their ends alone would decide where they lie.
    return np.asarray(shapely.get_coordinates(line.segmentize(60.0)))


def _osm(nodes: list[_Node], ways: list[list[int]], frame: LocalFrame, limit_kmh: int) -> str:
    places = geo_from_local(frame, np.array([node.xy_m for node in nodes]))
    low, high = places.min(axis=0) - 0.003, places.max(axis=0) + 0.003
    text = [
        "<?xml version='1.0' encoding='UTF-8'?>",
        '<osm version="0.6" generator="foretwin tests">',
        f'<bounds minlat="{low[0]:.7f}" minlon="{low[1]:.7f}" '
        f'maxlat="{high[0]:.7f}" maxlon="{high[1]:.7f}"/>',
    ]
    text += [
        f'<node id="{node.id}" version="1" lat="{lat:.8f}" lon="{lon:.8f}"/>'
        for node, (lat, lon) in zip(nodes, places, strict=True)
    ]
    for number, refs in enumerate(ways):
        tags = {"highway": "residential", "name": f"Road {number}", "maxspeed": str(limit_kmh)}
        if number == 0:
            tags |= {"highway": "secondary", "oneway": "yes", "lanes": "1"}
        text.append(f'<way id="{number + 1}" version="1">')
        text += [f'<nd ref="{ref}"/>' for ref in refs]
        text += [f'<tag k="{key}" v="{value}"/>' for key, value in tags.items()]
        text.append("</way>")
    return "\n".join([*text, "</osm>"]) + "\n"
