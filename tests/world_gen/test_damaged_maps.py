"""Damaged maps: read or refused in one line by every reader of maps; never a traceback."""

from __future__ import annotations

import bz2
import gzip
import random
from pathlib import Path

import pytest

from foretwin.contracts.codec import SchemaMismatch, write_message
from foretwin.contracts.errors import UserError
from foretwin.contracts.world import World
from foretwin.world_gen.osm.map_file import MOST_UNPACKED_BYTES
from foretwin.world_gen.osm.map_store import MapStore
from foretwin.world_gen.osm.osm_map import MapError
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.world_store import WorldStore
from tests.damaged_files import read_damaged
from tests.orchestrator.trip import town_world
from tests.world_gen.map_files import EVERYWHERE, crossing, file_of
from tests.world_gen.test_bad_input import pbf_of

FEW, MANY, MANY_INDEXED = 160, 5_000, 300
"""An index is made by a process of its own, which takes a third of a second to come up."""


def map_of(path: Path) -> None:
    if path.suffix != ".world":
        read_map(path)


def index_of(path: Path) -> None:
    if path.suffix != ".world":
        store = MapStore.open(path, path.parent / "index")
        try:
            store.clip(EVERYWHERE)
        finally:
            store.close()


def world_of(path: Path) -> None:
    if path.suffix == ".world":
        try:
            WorldStore(path.parent).load(path.stem)
        except SchemaMismatch as refused:
            raise UserError(str(refused)) from None


READERS = (map_of, world_of)


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("whole")
    plain = file_of(folder, crossing())
    text = plain.read_bytes()
    packed = {
        "map.osm.gz": gzip.compress(text),
        "map.osm.bz2": bz2.compress(text),
        "map.osm.pbf": pbf_of(plain),
    }
    (folder / "map.osm.pbf").unlink()
    packed["loose.osm.pbf"] = pbf_of(plain, "pbf,pbf_compression=none")
    for name, data in packed.items():
        (folder / name).write_bytes(data)
    world: World = town_world("n4")
    write_message(world, folder / f"{world.id}.world")
    return [plain, *(folder / name for name in packed), folder / f"{world.id}.world"]


def test_the_whole_maps_are_read(originals: list[Path], tmp_path: Path) -> None:
    for path in originals:
        copy = tmp_path / path.name
        copy.write_bytes(path.read_bytes())
        for reader in (*READERS, index_of):
            reader(copy)


@pytest.mark.parametrize("pack", [gzip.compress, bz2.compress])
def test_a_map_that_unpacks_to_far_more_than_any_map_is_refused(
    tmp_path: Path, pack: object
) -> None:
    bomb = b'<osm version="0.6">' + b" " * (MOST_UNPACKED_BYTES + 2**20)
    path = file_of(tmp_path, pack(bomb), "map.osm.packed")  # type: ignore[operator]
    for reader in (map_of, index_of):
        with pytest.raises(MapError, match="no map is packed so"):
            reader(path)


def test_a_damaged_map_is_read_or_refused(originals: list[Path], tmp_path: Path) -> None:
    assert read_damaged(originals, READERS, folder=tmp_path, count=FEW, seed=1) == []


@pytest.mark.judge
@pytest.mark.timeout(3600)
def test_many_damaged_maps_are_read_or_refused(originals: list[Path], tmp_path: Path) -> None:
    seed = random.SystemRandom().randrange(2**32)
    print(f"seed {seed}")
    found = read_damaged(originals, READERS, folder=tmp_path, count=MANY, seed=seed)
    found += read_damaged(
        originals[:-1], (index_of,), folder=tmp_path, count=MANY_INDEXED, seed=seed + 1
    )

    assert found == [], f"seed {seed}"
