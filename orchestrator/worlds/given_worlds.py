"""Worlds from a folder, corrected by hand say, that are used as they are instead of being built."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from foretwin.contracts.codec import read_given
from foretwin.contracts.errors import UserError
from foretwin.contracts.world import World
from foretwin.contracts.world_identity import with_id
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.osm.osm_map import OsmMap

_SAME_RADIUS_M = 0.5


def read_given_worlds(folder: Path) -> dict[str, World]:
    """Return the Worlds of a folder by their junctions' ids.

    Each gets the id of its content: one that was corrected is not the one it was. Raises
    FileNotFoundError, or UserError naming the file: unreadable, a region, or two of one junction.
    """
    if not folder.is_dir():
        raise FileNotFoundError(f"worlds {folder}: no such folder")
    found: dict[str, World] = {}
    files: dict[str, Path] = {}
    for file in sorted(folder.glob("*.world")):
        world = read_given(file, World)
        name = world.intersection.id
        if world.intersection.kind == "region":
            raise UserError(f"{file}: a World of a region; a drive uses those of junctions")
        if name in found:
            raise UserError(f"{file}: of junction {name}, as is {files[name]}: keep one of them")
        found[name], files[name] = with_id(world), file
    if not found:
        raise UserError(f"worlds {folder}: no .world file in it")
    return found


def check_given_worlds(
    folder: Path, osm: OsmMap, junctions: Iterable[Junction], *, radius_m: float
) -> None:
    """Raise UserError, one line, where a World of a folder is not of this map and these settings;
    and what `read_given_worlds` raises."""
    known = {junction.summary.id for junction in junctions}
    for name, world in read_given_worlds(folder).items():
        where = f"worlds {folder}: that of junction {name}"
        if world.map_sha256 != osm.sha256:
            raise UserError(
                f"{where} was made from another map ({world.map_sha256[:12]}) than the drive's "
                f"({osm.sha256[:12]})"
            )
        if name not in known:
            raise UserError(f"{where}: the drive's map has no such junction")
        if abs(world.radius_m - radius_m) > _SAME_RADIUS_M:
            raise UserError(f"{where} reaches {world.radius_m:g} m, the drive's {radius_m:g} m")
