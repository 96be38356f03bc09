"""Worlds of junctions drawn by a seed from every map, by content and as every export."""

from __future__ import annotations

import hashlib
import json
import random
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from tests.same_bits.comparison import Digests, Section
from tests.same_bits.sides import Line, Side, SideError, on_both

EXPORTS: dict[str, tuple[str, tuple[str, ...]]] = {
    "geojson": (".geojson", ("--format", "geojson")),
    "mjcf": (".xml", ("--format", "mjcf")),
    "sdf": (".sdf", ("--format", "sdf")),
    "sdf for gz-sim": (".sdf", ("--format", "sdf", "--simulator", "gazebo")),
    "opendrive": (".xodr", ("--format", "opendrive")),
    "opendrive 1.4": (".xodr", ("--format", "opendrive", "--opendrive-version", "1.4")),
    "lanelet2": (".osm", ("--format", "lanelet2")),
    "commonroad": (".xml", ("--format", "commonroad")),
    "svg": (".svg", ("--format", "svg")),
    "png": (".png", ("--format", "png")),
}
"""By name the suffix of its file, and what asks for it."""
LARGE_BYTES = 3_900_000
"""Larger maps take seconds to read, once for each export: one junction, and none in a quick run."""
_DAY_OF_TODAY = re.compile(rb'(<commonRoad [^>]*\bdate=")[0-9-]+(")')
_JUNCTION = ("id", "kind", "lat", "lon", "arms", "control", "driving_side", "osm_nodes")
_REGION_DEG = 0.002
_WATCHED = "build_world,build_region"


class Place(NamedTuple):
    """One World that is asked for: of which map, where, and under what name."""

    map_name: str
    name: str
    arguments: tuple[str, ...]


def compare_worlds(
    sides: tuple[Side, Side], *, data: Path | None, quick: bool, seed: int
) -> list[Section]:
    """Return junctions of all maps, and Worlds and exports of some of them, on both sides."""
    maps = [path for path in maps_of(data) if not quick or path.stat().st_size < LARGE_BYTES]
    found = on_both(sides, lambda side: junctions(side, maps))
    large = {path.name for path in maps if path.stat().st_size >= LARGE_BYTES}
    most = {name: 1 if quick or name in large else 4 for name in found[0]}
    places = draw_places(found[0], most=most, seed=seed)
    built = on_both(sides, lambda side: build(side, maps, places))
    return [
        Section("maps: junctions", *(_told_of(one) for one in found)),
        Section("worlds: ids and content", built[0][0], built[1][0]),
        Section("worlds: files of exports", built[0][1], built[1][1]),
    ]


def maps_of(data: Path | None) -> list[Path]:
    """Return the maps of FORETWIN_DATA; none without it."""
    return [] if data is None else sorted(data.glob("osm-*/*.osm*"))


def embedded_map(side: Side) -> Path:
    """Return the map of the drawn town that a tree brings."""
    found = [*side.root.glob("*/embedded/*.osm"), *side.root.glob("foretwin/*/embedded/*.osm")]
    if not found:
        raise SideError(f"{side.name}: no map in a folder `embedded`")
    return found[0]


def junctions(side: Side, maps: Sequence[Path]) -> dict[str, list[dict[str, object]]]:
    """Return by the name of its file what a side says of each map's junctions."""
    files = [embedded_map(side), *maps]
    _, screens = side.run_all(
        "intersections", [("intersections", str(file), "--json") for file in files]
    )
    return {file.name: json.loads(screen) for file, screen in zip(files, screens, strict=True)}


def draw_places(
    found: dict[str, list[dict[str, object]]], *, most: Mapping[str, int], seed: int
) -> list[Place]:
    """Return some junctions of each map, and around the first of the smallest maps a region."""
    places = []
    for map_name, listed in found.items():
        by_id = {str(junction["id"]): junction for junction in listed}
        # A generator for each map: one map more changes nothing about the others.
        draw = random.Random(f"{seed} {map_name}")
        chosen = draw.sample(sorted(by_id), min(most[map_name], len(by_id)))
        places += [Place(map_name, name, ("--id", name)) for name in chosen]
        if len(by_id) < 10 and chosen:
            lat, lon = (float(str(by_id[chosen[0]][axis])) for axis in ("lat", "lon"))
            corners = (lon - _REGION_DEG, lat - _REGION_DEG, lon + _REGION_DEG, lat + _REGION_DEG)
            bbox = ",".join(f"{degrees:.5f}" for degrees in corners)
            places.append(Place(map_name, "region", (f"--bbox={bbox}",)))
    return places


def build(side: Side, maps: Sequence[Path], places: Sequence[Place]) -> tuple[Digests, Digests]:
    """Return the digests of Worlds by content, and those of their exports' files."""
    file_of = {file.name: file for file in (embedded_map(side), *maps)}
    lines: list[Line] = []
    files: dict[str, dict[str, str]] = {}
    # Describing a World takes longer than building it: of one export alone.
    first, *others = EXPORTS
    for name, exports, watched in (("contents", [first], _WATCHED), ("exports", others, "")):
        asked = [(place, export) for place in places for export in exports]
        outs = [side.scratch / f"{name}-{number}" for number in range(len(asked))]
        commands = []
        for (place, export), out in zip(asked, outs, strict=True):
            out.mkdir()
            suffix, options = EXPORTS[export]
            commands.append(
                ("world", str(file_of[place.map_name]), *place.arguments, *options,
                 "--out", str(out / f"world{suffix}"))
            )  # fmt: skip
        lines += side.run_all(name, commands, watched=watched)[0]
        for (place, export), out in zip(asked, outs, strict=True):
            files[f"{place.map_name} {place.name} {export}"] = {
                path.name: file_digest(path) for path in sorted(out.iterdir())
            }
    return {line.key: line.parts for line in lines}, files


def file_digest(path: Path) -> str:
    """Return the digest of a file, but for the day on which CommonRoad says it was written."""
    return hashlib.sha256(_DAY_OF_TODAY.sub(rb"\1\2", path.read_bytes())).hexdigest()[:32]


def _told_of(found: dict[str, list[dict[str, object]]]) -> Digests:
    """Return by map and by what is said of junctions the digest of all that is said."""
    return {
        map_name: {
            name: hashlib.sha256(
                json.dumps([(j["id"], j.get(name)) for j in listed]).encode()
            ).hexdigest()[:32]
            for name in _JUNCTION
        }
        for map_name, listed in found.items()
    }
