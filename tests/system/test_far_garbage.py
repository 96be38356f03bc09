"""Workers on other machines that joined in order and then answer with rubbish, over TLS: each is
told of in one line and shown as sick, and others play what it was given."""

from __future__ import annotations

import contextlib
import json
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from foretwin.contracts.bus import Mailbox, Reply, Request
from foretwin.contracts.campaign import role_files
from foretwin.contracts.fleet import WorldQuestion, far_id
from foretwin.contracts.keys import key
from foretwin.contracts.ports import free_port
from foretwin.contracts.process import ProcessLife
from foretwin.contracts.redialled_bus import RedialledBus
from foretwin.contracts.setup import BusSetup, FarWorkerSetup
from foretwin.orchestrator.campaign.issuing import issue
from foretwin.orchestrator.drive.fleet_handler import PROBES
from foretwin.orchestrator.record.machine import this_machine
from foretwin.sim_worker.far.worker import serve_far
from tests.orchestrator.campaign.campaigns import campaign, now
from tests.system.foretwin_command import Finished, log_lines, run_folder, started, wait_for
from tests.system.rogue_drives import begun

COVERS = ("foretwin.sim_worker.far.__main__",)
JOBS = 4
# A round has five seconds, so that whoever is asked may answer on a busy machine as well.
CONFIG = f"futures = {2 * JOBS}\nfutures_per_job = 2\nrate_hz = 0.2\n"

NOBODYS = "0" * 16

Answer = Callable[[bytes | None, str], None]


class Rubbish(NamedTuple):
    """What a worker's answers become, given the right one and the first of all; what is said."""

    of: Callable[[bytes, bytes], bytes]
    said: str


RUBBISH = {
    "bytes": Rubbish(lambda data, first: b"\xc1 rubbish", "job"),
    "cut": Rubbish(lambda data, first: data[:-9], "job"),
    "empty": Rubbish(lambda data, first: b"", "job"),
    "stale": Rubbish(lambda data, first: first, "answer of no use: "),
}
ASKS_FOR_PATHS = "paths"
"""Who plays as it should, and asks for Worlds by what is no name of any."""


class SpoiltJobs(Mailbox):
    """Hands on questions whose answers are spoilt once the worker is let in."""

    def __init__(self, takes: Mailbox, spoil: Callable[[bytes, bytes], bytes]) -> None:
        super().__init__(1)
        self._takes, self._spoil = takes, spoil
        self._first: bytes | None = None
        self.asked = 0

    def put(self, item: object) -> None:
        """Take a question."""
        assert isinstance(item, Request)
        self.asked += 1
        answer, spoilt = item._answer, self.asked > PROBES

        def spoil(data: bytes | None, reason: str) -> None:
            if data is not None:
                self._first = self._first or data
                data = self._spoil(data, self._first) if spoilt else data
            answer(data, reason)

        self._takes.put(Request(item.channel, item.key, item._payload, spoil))


class RubbishBus(RedialledBus):
    """The bus of such a worker."""

    def __init__(self, setup: BusSetup, name: str) -> None:
        self._name = name
        self.jobs: SpoiltJobs | None = None
        super().__init__(setup)

    def serve(self, channel: str, mailbox: Mailbox, **ids: str) -> None:
        """Answer questions; see Bus."""
        if channel == "job":
            rubbish = RUBBISH.get(self._name)
            spoil = (lambda data, first: data) if rubbish is None else rubbish.of
            mailbox = self.jobs = SpoiltJobs(mailbox, spoil)
        super().serve(channel, mailbox, **ids)

    def ask_for_paths(self, run: str) -> list[str]:
        """Ask for Worlds that cannot be; returns what is said of it."""
        said, replies = [], Mailbox(1)
        for world_id in ("../../etc/passwd", "/etc/passwd", "", "*", NOBODYS):
            self.request("world_file", WorldQuestion(world_id=world_id), replies, run=run)
            reply = replies.take(30.0)
            assert isinstance(reply, Reply)
            assert reply.message is None
            said.append(str(reply.error))
        session = self._bus._session  # type: ignore[attr-defined]
        for data in (b"", b"\xc1 rubbish", bytes(100_000)):
            for answer in session.get(key("world_file", run=run), payload=data, timeout=30.0):
                assert answer.ok is None
                said.append(answer.err.payload.to_string())
        return said


