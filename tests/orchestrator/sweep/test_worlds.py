"""The Worlds of a sweep: junctions of a map or files of a folder, chosen as the spec says."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.codec import encode, write_message
from foretwin.contracts.errors import UserError
from foretwin.contracts.runner import Answer
from foretwin.contracts.setup import BusSetup, WorkerSetup
from foretwin.contracts.world_building import BuiltWorld
from foretwin.orchestrator.embedded import MAP_FILE
from foretwin.orchestrator.sweep.spec import SweepSpec
from foretwin.orchestrator.sweep.worlds import Progress, all_there, choose_worlds, source_digest
from foretwin.orchestrator.worlds.choice import choose_junctions
from foretwin.orchestrator.worlds.opening import open_map
from foretwin.sim_worker import world_building
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.world_store import WorldStore
from tests.sim_worker.in_process_runner import InProcessRunner
from tests.sim_worker.scenarios.worlds import cross

COVERS = ("foretwin.contracts.world_building", "foretwin.sim_worker.world_building")
TOWN = str(MAP_FILE)


def counting(seen: list[str]) -> Progress:
    """Progress that notes what is done."""
    return lambda total, what: nullcontext((seen.append, total))


SETUP = WorkerSetup(
    run_id="r1", process_id="w0", vehicle_id="car", bus=BusSetup(endpoint=""), log_file="",
    role="futures", worlds_dir="", vehicle=load_vehicle(),
)  # fmt: skip


def seat() -> InProcessRunner:
    """Who builds Worlds."""
    return InProcessRunner(SETUP)


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
    found = choose_worlds(spec)(tmp_path, seat(), counting(seen))
    assert seen == sorted([good, bad])
    assert len(found.ids) == 1
    assert (tmp_path / f"{found.ids[0]}.world").is_file()
    assert found.failures == {bad: "OSError: disk full"}


def test_a_junction_that_no_world_can_be_built_of_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object, **__: object) -> None:
        raise ValueError("no room")

    monkeypatch.setattr(world_building, "build_world", fails)
    spec = SweepSpec(map=TOWN, junctions=(ids()[0],), radius_m=60.0)
    found = choose_worlds(spec)(tmp_path, seat(), counting([]))
    assert found == ((), {ids()[0]: "ValueError: no room"})


def test_worlds_that_seats_build_are_those_of_a_builder_to_the_byte(tmp_path: Path) -> None:
    opened = open_map(MAP_FILE)
    index = index_map(opened.osm, opened.graph, opened.junctions)
    spec = SweepSpec(map=TOWN, radius_m=60.0)
    found = choose_worlds(spec)(tmp_path / "ours", seat(), counting([]))
    store = WorldStore(tmp_path / "theirs")
    for junction in opened.junctions:
        store.save(build_world(opened.osm, opened.graph, junction, radius_m=60.0, index=index))
    files = sorted((tmp_path / "theirs").iterdir())
    assert sorted(found.ids) == [file.stem for file in files]
    for file in files:
        assert (tmp_path / "ours" / file.name).read_bytes() == file.read_bytes()


class Odd(InProcessRunner):
    """A seat that answers the first questions with something else."""

    def __init__(self, *instead: BuiltWorld) -> None:
        super().__init__(SETUP)
        self.instead, self.asked = list(instead), 0

    def take(self, timeout_s: float | None = 0.0) -> Answer | None:
        answer = super().take(timeout_s)
        if answer is None:
            return None
        self.asked += 1
        return answer._replace(message=self.instead.pop(0)) if self.instead else answer


def test_what_is_no_world_is_asked_for_again(tmp_path: Path) -> None:
    spec = SweepSpec(map=TOWN, junctions=(ids()[0],), radius_m=60.0)
    true = choose_worlds(spec)(tmp_path / "true", seat(), counting([]))
    odd = Odd(
        BuiltWorld(world_id="0" * 16, data=b"garbage"),
        BuiltWorld(world_id="0" * 16, data=encode(cross())),
    )
    assert choose_worlds(spec)(tmp_path / "odd", odd, counting([])) == true
    assert odd.asked == 3
    never = Odd(*3 * [BuiltWorld(world_id="0" * 16, data=b"garbage")])
    found = choose_worlds(spec)(tmp_path / "never", never, counting([]))
    assert found.failures == {ids()[0]: "worker w0: not a foretwin message (7 bytes)"}


def test_where_no_seat_has_the_map_they_are_built_here(tmp_path: Path) -> None:
    spec = SweepSpec(map=TOWN, junctions=(ids()[0],), radius_m=60.0)
    true = choose_worlds(spec)(tmp_path / "true", seat(), counting([]))
    nowhere = Odd(BuiltWorld(failure="map town: no such file here", no_map=True))
    assert choose_worlds(spec)(tmp_path / "here", nowhere, counting([])) == true
    other = BuiltWorld(failure="map town: is another one than as the sweep began", of_input=True)
    with pytest.raises(UserError, match="is another one than as the sweep began"):
        choose_worlds(spec)(tmp_path / "other", Odd(other), counting([]))


def test_another_map_of_that_name_is_refused(tmp_path: Path) -> None:
    town = tmp_path / "town.osm"
    town.write_bytes(MAP_FILE.read_bytes())
    build = choose_worlds(SweepSpec(map=str(town), junctions=(ids()[0],), radius_m=60.0))
    town.write_bytes(MAP_FILE.read_bytes() + b"\n")
    with pytest.raises(UserError, match=r"town\.osm: is another one than as the sweep began"):
        build(tmp_path / "out", seat(), counting([]))


def test_worlds_that_are_there_are_not_built_again(tmp_path: Path) -> None:
    spec = SweepSpec(map=TOWN, junctions=tuple(ids()[:2]), radius_m=60.0)
    found = choose_worlds(spec)(tmp_path, seat(), counting([]))
    again = Odd()
    assert choose_worlds(spec)(tmp_path, again, counting([])) == found
    assert again.asked == 0


def test_a_sample_is_drawn_by_the_seed(tmp_path: Path) -> None:
    def chosen(seed: int) -> list[str]:
        names: list[str] = []
        spec = SweepSpec(map=TOWN, sample=1, radius_m=60.0, seed=seed)
        choose_worlds(spec)(tmp_path, seat(), counting(names))
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
    assert choose_worlds(spec)(out, seat(), counting([])).ids == (cross().id,)
    assert [path.stem for path in out.iterdir()] == [cross().id]
    before = source_digest(spec)
    write_message(msgspec.structs.replace(cross(), stop_lines=()), drawn / "by_hand.world")
    assert source_digest(spec) != before
    assert choose_worlds(spec)(out, seat(), counting([])).ids != (cross().id,)


def test_a_world_that_is_lost_or_another_one_is_not_there(tmp_path: Path) -> None:
    file = WorldStore(tmp_path).save(cross())
    assert all_there(tmp_path, [cross().id])
    write_message(msgspec.structs.replace(cross(), stop_lines=()), file)
    assert not all_there(tmp_path, [cross().id])
    assert not file.exists()
    assert not all_there(tmp_path, [cross().id])
