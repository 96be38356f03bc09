"""A sweep started again: what failed is tried again, what is lost or damaged is made anew."""

from __future__ import annotations

import errno
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pyarrow.parquet as pq
import pytest

from foretwin.contracts.runner import Answer, JobAnswer, Task
from foretwin.contracts.setup import WorkerSetup
from foretwin.orchestrator.commands.sweep import run_sweep
from foretwin.orchestrator.record.ledger import JobsLedger
from foretwin.orchestrator.sweep.spec import Loaded, load_spec
from foretwin.orchestrator.sweep.workers import worker_setup
from foretwin.world_gen.world_store import WorldStore
from tests.orchestrator.sweeps import SMALL, small_sweep
from tests.sim_worker.in_process_runner import InProcessRunner
from tests.sim_worker.scenarios.worlds import tee

COVERS = (
    "foretwin.orchestrator.sweep.folder",
    "foretwin.orchestrator.sweep.places",
    "foretwin.orchestrator.sweep.play",
)
SHORT = SMALL.replace("horizon_s = 5.0", "horizon_s = 1.0").replace("cases = 2", "cases = 1")
"""Here it does not matter what happens in the futures, which are played again and again."""


class Leaving(InProcessRunner):
    """Gives up tasks of one channel on one World or all, as where no worker answers in time."""

    def __init__(self, setup: WorkerSetup, channel: str = "", world_id: str = "") -> None:
        super().__init__(setup)
        self._channel, self._world_id = channel, world_id

    def take(self, timeout_s: float | None = 0.0) -> Answer | None:
        answer = super().take(timeout_s)
        if answer is None or answer.task.channel != self._channel:
            return answer
        if self._world_id not in ("", answer.task.world_id):
            return answer
        self.count.results -= 1
        self.count.lost += 1
        return Answer(answer.task, None, "no answer in 1 s")


def played(loaded: Loaded, out: Path, *left_out: str) -> dict[str, Any]:
    return run_sweep(loaded, out, Leaving(worker_setup(loaded, out), *left_out))


@pytest.fixture(scope="module")
def two_worlds(tmp_path_factory: pytest.TempPathFactory) -> tuple[Loaded, Path, dict[str, Any]]:
    """A small sweep over two Worlds, its folder, and what it came to."""
    folder = tmp_path_factory.mktemp("two")
    spec = small_sweep(folder, SHORT)
    WorldStore(folder / "drawn").save(tee())
    loaded = load_spec(spec)
    return loaded, folder / "out", played(loaded, folder / "out")


