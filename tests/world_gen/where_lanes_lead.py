"""How many lanes of real maps end in front of a junction with nowhere to go.

`python -m tests.world_gen.where_lanes_lead` prints a line for each map in `FORETWIN_DATA`, and
every lane that leads nowhere; with names (or parts of them), for those maps alone.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import msgspec
import numpy as np

from foretwin.contracts.world import World
from foretwin.world_gen.build import build_region
from foretwin.world_gen.osm.osm_map import LatLonBounds
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.data_maps import data_folder, named

DRIVEN = ("driving", "bus")
GOES_ON_M = 1.0
"""A lane that begins no farther from the end of another one goes on from it."""
SUFFIXES = (".osm", ".osm.gz", ".osm.xml.gz", ".osm.pbf")


class LaneEnds(msgspec.Struct, frozen=True, kw_only=True):
    """Lanes that end where roads of a whole World meet, and those of them that lead nowhere."""

    ends: tuple[str, ...]
    dead: tuple[str, ...]
    closed: tuple[str, ...]
    """Lanes of roads that none of their lanes leads out of: a real dead end."""
    reserved: tuple[str, ...]
    """Lanes for all that go on as a lane for buses: drivers change lanes before."""
    no_room: tuple[str, ...]
    """Lanes whose only ways on were left out since no path could be drawn, as a note says."""


def lane_ends(world: World) -> LaneEnds:
    """Return where lanes for cars and buses end at a place that other roads leave."""
    lanes = {lane.id: lane for lane in world.lanes if lane.kind in DRIVEN}
    buses = [lane.centerline[0] for lane in lanes.values() if lane.kind == "bus"]
    begins = np.array(buses).reshape(-1, 2)
    ends: list[str] = []
    dead: list[str] = []
    closed: list[str] = []
    reserved: list[str] = []
    no_room: list[str] = []
    left_out = [note for note in world.notes if "no room at all" in note]
    for road in world.roads:
        for reverse, place in ((False, road.to_place), (True, road.from_place)):
            mine = [lanes[i] for i in road.lane_ids if i in lanes and lanes[i].reverse == reverse]
            if place is None:
                continue
            ends += [lane.id for lane in mine]
            stuck = [lane for lane in mine if not lane.successor_ids]
            for lane in stuck:
                gaps_m = np.hypot(*(begins - lane.centerline[-1]).T)
                if any(note.startswith(f"way {lane.osm_way}:") for note in left_out):
                    no_room.append(lane.id)
                elif len(stuck) == len(mine):
                    closed.append(lane.id)
                elif lane.kind == "driving" and (gaps_m < GOES_ON_M).any():
                    reserved.append(lane.id)
                else:
                    dead.append(lane.id)
    return LaneEnds(
        ends=tuple(ends),
        dead=tuple(dead),
        closed=tuple(closed),
        reserved=tuple(reserved),
        no_room=tuple(no_room),
    )


def maps_in(folder: Path) -> Iterator[Path]:
    """Yield the map files of a data folder."""
    for path in sorted(folder.glob("osm-*/*")):
        if path.name.endswith(SUFFIXES):
            yield path


def maps_named(words: Sequence[str]) -> list[Path]:
    """Return those whose path below the data folder holds one of the words, all without words."""
    folder = data_folder()
    names = [str(path.relative_to(folder)) for path in maps_in(folder)]
    return [folder / name for name in named(words, names)]


def whole_world(path: Path) -> World:
    """Return the World of all that a map holds."""
    osm = read_map(path)
    lat, lon = osm.locations.lat_lon_deg.T
    bounds = LatLonBounds(lat.min() - 1e-3, lon.min() - 1e-3, lat.max() + 1e-3, lon.max() + 1e-3)
    return build_region(osm, build_road_graph(osm), bounds, ground=False)


def main(wanted: Sequence[str]) -> None:
    """Print the counts of every map, and each lane that leads nowhere."""
    for path in maps_named(wanted):
        found = lane_ends(whole_world(path))
        counts = (f"{len(getattr(found, name))} {name}" for name in found.__struct_fields__)
        print(f"{path.name}: {', '.join(counts)}", *(f"  dead {n}" for n in found.dead), sep="\n")


if __name__ == "__main__":
    main(sys.argv[1:])
