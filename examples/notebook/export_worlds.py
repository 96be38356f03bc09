"""Every intersection of a map for another program: `python export_worlds.py MAP.osm FOLDER .xodr`.

The suffix names the format: .sdf, .xodr, .osm (Lanelet2), .geojson, .svg, .png.
"""

import sys
from pathlib import Path

import foretwin

town = foretwin.open_map(sys.argv[1])
folder = Path(sys.argv[2])
folder.mkdir(parents=True, exist_ok=True)
for junction in town.intersections:
    file = folder / f"{junction.id}{sys.argv[3]}"
    print(foretwin.export_world(town.world(junction.id), file))
