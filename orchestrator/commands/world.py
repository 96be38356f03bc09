"""The command `world`: checks what is asked for, builds the Worlds, writes them."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from foretwin.contracts.did_you_mean import one_of
from foretwin.contracts.errors import UserError
from foretwin.contracts.new_folder import trouble_with_folder
from foretwin.contracts.world import World
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.commands.world_files import kind_lines, write_each, write_report
from foretwin.orchestrator.config import MAX_RADIUS_M, MIN_RADIUS_M
from foretwin.orchestrator.worlds.choice import choose_junctions, parse_bbox
from foretwin.orchestrator.worlds.heights import heights_for
from foretwin.orchestrator.worlds.opening import open_map
from foretwin.orchestrator.worlds.track_store import tracks_for
from foretwin.world_gen.build import DEFAULT_RADIUS_M, build_region, build_world
from foretwin.world_gen.export.choices import (
    LANELET2_DIALECTS,
    OPENDRIVE_VERSIONS,
    SIMULATORS,
    VEHICLE_KINDS,
    VehicleKind,
)
from foretwin.world_gen.export.formats import (
    DEFAULT_FORMAT,
    FORMATS,
    ExportOptions,
    Format,
    formats_by_suffix,
)
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.junctions.map_index import MapIndex, index_map
from foretwin.world_gen.opening import OpenMap, region_on_map
from foretwin.world_gen.osm.osm_map import LatLonBounds

DEFAULT_VEHICLES = "twin:twin,shadow:shadow,ghost:ghost"
_Word = TypeVar("_Word", bound=str)


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldRequest:
    """What was asked for on the command line, as it was typed."""

    map_file: Path
    out: Path
    at: str | None = None
    junction_id: str | None = None
    bbox: str | None = None
    route: Path | None = None
    everything: bool = False
    service_roads: bool = False
    dem: Path | None = None
    tracks: str | None = None
    file_format: str | None = None
    """None goes by the suffix of `out`."""
    radius_m: float | None = None
    opendrive_version: str | None = None
    lanelet2_dialect: str | None = None
    simulator: str | None = None
    vehicles: str | None = None
    vehicle: Path | None = None
    report: bool = False


def write_worlds(request: WorldRequest) -> CommandResult:
    """Build and write what is asked for; its code is 0, or 3 where some of many Worlds failed.

    Raises UserError, in one line, for anything that cannot be meant.
    """
    _check_place(request)
    many = request.everything or request.route is not None
    _check_out(request.out, many=many)
    if (
        request.out.exists()
        and request.map_file.exists()
        and request.out.samefile(request.map_file)
    ):
        raise UserError(f"--out {request.out}: is the map itself; name another file")
    format_ = _format(request.file_format, None if many else request.out)
    options = _options(request, format_)
    if request.bbox is not None:
        return _region(request, parse_bbox("--bbox", request.bbox), format_, options)
    radius_m = DEFAULT_RADIUS_M if request.radius_m is None else request.radius_m
    opened, junctions = choose_junctions(
        request.map_file,
        at=request.at,
        junction_id=request.junction_id,
        route=request.route,
        radius_m=radius_m,
        service_roads=request.service_roads,
    )
    if many and not junctions:
        where = "in this map" if request.route is None else f"along {request.route}"
        raise UserError(f"{opened.file}: no intersection {where}")
    index = _index(opened, request)

    def built(junction: Junction) -> World:
        return build_world(opened.osm, opened.graph, junction, radius_m=radius_m, index=index)

    if not many:
        return _write_one(built(junctions[0]), request, format_, options)
    return write_each(
        # A junction that is passed twice is written once.
        tuple({junction.summary.id: junction for junction in junctions}.values()),
        built,
        lambda world, path: format_.write(world, path, options),
        folder=request.out,
        suffix=format_.suffix,
        report=request.report,
        attribution=opened.osm.attribution,
    )


def _region(
    request: WorldRequest, bounds: LatLonBounds, format_: Format, options: ExportOptions
) -> CommandResult:
    opened = open_map(request.map_file, clip=bounds, service_roads=request.service_roads)
    part = region_on_map(opened.file, opened.osm.bounds, bounds)
    world = build_region(opened.osm, opened.graph, part, index=_index(opened, request))
    return _write_one(world, request, format_, options)


def _write_one(
    world: World, request: WorldRequest, format_: Format, options: ExportOptions
) -> CommandResult:
    from foretwin.world_gen.report.report import note_counts

    format_.write(world, request.out, options)
    s = world.intersection
    place = s.kind if s.kind == "region" else f"{s.kind} {s.name or s.id} ({s.id})"
    kinds = Counter({note.kind: note.count for note in note_counts(world.notes)})
    counts = {"lanes": len(world.lanes), "buildings": len(world.buildings), "notes": kinds.total()}
    text = ", ".join(f"{n} {name if n != 1 else name[:-1]}" for name, n in counts.items())
    words = f"{request.out}: {place}, {text}. {world.attribution}"
    body: dict[str, object] = {
        "file": request.out,
        "kind": s.kind,
        "id": s.id,
        "name": s.name,
        **counts,
        "attribution": world.attribution,
    }
    if request.report:
        from foretwin.world_gen.report.text import as_text

        report = write_report(world, request.out)
        body["report"] = report
        words += f"\n{as_text(report).rstrip()}"
    else:
        words = "\n".join([words, *kind_lines(kinds)])
    return CommandResult(body, words)


def _index(opened: OpenMap, request: WorldRequest) -> MapIndex:
    dem = heights_for(opened, request.dem)
    tracks = tracks_for(opened.osm.bounds, request.tracks)
    return index_map(opened.osm, opened.graph, opened.junctions, dem=dem, tracks=tracks)


def _check_place(request: WorldRequest) -> None:
    places = {
        "--at": request.at,
        "--id": request.junction_id,
        "--bbox": request.bbox,
        "--route": request.route,
        "--all": request.everything or None,
    }
    chosen = [name for name, given in places.items() if given is not None]
    if len(chosen) != 1:
        raise UserError(
            "name the place by exactly one of --at LAT,LON, --id ID, --bbox W,S,E,N, "
            f"--route FILE or --all; got {' and '.join(chosen) or 'none'}"
        )
    if request.radius_m is not None:
        told = f"--radius {request.radius_m:g}"
        if request.bbox is not None:
            raise UserError(f"{told}: goes with junctions, and not with --bbox")
        if not MIN_RADIUS_M <= request.radius_m <= MAX_RADIUS_M:
            raise UserError(f"{told}: {MIN_RADIUS_M:.0f} to {MAX_RADIUS_M:.0f} metres")


def _format(name: str | None, file: Path | None) -> Format:
    """Return the format that was named or that the file's suffix says; in a folder, the default."""
    if name is not None and name not in FORMATS:
        raise UserError(f"--format {name}: {one_of(name, FORMATS)}")
    if file is None:
        return FORMATS[name or DEFAULT_FORMAT]
    said = formats_by_suffix(file.suffix)
    if name is None and not said:
        known = ", ".join(dict.fromkeys(format_.suffix for format_ in FORMATS.values()))
        raise UserError(f"--out {file}: ends in none of {known}; --format says what to write")
    format_ = FORMATS[name or said[0]]
    if (said or format_.decided_by_suffix) and format_.name not in said:
        raise UserError(f"--out {file}: a file of --format {name} ends in {format_.suffix}")
    return format_


