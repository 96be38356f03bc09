"""What foretwin and SUMO's netconvert make of the same map."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.tracks import DrivenTrack, TrackSet
from foretwin.world_gen.build import build_region
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.benchmarks.netconvert import netconvert_command
from tests.world_gen.truth.lane_model import LaneModel, of_sumo, of_world

RECOMMENDED = (
    "--geometry.remove", "--junctions.join", "--tls.guess-signals", "--tls.discard-simple",
    "--tls.join", "--ramps.guess", "--roundabouts.guess", "--osm.turn-lanes",
)  # fmt: skip
"""What SUMO's documentation recommends for OpenStreetMap, and to read its turn lanes."""


def by_foretwin(map_file: Path, frame: LocalFrame, tracks: Sequence[DrivenTrack] = ()) -> LaneModel:
    """Return the lanes of the one World of the whole map."""
    osm = read_map(map_file)
    graph = build_road_graph(osm)
    known = TrackSet.of(tuple(tracks)) if tracks else None
    index = index_map(osm, graph, find_intersections(osm, graph), tracks=known)
    return of_world(build_region(osm, graph, osm.bounds, index=index, ground=False), frame)


def by_netconvert(map_file: Path, frame: LocalFrame, work: Path, *options: str) -> LaneModel:
    """Return the lanes of netconvert's net, which it writes into the folder `work`.

    Raises UnavailableError where it is not installed.
    """
    net = work / f"{map_file.stem}.net.xml"
    origin = frame.origin
    place = f"+proj=tmerc +lat_0={origin.lat_deg!r} +lon_0={origin.lon_deg!r} +ellps=WGS84"
    command = [
        *netconvert_command(), "--osm-files", str(map_file), "-o", str(net),
        "--proj", place, "--offset.disable-normalization", *options,
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300.0)
    if done.returncode:
        raise RuntimeError(f"netconvert ended with {done.returncode}: {done.stderr[-500:]}")
    made = of_sumo(net)
    return replace(made, name="netconvert, recommended") if options else made
