"""Real drives by smartLoc: one inside an OpenStreetMap extract, and two in other quarters."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_ecef, local_from_geo

FRAME = LocalFrame(GeoPoint(52.5093, 13.39295))
SOUTH_WEST, NORTH_EAST = GeoPoint(52.5056, 13.3857), GeoPoint(52.5130, 13.4002)
"""What the extract declares to hold."""
_INSIDE_S = ((0.0, 262.7), (643.9, 696.1))
_ELSEWHERE = {
    "berlin, potsdamer platz": "drive-berlin-potsdamer-platz/Berlin_Potsdamer_Platz_GT.txt",
    "frankfurt, westend": "drive-frankfurt-westend/Frankfurt_Westend_Tower_GT.txt",
}


@dataclass(frozen=True, kw_only=True)
class BerlinDrive:
    """The drive's two passages of the map, as they were received, in metres of `frame`, and all
    of it."""

    map_file: Path
    frame: LocalFrame
    tracks: list[Array]
    whole_m: Array
    within_m: Array


def berlin_truth(data: Path) -> BerlinDrive:
    """Return the drive: positions of a NovAtel SPAN receiver, with glitches of 0.5 to 2 m."""
    at_s, geo = _positions(data / "drive-berlin-gendarmenmarkt" / "Berlin_Gendarmenmarkt_GT.txt")
    xy_m = local_from_geo(FRAME, geo[:, 0], geo[:, 1])
    corners = [local_from_geo(FRAME, p.lat_deg, p.lon_deg) for p in (SOUTH_WEST, NORTH_EAST)]
    return BerlinDrive(
        map_file=data / "osm-berlin-mitte" / "berlin-mitte.osm",
        frame=FRAME,
        tracks=[xy_m[(at_s >= a) & (at_s <= b)] for a, b in _INSIDE_S],
        whole_m=xy_m,
        within_m=np.array(corners),
    )


def drives_without_map(data: Path) -> dict[str, Array]:
    """Return drives (N, 2) in metres by their place, of which no map is there."""
    found = {}
    for name, file in _ELSEWHERE.items():
        _, geo = _positions(data / file)
        frame = LocalFrame(GeoPoint(*geo[len(geo) // 2, :2]))
        found[name] = local_from_geo(frame, geo[:, 0], geo[:, 1])
    return found


def _positions(file: Path) -> tuple[Array, Array]:
    """Return a recording's times in seconds and its positions (N, 3) in degrees and metres."""
    lines = file.read_text(encoding="utf-8").splitlines()
    rows = np.array([[float(value) for value in line.split()[1:5]] for line in lines])
    return rows[:, 0], geo_from_ecef(rows[:, 1:4])
