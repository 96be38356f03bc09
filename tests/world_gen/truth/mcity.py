"""Real repeated passes: cars with RTK at a crossing of the Mcity test track, and a drawn map.

No OpenStreetMap extract of the place is at hand. Its two streets are drawn by hand, from the
middle between the passes of both directions, so that the map is off by about as much as
OpenStreetMap is; what is real is how alike one driver's passes are to another's.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local, local_from_geo
from tests.world_gen.truth.hd_map import HdMap, Track

FRAME = LocalFrame(GeoPoint(42.300947, -83.698649))
_JUMP_M = 5.0
_LEAST_M = 30.0
_STREETS = {
    "North": [(1.2, -90.0), (1.3, -30.0), (1.2, 3.0), (1.3, 20.0), (3.0, 45.0), (7.0, 60.0)],
    "West": [(110.0, 0.5), (60.0, 1.2), (1.2, 3.0), (-38.0, 2.4), (-46.0, 0.0)],
}


def mcity_passes(folder: Path) -> HdMap:
    """Return the passes of all cars, and no lanes: nobody surveyed them."""
    tracks = []
    for path in sorted(folder.glob("gts/gps_data_*.json")):
        rows = json.loads(path.read_text(encoding="utf-8"))
        for car in (0, 1):
            places = [(o["lat"], o["lon"]) for row in rows for o in row["objs"] if o["id"] == car]
            if places:
                tracks += _pieces(f"{path.stem} {car}", np.array(places))
    return HdMap(
        name="mcity", frame=FRAME, lanes={}, crossings=(), signals=False, tracks=tuple(tracks)
    )


def _pieces(name: str, places_deg: Array) -> list[Track]:
    xy_m = local_from_geo(FRAME, places_deg[:, 0], places_deg[:, 1])
    jumps = np.flatnonzero(np.hypot(*np.diff(xy_m, axis=0).T) > _JUMP_M) + 1
    return [
        Track(id=f"{name} {i}", recording=name, xy_m=piece)
        for i, piece in enumerate(np.split(xy_m, jumps))
        if len(piece) > 1 and np.hypot(*np.diff(piece, axis=0).T).sum() > _LEAST_M
    ]


def drawn_map() -> str:
    """Return the .osm text of the two streets, one lane each way."""
    places: dict[tuple[float, float], int] = {}
    for line in _STREETS.values():
        for xy in line:
            places.setdefault(xy, len(places) + 1)
    geo = geo_from_local(FRAME, np.array(list(places))).tolist()
    south, west, north, east = 42.2995, -83.7000, 42.3025, -83.6970
    text = f'<bounds minlat="{south}" minlon="{west}" maxlat="{north}" maxlon="{east}"/>'
    for key, (lat, lon) in zip(places.values(), geo, strict=True):
        text += f'<node id="{key}" version="1" lat="{lat:.8f}" lon="{lon:.8f}"/>'
    for i, (name, line) in enumerate(_STREETS.items()):
        refs = "".join(f'<nd ref="{places[xy]}"/>' for xy in line)
        tags = {"highway": "tertiary", "lanes": "2", "name": name}
        said = "".join(f'<tag k="{k}" v="{v}"/>' for k, v in tags.items())
        text += f'<way id="{i + 1}" version="1">{refs}{said}</way>'
    return f'<osm version="0.6">{text}</osm>\n'
