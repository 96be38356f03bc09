"""The Worlds of a sweep: chosen on a map and built, or read from a folder."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np

from foretwin.contracts.codec import SchemaMismatch
from foretwin.contracts.errors import UserError
from foretwin.orchestrator.sweep.spec import SweepSpec, worlds_folder
from foretwin.orchestrator.worlds.choice import junction_by_id, node_of_id, parse_bbox
from foretwin.orchestrator.worlds.opening import NodeClip, open_map
from foretwin.sim_worker.world_file import load_world
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.osm.osm_map import LatLonBounds
from foretwin.world_gen.world_store import WorldStore, cached_build

_Choice = TypeVar("_Choice")
SUFFIX = ".world"

Progress = Callable[[int, str], AbstractContextManager[tuple[Callable[[str], None], object]]]
"""Given how many there are of what; in it, what is called first names each that is done."""


class SweepWorlds(NamedTuple):
    """Where the Worlds lie, their ids in order, and what could not be built, by junction."""

    folder: Path
    ids: tuple[str, ...]
    failures: dict[str, str]


def source_digest(spec: SweepSpec) -> str:
    """Return what the Worlds of a sweep come from, in short: of a map its bytes.

    Raises FileNotFoundError where it is not there.
    """
    if spec.map is not None:
        path = Path(spec.map)
        if not path.is_file():
            raise FileNotFoundError(f"map {path}: no such file")
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    folder = worlds_folder(spec)
    assert folder is not None
    return " ".join(path.stem for path in _files(folder))


def sweep_worlds(spec: SweepSpec, folder: Path, progress: Progress) -> SweepWorlds:
    """Return the Worlds that a spec asks for; those of a map are built into `folder`.

    Raises UserError for a junction that is not there, or where none is left.
    """
    there = worlds_folder(spec)
    if there is not None:
        return _read(spec, there)
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
    index = index_map(opened.osm, opened.graph, opened.junctions)
    store = WorldStore(folder)
    ids, failures = [], {}
    with progress(len(chosen), "Worlds") as (advance, _):
        for junction in chosen:
            name = junction.summary.id
            try:
                ids.append(cached_build(store, index, junction, radius_m=spec.radius_m).world.id)
            except Exception as error:  # one bad junction never stops the rest
                failures[name] = f"{type(error).__name__}: {' '.join(str(error).split())}"
            advance(name)
    return SweepWorlds(folder, tuple(ids), failures)


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


def _read(spec: SweepSpec, folder: Path) -> SweepWorlds:
    bounds = _bounds(spec)
    found: list[tuple[str, str]] = []
    for path in _files(folder):
        try:
            summary = load_world(folder, path.stem).intersection
        except SchemaMismatch as error:
            raise UserError(f"{path}: {error}") from error
        inside = bounds is None or _within(bounds, summary.lat, summary.lon)
        if inside and (spec.junctions == "all" or summary.id in spec.junctions):
            found.append((summary.id, path.stem))
    missing = set(() if spec.junctions == "all" else spec.junctions) - {name for name, _ in found}
    if missing:
        raise UserError(f"worlds {folder}: none of junction {sorted(missing)[0]}")
    if not found:
        raise UserError(f"worlds {folder}: no junction in bbox {spec.bbox}")
    return SweepWorlds(folder, tuple(world for _, world in _sampled(sorted(found), spec)), {})
