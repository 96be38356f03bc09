"""The Worlds of a sweep: chosen on a map and built, or read from a folder."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from foretwin.contracts.codec import SchemaMismatch
from foretwin.contracts.errors import UserError, one_line
from foretwin.contracts.runner import Answer, Runner, answers, world_task
from foretwin.contracts.world import World
from foretwin.contracts.world_building import BuiltWorld, MapPart, WantedWorld
from foretwin.contracts.world_identity import checked_world, with_id
from foretwin.orchestrator.progress import Progress
from foretwin.orchestrator.record.recorded_jobs import kept_world
from foretwin.orchestrator.sweep.spec import SweepSpec, worlds_folder
from foretwin.orchestrator.worlds.choice import junction_by_id, node_of_id, parse_bbox
from foretwin.orchestrator.worlds.heights import heights_for
from foretwin.orchestrator.worlds.opening import open_map
from foretwin.sim_worker.world_file import load_world
from foretwin.world_gen.build import DEFAULT_RADIUS_M
from foretwin.world_gen.elevation.read_dem import dem_digest
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.opening import NodeClip
from foretwin.world_gen.osm.osm_map import LatLonBounds
from foretwin.world_gen.world_store import WorldStore

if TYPE_CHECKING:
    from foretwin.sim_worker.world_building import WorldBuilder

_Choice = TypeVar("_Choice")
SUFFIX = ".world"


class SweepWorlds(NamedTuple):
    """The ids of Worlds in order, and what could not be built, by junction."""

    ids: tuple[str, ...]
    failures: dict[str, str]


Building = Callable[[Path, Runner, Progress], SweepWorlds]
"""Has chosen Worlds built by a runner, into a folder."""


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

    # What does not fit is told before anything is written.
    heights_for(opened, None if spec.dem is None else Path(spec.dem))
    part = _part(spec, opened.osm.sha256)
    names = [junction.summary.id for junction in chosen]

    def build(folder: Path, runner: Runner, progress: Progress) -> SweepWorlds:
        return _built(part, names, _radius_m(spec), WorldStore(folder), runner, progress)

    return build


def _part(spec: SweepSpec, sha256: str) -> MapPart:
    """Return what of its map a sweep needs, for whoever builds the Worlds."""
    clip = _clip(spec)
    return MapPart(
        map=str(Path(str(spec.map)).resolve()),
        sha256=sha256,
        bounds=(clip.south, clip.west, clip.north, clip.east)
        if isinstance(clip, LatLonBounds)
        else None,
        node=clip.node if isinstance(clip, NodeClip) else None,
        margin_m=clip.margin_m if isinstance(clip, NodeClip) else 0.0,
        service_roads=spec.service_roads,
        dem=None if spec.dem is None else str(Path(spec.dem).resolve()),
    )


def _built(
    part: MapPart,
    names: Sequence[str],
    radius_m: float,
    store: WorldStore,
    runner: Runner,
    progress: Progress,
) -> SweepWorlds:
    """Have the Worlds of junctions built that are not there yet."""
    ids, failures = dict[str, str](), dict[str, str]()
    for name in names:
        if (known := store.find(part.sha256, name, radius_m)) is not None:
            ids[name] = known.id
    left = [name for name in names if name not in ids]
    wanted = {n: WantedWorld(of=part, junction_id=n, radius_m=radius_m) for n in left}
    worlds: dict[str, World] = {}

    def fault_in(answer: Answer) -> str:
        """Return why what came back is no World, "" where it is one or says why there is none."""
        if answer.garbled:
            return answer.failure
        built: BuiltWorld = answer.message
        try:
            if not built.failure:
                where = f"worker {answer.worker_id}"
                worlds[answer.task.world_id] = checked_world(
                    built.data, built.world_id, where=where
                )
        except SchemaMismatch as error:
            return str(error)
        return ""

    with progress(len(names), "Worlds") as (advance, _):
        for name in ids:
            advance(name)
        for answer in answers(runner, map(world_task, wanted.values()), fault_in=fault_in):
            name, failure = answer.task.world_id, answer.failure
            if answer.message is not None:
                failure = answer.message.failure
                if answer.message.no_map:
                    failure = _build_here(wanted[name], worlds)
                elif answer.message.of_input:
                    raise UserError(failure)
            try:
                if not failure:
                    store.remember(worlds[name], part.sha256)
                    ids[name] = worlds.pop(name).id
            except OSError as error:
                failure = one_line(error)
            if failure:
                failures[name] = failure
            advance(name)
    return SweepWorlds(tuple(ids[name] for name in names if name in ids), failures)


def _build_here(wanted: WantedWorld, worlds: dict[str, World]) -> str:
    """Build a World that a worker could not, since it has no map; returns why it failed, or ""."""
    built = _here().build(wanted)
    if built.of_input:
        raise UserError(built.failure)
    if not built.failure:
        worlds[wanted.junction_id] = checked_world(built.data, built.world_id, where="here")
    return built.failure


@functools.cache
def _here() -> WorldBuilder:
    """Return who builds where no worker has the map."""
    from foretwin.sim_worker.world_building import WorldBuilder

    return WorldBuilder()


def _radius_m(spec: SweepSpec) -> float:
    return DEFAULT_RADIUS_M if spec.radius_m is None else spec.radius_m


def _clip(spec: SweepSpec) -> NodeClip | LatLonBounds | None:
    """Return what of a large map is needed."""
    if spec.junctions != "all" and len(spec.junctions) == 1:
        return NodeClip(node_of_id(spec.junctions[0]), _radius_m(spec))
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

    def copy(target: Path, runner: Runner, progress: Progress) -> SweepWorlds:
        store = WorldStore(target)
        for one in chosen:
            store.save(with_id(load_world(folder, found[one].stem)))
        return SweepWorlds(tuple(world_id for _, world_id in chosen), {})

    return copy
