"""Worlds come by the hash of their content, are kept, and nobody uses damaged bytes."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.bus import Request
from foretwin.contracts.codec import SchemaMismatch, encode
from foretwin.contracts.fleet import WorldBytes
from foretwin.contracts.world_identity import with_id
from foretwin.sim_worker.far import worlds
from foretwin.sim_worker.far.worlds import CachedWorlds
from tests.contracts.memory_bus import MemoryBus
from tests.orchestrator.house import AtOnce
from tests.sim_worker.places import crossroads

WORLD = with_id(crossroads())


class Drive:
    """Gives Worlds to who asks; a test says what its bytes are."""

    def __init__(self, folder: Path) -> None:
        self.bus, self.folder = MemoryBus(), folder
        self.asked: list[str] = []
        self.told: list[str] = []
        self.data = encode(WORLD)
        self.bus.serve("world_file", AtOnce(self._answer), run="r1")  # type: ignore[arg-type]

    def _answer(self, request: Request) -> None:
        self.asked.append(request.message().world_id)
        request.reply(WorldBytes(data=self.data))

    def worlds(self) -> CachedWorlds:
        return CachedWorlds(self.folder, self.bus, run="r1", trouble=self.told.append)


@pytest.fixture
def drive(tmp_path: Path) -> Drive:
    return Drive(tmp_path)


def test_a_world_is_asked_for_once_and_then_lies_on_the_disk(drive: Drive) -> None:
    for _ in range(3):
        assert encode(drive.worlds().world(WORLD.id)) == encode(WORLD)
    assert drive.asked == [WORLD.id]
    assert [one.name for one in drive.folder.iterdir()] == [f"{WORLD.id}.world"]


@pytest.mark.parametrize("damage", [lambda data: data[:-9], lambda data: b"", lambda _: b"rubbish"])
def test_what_was_damaged_on_the_disk_is_fetched_again(
    drive: Drive, damage: Callable[[bytes], bytes]
) -> None:
    file = drive.folder / f"{WORLD.id}.world"
    file.write_bytes(damage(encode(WORLD)))
    assert drive.worlds().world(WORLD.id).id == WORLD.id
    assert file.read_bytes() == encode(WORLD)


@pytest.mark.parametrize(
    "data",
    [b"", b"rubbish", encode(WORLD)[:-5], encode(msgspec.structs.replace(WORLD, radius_m=1))],
)
def test_bytes_that_are_not_the_world_are_refused_and_not_kept(drive: Drive, data: bytes) -> None:
    drive.data = data
    with pytest.raises(SchemaMismatch, match=f"what the drive sent as World {WORLD.id}: "):
        drive.worlds().world(WORLD.id)
    assert list(drive.folder.iterdir()) == []


def test_a_drive_that_does_not_answer_is_named(tmp_path: Path) -> None:
    alone = CachedWorlds(tmp_path, MemoryBus(), run="r1", trouble=print)
    with pytest.raises(TimeoutError, match="run/r1/world_file: no answer"):
        alone.world(WORLD.id)


def test_on_a_full_disk_worlds_are_fetched_each_time_and_that_is_told_once(
    drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_bytes", full)
    kept = drive.worlds()
    for _ in range(3):
        assert kept.world(WORLD.id).id == WORLD.id
    assert len(drive.asked) == 3
    assert drive.told == [
        f"{drive.folder}: no space left on device; Worlds are fetched again each time"
    ]


def test_the_worlds_used_last_are_kept(drive: Drive, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worlds, "MOST_KEPT", 2)
    made = [with_id(msgspec.structs.replace(WORLD, radius_m=150.0 + n)) for n in range(3)]
    kept = drive.worlds()
    for number, world in enumerate(made):
        drive.data = encode(world)
        kept.world(world.id)
        os.utime(drive.folder / f"{world.id}.world", (number, number))
    kept.world(made[1].id)  # used: it becomes the newest
    drive.data = encode(WORLD)
    kept.world(WORLD.id)
    assert {one.stem for one in drive.folder.iterdir()} == {made[1].id, WORLD.id}
