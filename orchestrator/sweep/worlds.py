"""The Worlds of a sweep: chosen on a map and built, or read from a folder."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np

from foretwin.contracts.codec import SchemaMismatch
from foretwin.contracts.errors import UserError
from foretwin.contracts.world_identity import with_id
from foretwin.orchestrator.record.recorded_jobs import kept_world
from foretwin.orchestrator.sweep.play import Progress
from foretwin.orchestrator.sweep.spec import SweepSpec, worlds_folder
from foretwin.orchestrator.worlds.choice import junction_by_id, node_of_id, parse_bbox
from foretwin.orchestrator.worlds.heights import heights_for
from foretwin.orchestrator.worlds.opening import NodeClip, open_map
from foretwin.sim_worker.world_file import load_world
from foretwin.world_gen.elevation.read_dem import dem_digest
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.osm.osm_map import LatLonBounds
from foretwin.world_gen.world_store import WorldStore, cached_build

_Choice = TypeVar("_Choice")
SUFFIX = ".world"


class SweepWorlds(NamedTuple):
    """The ids of Worlds in order, and what could not be built, by junction."""

    ids: tuple[str, ...]
    failures: dict[str, str]


Building = Callable[[Path, Progress], SweepWorlds]
"""Puts chosen Worlds into a folder."""


def source_digest(spec: SweepSpec) -> str:
    """Return what the Worlds of a sweep come from, in short: of files their bytes.

    Raises FileNotFoundError where it is not there.
    """
    if spec.map is not None:
        path = Path(spec.map)
        if path.is_dir():
            raise UserError(f"map {path}: is a folder, not a file")
        if not path.is_file():
            raise FileNotFoundError(f"map {path}: no such file")
        return (
            _digest(path) if spec.dem is None else f"{_digest(path)} {dem_digest(Path(spec.dem))}"
        )
    folder = worlds_folder(spec)
    assert folder is not None
    return " ".join(_digest(path) for path in _files(folder))


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def all_there(folder: Path, world_ids: Iterable[str]) -> bool:
    """Return whether a folder holds Worlds; files of theirs that hold anything else are removed."""
    whole = True
    for world_id in world_ids:
        try:
            kept_world(folder, world_id)
        except (FileNotFoundError, SchemaMismatch, UserError):
            (folder / f"{world_id}{SUFFIX}").unlink(missing_ok=True)
            whole = False
    return whole


def choose_worlds(spec: SweepSpec) -> Building:
    """Return what builds the Worlds that a spec asks for into a folder, or copies them there.

    Nothing is written yet. Raises UserError for a junction that is not there, or where none is
    left.
    """
    there = worlds_folder(spec)
    if there is not None:
        return _choose_given(spec, there)
    assert spec.map is not None
    opened = open_map(Path(spec.map), clip=_clip(spec), service_roads=spec.service_roads)
    if spec.junctions == "all":
        found: Sequence[Junction] = opened.junctions
    else:
        found = [junction_by_id(opened, name) for name in dict.fromkeys(spec.junctions)]
    bounds = _bounds(spec)
    found = [j for j in found if bounds is None or _within(bounds, j.summary.lat, j.summary.lon)]
    chosen = _sampled(sorted(found, key=lambda j: j.summary.id), spec)
    if not chosen:
        where = "" if bounds is None else f" in bbox {spec.bbox}"
        raise UserError(f"{spec.map}: no junction{where}")

    dem = heights_for(opened, None if spec.dem is None else Path(spec.dem))

    def build(folder: Path, progress: Progress) -> SweepWorlds:
        index = index_map(opened.osm, opened.graph, opened.junctions, dem=dem)
        store = WorldStore(folder)
        ids, failures = [], {}
        with progress(len(chosen), "Worlds") as (advance, _):
            for junction in chosen:
                name = junction.summary.id
                try:
                    built = cached_build(store, index, junction, radius_m=spec.radius_m)
                    ids.append(built.world.id)
                except Exception as error:  # one bad junction never stops the rest
                    failures[name] = f"{type(error).__name__}: {' '.join(str(error).split())}"
                advance(name)
        return SweepWorlds(tuple(ids), failures)

    return build


def _clip(spec: SweepSpec) -> NodeClip | LatLonBounds | None:
    """Return what of a large map is needed."""
    if spec.junctions != "all" and len(spec.junctions) == 1:
        return NodeClip(node_of_id(spec.junctions[0]), spec.radius_m)
    return _bounds(spec)


def _bounds(spec: SweepSpec) -> LatLonBounds | None:
    return None if spec.bbox is None else parse_bbox("bbox", spec.bbox)


def _within(bounds: LatLonBounds, lat: float, lon: float) -> bool:
    return bounds.south <= lat <= bounds.north and bounds.west <= lon <= bounds.east


def _sampled(found: Sequence[_Choice], spec: SweepSpec) -> list[_Choice]:
    """Return so many of the sorted choices as the spec wants, in their order."""
    if spec.sample is None or spec.sample >= len(found):
        return list(found)
    rng = np.random.default_rng([spec.seed, 1])
    chosen = rng.choice(len(found), size=spec.sample, replace=False)
    return [found[index] for index in sorted(chosen.tolist())]


def _files(folder: Path) -> list[Path]:
    if not folder.is_dir():
        raise FileNotFoundError(f"worlds {folder}: no such folder")
    files = sorted(folder.glob(f"*{SUFFIX}"))
    if not files:
        raise FileNotFoundError(f"worlds {folder}: no {SUFFIX} file in it")
    return files


def _choose_given(spec: SweepSpec, folder: Path) -> Building:
    """Return what copies Worlds, each under the id of its content: one corrected is another one."""
    bounds = _bounds(spec)
    found: dict[tuple[str, str], Path] = {}
    for path in _files(folder):
        try:
            world = with_id(load_world(folder, path.stem))
        except SchemaMismatch as error:
            raise UserError(str(error)) from error
        summary = world.intersection
        inside = bounds is None or _within(bounds, summary.lat, summary.lon)
        if inside and (spec.junctions == "all" or summary.id in spec.junctions):
            found[summary.id, world.id] = path
    missing = set(() if spec.junctions == "all" else spec.junctions) - {name for name, _ in found}
    if missing:
        raise UserError(f"worlds {folder}: none of junction {sorted(missing)[0]}")
    if not found:
        raise UserError(f"worlds {folder}: no junction in bbox {spec.bbox}")
    chosen = _sampled(sorted(found), spec)

    def copy(target: Path, _: Progress) -> SweepWorlds:
        store = WorldStore(target)
        for one in chosen:
            store.save(with_id(load_world(folder, found[one].stem)))
        return SweepWorlds(tuple(world_id for _, world_id in chosen), {})

    return copy
