"""The drawn town that `foretwin drive` runs without arguments: a map and a route, no real place."""

from __future__ import annotations

from pathlib import Path

FOLDER = Path(__file__).parent
MAP_FILE = FOLDER / "drawn_town.osm"
"""OSM XML written by `draw_town.py`; nothing in it comes from OpenStreetMap."""
ROUTE_FILE = FOLDER / "route.geojson"
"""The main route through the drawn town, along the centrelines of its ways."""