class Far:
    """One such worker on a thread of this process; use it as a context."""

    def __init__(self, folder: Path, files: Path, endpoint: str, run: str, name: str) -> None:
        self.worker_id = far_id(name, 0)
        setup = FarWorkerSetup(
            run_id=run, process_id=self.worker_id, vehicle_id="far", machine=this_machine(),
            bus=BusSetup(endpoint=endpoint, tls=role_files(files, f"worker-{name}")),
            log_file=str(folder / f"{name}.jsonl"), cache_dir=str(folder / name),
        )  # fmt: skip
        (folder / name).mkdir()
        self.bus = RubbishBus(setup.bus, name)
        self._life = ProcessLife(setup, self.bus)
        self._thread = threading.Thread(target=serve_far, args=(setup, self.bus, self._life))

    def __enter__(self) -> Far:
        self._thread.start()
        return self

    def __exit__(self, *what: object) -> None:
        self._life.terminated.set()
        self._thread.join()
        self.bus.close()


@pytest.fixture
def far(tmp_path: Path) -> Iterator[Callable[[str, str, Path, str], Far]]:
    with contextlib.ExitStack() as stack:
        yield lambda name, endpoint, files, run: stack.enter_context(
            Far(tmp_path, files, endpoint, run, name)
        )


def told(run: Path) -> list[str]:
    """Return what the drive has told its engineer."""
    said = "orchestrator: "
    texts = [line["text"] for line in log_lines(run)]
    return [text.removeprefix(said) for text in texts if text.startswith(said)]


@pytest.mark.judge
@pytest.mark.timeout(580)
def test_rubbish_of_a_worker_that_joined_costs_the_drive_nothing(
    tmp_path: Path, far: Callable[[str, str, Path, str], Far]
) -> None:
    files, out = campaign(tmp_path / "campaign"), tmp_path / "runs"
    endpoint = f"tls/localhost:{free_port()}"
    for name in (*RUBBISH, ASKS_FOR_PATHS):
        issue(files, f"worker-{name}", days=2, now=now())
    (tmp_path / "drive.toml").write_text(CONFIG, encoding="utf-8")
    flags = ("--config", "drive.toml", "--endpoint", endpoint, "--secure", str(files))
    with started(out, *flags) as process:
        wait_for(lambda: begun(out), "the first World")
        run = run_folder(out)
        assert run is not None
        workers = {
            name: far(name, endpoint, files, run.name) for name in (*RUBBISH, ASKS_FOR_PATHS)
        }

        def is_sick(worker: Far) -> bool:
            return any(text.startswith(f"{worker.worker_id} is sick") for text in told(run))

        for name in RUBBISH:
            wait_for(lambda name=name: is_sick(workers[name]), name, within_s=200.0)  # type: ignore[misc]
        said = workers[ASKS_FOR_PATHS].bus.ask_for_paths(run.name)
        screen, _ = process.communicate(timeout=240.0)
    check(Finished(process.returncode, screen, run), workers, said)


def check(ended: Finished, workers: dict[str, Far], said: list[str]) -> None:
    assert ended.run is not None
    record, lines, rows = ended.record(), told(ended.run), ended.rows("futures")
    print(ended.screen, *lines, *said, json.dumps(record["workers"], indent=1), sep="\n")
    assert (ended.code, record["exit"]) == (0, "completed")
    assert record["dropped"]["given_up_rounds"] == 0
    assert record["futures"]["count"] == JOBS * 2 * record["futures"]["rounds"]
    refusals = record["workers"]["refusals"]
    assert refusals.keys() == {workers[name].worker_id for name in RUBBISH}
    played = {row["worker_id"] for row in rows}
    for name, rubbish in RUBBISH.items():
        worker = workers[name]
        (line,) = [text for text in lines if worker.worker_id in text and "plays along" not in text]
        assert line.startswith(f"{worker.worker_id} is sick, it refuses jobs: ")
        assert rubbish.said in line
        assert refusals[worker.worker_id]["sick"]
        assert worker.worker_id not in played
    assert played == {"w0", workers[ASKS_FOR_PATHS].worker_id}
    assert "Traceback" not in ended.screen
    assert len(said) == 8
    assert said[4] == f"World {NOBODYS}: No such file or directory"
    assert all("world_file: " in one for number, one in enumerate(said) if number != 4)
    assert sum(text.startswith("refused: ") for text in lines) == 2, "of each kind once"
