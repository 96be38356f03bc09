"""Runs in the judges' interpreter, which has carla: read maps with CARLA's own parser, no server.

Reads from standard input a JSON list of paths of OpenDRIVE files; writes a JSON object of what
CARLA makes of each, in the file's axes: waypoints on lanes for driving [road, lane, x, y, yaw in
radians, width] at every two metres, where each leads a metre on, and crosswalks as outlines.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import carla


def main() -> None:
    json.dump({path: read(path) for path in json.load(sys.stdin)}, sys.stdout)


def read(path: str) -> dict[str, Any]:
    road_map = carla.Map(Path(path).stem, Path(path).read_text(encoding="utf-8"))
    waypoints = road_map.generate_waypoints(2.0)
    return {
        "waypoints": [[w.road_id, w.lane_id, *pose(w), w.lane_width] for w in waypoints],
        "next": [[[n.road_id, n.lane_id, *pose(n)] for n in w.next(1.0)] for w in waypoints],
        "crosswalks": outlines(road_map.get_crosswalks()),
    }


def pose(waypoint: Any) -> tuple[float, float, float]:
    """Return x, y and yaw in the file's axes: CARLA's y points to the south."""
    at, turned = waypoint.transform.location, waypoint.transform.rotation
    return at.x, -at.y, -math.radians(turned.yaw)


def outlines(points: list[Any]) -> list[list[tuple[float, float]]]:
    """Return closed outlines of points that follow one another; each ends with its first."""
    found: list[list[tuple[float, float]]] = []
    current: list[tuple[float, float]] = []
    for point in points:
        current.append((point.x, -point.y))
        if len(current) > 2 and math.dist(current[0], current[-1]) < 1e-3:
            found.append(current)
            current = []
    return [*found, current] if current else found


if __name__ == "__main__":
    main()
