"""Worlds that are given instead of built: read by their junctions, or refused in one line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.errors import UserError
from foretwin.contracts.world import World
from foretwin.contracts.world_identity import with_id
from foretwin.orchestrator.config import DriveConfig
from foretwin.orchestrator.drive.plan import read_inputs
from foretwin.orchestrator.worlds.given_worlds import check_given_worlds, read_given_worlds
from foretwin.world_gen.world_store import WorldStore
from tests.orchestrator.trip import town, town_plan, town_world
from tests.orchestrator.worlds.asked_builder import built


def saved(folder: Path, *worlds: World) -> Path:
    store = WorldStore(folder / "given")
    for world in worlds:
        store.save(world)
    return store.folder


def corrected(world: World) -> World:
    """As it is after somebody has changed it, and left the id as it was."""
    return msgspec.structs.replace(world, buildings=())


def check(folder: Path, *, radius_m: float = 150.0) -> None:
    inputs = town()
    check_given_worlds(folder, inputs.osm, inputs.junctions, radius_m=radius_m)


def test_a_corrected_world_is_read_under_the_id_of_what_is_in_it(tmp_path: Path) -> None:
    world = town_world("n4")
    folder = saved(tmp_path, corrected(world))
    (found,) = read_given_worlds(folder).values()
    assert found.id == with_id(corrected(world)).id
    assert found.id != world.id
    check(folder)


def other_map(world: World) -> World:
    return msgspec.structs.replace(world, map_sha256="0" * 64)


def other_junction(world: World) -> World:
    return msgspec.structs.replace(
        world, intersection=msgspec.structs.replace(world.intersection, id="n99")
    )


def region(world: World) -> World:
    return msgspec.structs.replace(
        world, intersection=msgspec.structs.replace(world.intersection, kind="region")
    )


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (other_map, "that of junction n4 was made from another map (000000000000)"),
        (other_junction, "that of junction n99: the drive's map has no such junction"),
        (region, "a World of a region; a drive uses those of junctions"),
    ],
    ids=["other map", "other junction", "region"],
)
def test_a_world_of_elsewhere_is_told_in_one_line(
    tmp_path: Path, change: Callable[[World], World], said: str
) -> None:
    with pytest.raises(UserError) as refused:
        check(saved(tmp_path, change(town_world("n4"))))
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_world_of_another_radius_or_two_of_one_junction_are_told(tmp_path: Path) -> None:
    world = town_world("n4")
    folder = saved(tmp_path, world)
    with pytest.raises(UserError, match="n4 reaches 150 m, the drive's 100 m"):
        check(folder, radius_m=100.0)
    saved(tmp_path, with_id(corrected(world)))
    with pytest.raises(UserError, match=r"of junction n4, as is .*\.world: keep one of them"):
        check(folder)


def test_a_folder_without_worlds_or_with_a_broken_one_is_told(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere: no such folder"):
        read_given_worlds(tmp_path / "nowhere")
    with pytest.raises(UserError, match=r"no \.world file in it"):
        read_given_worlds(tmp_path)
    (tmp_path / "x.world").write_bytes(b"not one")
    with pytest.raises(UserError, match=r"x\.world: not a foretwin message"):
        read_given_worlds(tmp_path)


def test_a_drive_refuses_them_before_anything_begins(tmp_path: Path) -> None:
    config = DriveConfig(worlds=str(tmp_path / "nowhere"), out=str(tmp_path / "runs"))
    with pytest.raises(FileNotFoundError, match="nowhere: no such folder"):
        read_inputs(config.validate())
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize("junction_id", ["n4", "n11"])
def test_the_builder_gives_out_what_was_given_and_builds_the_rest(
    tmp_path: Path, junction_id: str
) -> None:
    given = corrected(town_world("n4"))
    plan = town_plan(tmp_path)
    config = msgspec.structs.replace(
        plan.config, worlds=str(saved(tmp_path, given)), cache_dir=str(tmp_path / "cache")
    )
    plan = replace(plan, config=config)
    used = built(plan, junction_id)
    assert (used.id == with_id(given).id) == (junction_id == "n4")
    assert bool(used.buildings) == (junction_id != "n4")
