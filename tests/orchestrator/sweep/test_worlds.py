"""The Worlds of a sweep: junctions of a map or files of a folder, chosen as the spec says."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.codec import write_message
from foretwin.contracts.errors import UserError
from foretwin.orchestrator.embedded import MAP_FILE
from foretwin.orchestrator.sweep.spec import SweepSpec
from foretwin.orchestrator.sweep.worlds import Progress, all_there, choose_worlds, source_digest
from foretwin.orchestrator.worlds.choice import choose_junctions
from foretwin.world_gen.world_store import WorldStore
from tests.sim_worker.scenarios.worlds import cross

TOWN = str(MAP_FILE)


def counting(seen: list[str]) -> Progress:
    """Progress that notes what is done."""
    return lambda total, what: nullcontext((seen.append, total))


def ids() -> list[str]:
    return [junction.summary.id for junction in choose_junctions(MAP_FILE).junctions]


def test_junctions_of_a_map_are_built_and_one_that_fails_stops_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    good, bad = ids()[:2]
    build = WorldStore.save

    def save(store: WorldStore, world: object) -> object:
        if world.intersection.id == bad:  # type: ignore[attr-defined]
            raise OSError("disk full")
        return build(store, world)  # type: ignore[arg-type]

    monkeypatch.setattr(WorldStore, "save", save)
    seen: list[str] = []
    spec = SweepSpec(map=TOWN, junctions=(good, bad), radius_m=60.0)
    found = choose_worlds(spec)(tmp_path, counting(seen))
    assert seen == sorted([good, bad])
    assert len(found.ids) == 1
    assert (tmp_path / f"{found.ids[0]}.world").is_file()
    assert found.failures == {bad: "OSError: disk full"}


def test_a_sample_is_drawn_by_the_seed(tmp_path: Path) -> None:
    def chosen(seed: int) -> list[str]:
        names: list[str] = []
        spec = SweepSpec(map=TOWN, sample=1, radius_m=60.0, seed=seed)
        choose_worlds(spec)(tmp_path, counting(names))
        return names

    assert chosen(3) == chosen(3)
    assert len(chosen(3)) == 1


def test_what_is_not_there_is_named(tmp_path: Path) -> None:
    for wrong, named in (
        ({"junctions": ("n999",)}, "no such intersection"),
        ({"bbox": "-30.0001,44.5,-30.0,44.5001"}, "no junction in bbox"),
    ):
        with pytest.raises(UserError, match=named):
            choose_worlds(SweepSpec(map=TOWN, **wrong))  # type: ignore[arg-type]
    WorldStore(tmp_path / "drawn").save(cross())
    spec = SweepSpec(worlds=str(tmp_path / "drawn"), junctions=("n999",))
    with pytest.raises(UserError, match="none of junction n999"):
        choose_worlds(spec)


def test_a_folder_is_no_map(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="is a folder, not a file"):
        source_digest(SweepSpec(map=str(tmp_path)))


def test_worlds_of_a_folder_are_copied_under_the_ids_of_their_content(tmp_path: Path) -> None:
    drawn, out = tmp_path / "drawn", tmp_path / "out"
    drawn.mkdir()
    write_message(cross(), drawn / "by_hand.world")
    spec = SweepSpec(worlds=str(drawn))
    assert choose_worlds(spec)(out, counting([])).ids == (cross().id,)
    assert [path.stem for path in out.iterdir()] == [cross().id]
    before = source_digest(spec)
    write_message(msgspec.structs.replace(cross(), stop_lines=()), drawn / "by_hand.world")
    assert source_digest(spec) != before
    assert choose_worlds(spec)(out, counting([])).ids != (cross().id,)


def test_a_world_that_is_lost_or_another_one_is_not_there(tmp_path: Path) -> None:
    file = WorldStore(tmp_path).save(cross())
    assert all_there(tmp_path, [cross().id])
    write_message(msgspec.structs.replace(cross(), stop_lines=()), file)
    assert not all_there(tmp_path, [cross().id])
    assert not file.exists()
    assert not all_there(tmp_path, [cross().id])