def flipped(part: Path) -> None:
    """Damage a part between its beginning and its footer."""
    data = bytearray(part.read_bytes())
    data[len(data) // 8 : len(data) // 4] = bytes(len(data) // 4 - len(data) // 8)
    part.write_bytes(data)


def without_a_column(part: Path) -> None:
    pq.write_table(pq.read_table(part).drop_columns(["metric_ttc"]), part)


def swapped(part: Path) -> None:
    """Put the part of another job in its place."""
    shutil.copyfile(part.with_name("job-000000.parquet"), part)


def cut(part: Path) -> None:
    part.write_bytes(part.read_bytes()[:-20])


@pytest.mark.parametrize("table", ["rows", "jobs", "road_users"])
@pytest.mark.parametrize("harm", [Path.unlink, cut, flipped, swapped])
def test_a_job_is_done_where_all_its_parts_are_there_and_its_own(
    two_worlds: tuple[Loaded, Path, dict[str, Any]], tmp_path: Path, table: str,
    harm: Callable[[Path], None],
) -> None:  # fmt: skip
    loaded, out, summary = two_worlds
    out = Path(shutil.copytree(out, tmp_path / "out"))
    part = out / table / "job-000002.parquet"
    before = part.read_bytes()
    harm(part)
    again = played(loaded, out)
    # Nobody is with the futures of a staged job: another's part says the same of it.
    assert again["jobs_played"] == (table != "road_users" or harm is not swapped)
    assert part.read_bytes() == before
    assert again["rows_sha256"] == summary["rows_sha256"]


def test_a_job_that_is_not_listed_is_played_again(
    two_worlds: tuple[Loaded, Path, dict[str, Any]], tmp_path: Path
) -> None:
    loaded, out, summary = two_worlds
    out = Path(shutil.copytree(out, tmp_path / "out"))
    cut(out / "manifest.jsonl")
    again = played(loaded, out)
    assert (again["jobs_played"], again["rows_sha256"]) == (1, summary["rows_sha256"])
    (out / "manifest.jsonl").unlink()
    again = played(loaded, out)
    assert (again["jobs_played"], again["rows_sha256"]) == (again["jobs"], summary["rows_sha256"])


class Garbage(InProcessRunner):
    """Gives something else than what a job comes to, at first or always."""

    always = False

    def __init__(self, setup: WorkerSetup) -> None:
        super().__init__(setup)
        self._given: set[str] = set()

    def take(self, timeout_s: float | None = 0.0) -> Answer | None:
        answer = super().take(timeout_s)
        if answer is None or answer.task.channel != "job":
            return answer
        if answer.task.key in self._given and not self.always:
            return answer
        self._given.add(answer.task.key)
        return self._garbage(answer)

    def _garbage(self, answer: Answer) -> Answer:
        cut = {name: data[:-9] for name, data in answer.message.part.tables.items()}
        part = msgspec.structs.replace(answer.message.part, tables=cut)
        return answer._replace(message=JobAnswer(part=part))


class NoMessages(Garbage):
    """Gives bytes at first that are no answer at all."""

    def _garbage(self, answer: Answer) -> Answer:
        return answer._replace(message=None, failure="Refused: job of w0: no", garbled=True)


def test_garbage_of_a_seat_is_told_and_played_again(
    two_worlds: tuple[Loaded, Path, dict[str, Any]], tmp_path: Path,
    capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    loaded, _, summary = two_worlds
    out = tmp_path / "out"
    again = run_sweep(loaded, out, Garbage(worker_setup(loaded, out)))
    assert (again["failed"], again["rows_sha256"]) == (0, summary["rows_sha256"])
    said = capsys.readouterr().err
    assert "job 0: worker w0 gave no part: no Parquet: " in said
    assert said.count("gave no part") == 1
    assert caplog.text.count("gave no part") == again["jobs"] - 1
    # Who gives nothing else costs the rows of these jobs, until the next start.
    monkeypatch.setattr(Garbage, "always", True)
    lost = run_sweep(loaded, tmp_path / "lost", Garbage(worker_setup(loaded, out)))
    assert lost["failed"] == lost["rows"] == summary["rows"]
    assert played(loaded, tmp_path / "lost")["rows_sha256"] == summary["rows_sha256"]


def test_bytes_that_are_no_answer_are_told_and_the_job_is_played_again(
    two_worlds: tuple[Loaded, Path, dict[str, Any]], tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    loaded, _, summary = two_worlds
    again = run_sweep(loaded, tmp_path / "out", NoMessages(worker_setup(loaded, tmp_path / "out")))
    assert (again["failed"], again["rows_sha256"]) == (0, summary["rows_sha256"])
    assert "job 0: worker w0 gave no part: Refused: job of w0: no" in capsys.readouterr().err


def test_a_full_disk_loses_nothing_that_is_done(
    two_worlds: tuple[Loaded, Path, dict[str, Any]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded, _, summary = two_worlds
    out, write_bytes = tmp_path / "out", Path.write_bytes
    monkeypatch.setattr(Path, "write_bytes", _filled_by(out / "rows" / "job-000003.parquet"))
    with pytest.raises(OSError, match="No space left"):
        played(loaded, out)
    monkeypatch.setattr(Path, "write_bytes", write_bytes)
    assert sorted(path.name for path in (out / "rows").iterdir()) == [
        f"job-{number:06d}.parquet" for number in range(3)
    ]
    again = played(loaded, out)
    assert again["jobs_played"] == again["jobs"] - 3
    assert again["rows_sha256"] == summary["rows_sha256"]


def _filled_by(part: Path) -> Callable[[Path, bytes], int]:
    """Return how a disk writes that is full when one part comes."""
    write_bytes = Path.write_bytes

    def write(path: Path, data: bytes) -> int:
        if path.name.startswith(part.name) and path.parent == part.parent:
            write_bytes(path, data[: len(data) // 2])
            raise OSError(errno.ENOSPC, "No space left on device", str(path))
        return write_bytes(path, data)

    return write


def test_rows_of_other_columns_are_played_again(
    two_worlds: tuple[Loaded, Path, dict[str, Any]], tmp_path: Path
) -> None:
    loaded, out, summary = two_worlds
    out = Path(shutil.copytree(out, tmp_path / "out"))
    without_a_column(out / "rows" / "job-000001.parquet")
    again = played(loaded, out)
    assert (again["jobs_played"], again["rows_sha256"]) == (1, summary["rows_sha256"])


@pytest.mark.parametrize("what", ["worlds/*.world", "vehicles/*.vehicle"])
@pytest.mark.parametrize("harm", [Path.unlink, cut])
def test_worlds_and_vehicles_that_are_lost_are_kept_again(
    two_worlds: tuple[Loaded, Path, dict[str, Any]], tmp_path: Path, what: str,
    harm: Callable[[Path], None],
) -> None:  # fmt: skip
    loaded, out, summary = two_worlds
    out = Path(shutil.copytree(out, tmp_path / "out"))
    lost = sorted(out.glob(what))[0]
    before = lost.read_bytes()
    harm(lost)
    again = played(loaded, out)
    assert (again["jobs_played"], again["rows_sha256"]) == (0, summary["rows_sha256"])
    assert lost.read_bytes() == before


@pytest.mark.parametrize("channel", ["place", "job"])
def test_what_was_given_up_is_tried_again(
    two_worlds: tuple[Loaded, Path, dict[str, Any]], tmp_path: Path, channel: str
) -> None:
    loaded, _, summary = two_worlds
    failed = played(loaded, tmp_path / "out", channel)
    assert failed["placed"] == 0
    assert len(failed["failures"]) == (2 if channel == "place" else 0)
    lost = 0 if channel == "place" else failed["jobs_played"]
    assert failed["ledger"]["jobs"] == JobsLedger(given=lost, results=0, refused=0, lost=lost)
    again = played(loaded, tmp_path / "out")
    assert (again["failed"], again["failures"]) == (0, {})
    count = again["jobs_played"]
    assert again["ledger"]["jobs"] == JobsLedger(given=count, results=count, refused=0, lost=0)
    assert again["rows_sha256"] == summary["rows_sha256"]
    assert played(loaded, tmp_path / "out")["jobs_played"] == 0


def test_what_was_placed_before_a_stop_is_not_asked_again(
    two_worlds: tuple[Loaded, Path, dict[str, Any]], tmp_path: Path
) -> None:
    loaded, whole, summary = two_worlds
    out = Path(shutil.copytree(whole, tmp_path / "out"))
    (out / "places.msgpack").unlink()
    kept, lost = sorted((out / "places").iterdir())
    harm = lost.read_bytes()
    cut(lost)
    asked: list[str] = []

    class Asked(InProcessRunner):
        def submit(self, task: Task) -> None:
            asked.append(task.key)
            super().submit(task)

    again = run_sweep(loaded, out, Asked(worker_setup(loaded, out)))
    assert asked == [f"places in {lost.stem}"] != [f"places in {kept.stem}"]
    assert (again["jobs_played"], again["rows_sha256"]) == (0, summary["rows_sha256"])
    assert lost.read_bytes() == harm


def test_places_found_later_come_to_the_rows_of_a_sweep_at_once(
    two_worlds: tuple[Loaded, Path, dict[str, Any]], tmp_path: Path
) -> None:
    loaded, whole, summary = two_worlds
    first = pq.read_table(whole / "rows" / "job-000000.parquet")["world_id"][0].as_py()
    early = played(loaded, tmp_path / "out", "place", first)
    assert 0 < early["jobs"] < summary["jobs"]
    again = played(loaded, tmp_path / "out")
    assert again["rows_sha256"] == summary["rows_sha256"]
    # A World that is not placed on any more leaves no rows behind.
    (tmp_path / "out" / "places" / f"{first}.places").unlink()
    again = played(loaded, tmp_path / "out", "place", first)
    assert again["rows_sha256"] == early["rows_sha256"]
    assert pq.read_table(tmp_path / "out" / "rows").num_rows == early["rows"]