def _options(request: WorldRequest, format_: Format) -> ExportOptions:
    given = {
        "--opendrive-version": (request.opendrive_version, "opendrive"),
        "--lanelet2-dialect": (request.lanelet2_dialect, "lanelet2"),
        "--simulator": (request.simulator, "sdf"),
        "--vehicles": (request.vehicles, "sdf"),
        "--vehicle": (request.vehicle, "sdf"),
    }
    for option, (value, only) in given.items():
        if value is not None and format_.name != only:
            raise UserError(
                f"{option} {value}: goes with the format {only} alone; {request.out} is written "
                f"as {format_.name}"
            )
    version = _one_of("--opendrive-version", request.opendrive_version, OPENDRIVE_VERSIONS)
    simulator = _one_of("--simulator", request.simulator, SIMULATORS)
    vehicles = _vehicles(DEFAULT_VEHICLES if request.vehicles is None else request.vehicles)
    if format_.name != "sdf":
        if request.lanelet2_dialect is None:
            return ExportOptions(opendrive_version=version)
        dialect = _one_of("--lanelet2-dialect", request.lanelet2_dialect, LANELET2_DIALECTS)
        return ExportOptions(lanelet2_dialect=dialect)
    if not vehicles:
        if request.vehicle is not None:
            raise UserError(f"--vehicle {request.vehicle}: there is none, by --vehicles none")
        return ExportOptions(simulator=simulator)
    from foretwin.sim_worker.vehicle.parameters import load_vehicle

    return ExportOptions(
        simulator=simulator, vehicles=vehicles, vehicle=load_vehicle(request.vehicle)
    )


def _one_of(option: str, word: str | None, choices: tuple[_Word, ...]) -> _Word:
    """Return the choice that was named, the first where none was."""
    for choice in choices:
        if word in (None, choice):
            return choice
    raise UserError(f"{option} {word}: {one_of(word, choices)}")


def _vehicles(text: str) -> tuple[tuple[str, VehicleKind], ...]:
    """Return (name, kind) pairs of NAME:KIND,… or none."""
    if text == "none":
        return ()
    pairs = []
    for part in text.split(","):
        name, _, word = part.partition(":")
        kind = next((kind for kind in VEHICLE_KINDS if kind == word), None)
        if kind is None or not name.isidentifier():
            raise UserError(
                f"--vehicles {text}: none, or NAME:KIND,… with KIND one of "
                f"{', '.join(VEHICLE_KINDS)}"
            )
        pairs.append((name, kind))
    if len({name for name, _ in pairs}) < len(pairs):
        raise UserError(f"--vehicles {text}: each vehicle needs a name of its own")
    return tuple(pairs)


def _check_out(out: Path, *, many: bool) -> None:
    if many:
        if out.exists() and not out.is_dir():
            raise UserError(f"--out {out}: is a file; --all and --route write into a folder")
        if not out.exists() and formats_by_suffix(out.suffix):
            raise UserError(
                f"--out {out}: is named as a file; --all and --route write into a folder, in the "
                "format that --format names"
            )
        if (trouble := trouble_with_folder(out)) is not None:
            raise UserError(f"--out {out}: {trouble}")
        return
    if out.is_dir():
        raise UserError(f"--out {out}: is a folder; name the file to write")
    if not out.parent.is_dir():
        raise UserError(f"--out {out}: folder {out.parent} does not exist")
    if (trouble := trouble_with_folder(out.parent)) is not None:
        raise UserError(f"--out {out}: {trouble}")
