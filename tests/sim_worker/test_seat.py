"""A seat: a worker that is told everything with the question."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.codec import SchemaMismatch, content_bytes, encode
from foretwin.contracts.guard import opened
from foretwin.contracts.job_identity import job_bytes
from foretwin.contracts.runner import JobAnswer, job_task
from foretwin.contracts.setup import BusSetup, WorkerSetup
from foretwin.contracts.world_identity import with_id
from foretwin.sim_worker import seat as seats
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.future_mix import plan_futures
from foretwin.sim_worker.futures.result_digest import result_digest
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.seat import Seat, SeatAnswer, SeatQuestion, SeatSetup, answer_here, made_of
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.worker import FuturesWorker
from tests.sim_worker.places import box, crossroads, job
from tests.test_layout import ROOT

CAR = load_vehicle()
WORLD = with_id(crossroads())
TWO = msgspec.structs.replace(
    job(plan_futures(count=2, seed=0, planners=["pure_pursuit_idm"]), horizon_s=1.0),
    world_id=WORLD.id,
)
PLAYED = job_task(TWO, job_bytes(TWO))
QUESTION = SeatQuestion("job", WORLD.id, encode(PLAYED.question))
WORLD_FILE = encode(WORLD)
MADE_OF = made_of(["pure_pursuit_idm"])


def setup(*, limit_s: float = 60.0, **differing: str) -> SeatSetup:
    worker = WorkerSetup(
        run_id="r1", process_id="any", vehicle_id="car", bus=BusSetup(endpoint=""),
        log_file="", role="futures", worlds_dir="nowhere", vehicle=CAR,
    )  # fmt: skip
    return SeatSetup(worker=worker, made_of=MADE_OF | differing, limit_s=limit_s)


def played(answer: SeatAnswer) -> str:
    """The digest of what an answer holds."""
    assert (answer.refusal, answer.strange, answer.late) == ("", "", False)
    reply = opened(answer.data, JobAnswer, where="seat").message
    return result_digest(reply.result)


def test_a_job_comes_to_what_it_always_comes_to_with_a_world_that_came_as_bytes() -> None:
    answer = Seat(setup()).answer(QUESTION, WORLD_FILE)
    assert played(answer) == result_digest(run_job(TWO, BatchSimulation(WORLD, CAR, nsim=32)))


def test_a_world_that_is_compiled_is_not_asked_for_again() -> None:
    seat = Seat(setup())
    first = seat.answer(QUESTION, WORLD_FILE)
    assert played(seat.answer(QUESTION, None)) == played(first)


@pytest.mark.parametrize(
    ("world", "why"),
    [
        (None, f"FileNotFoundError: World {WORLD.id} did not come with the question"),
        (b"garbage", "SchemaMismatch: the World that came with the question: "),
        (
            encode(with_id(crossroads(buildings=(box(30.0, 30.0, 5.0, 5.0),)))),
            f"instead of {WORLD.id}",
        ),
    ],
)
def test_who_gets_no_or_another_world_says_so_and_logs_it(world: bytes | None, why: str) -> None:
    answer = Seat(setup()).answer(QUESTION, world)
    assert answer.data == b""
    assert why in answer.refusal
    (line,) = map(json.loads, answer.log)
    assert line["process"] == answer.seat
    assert "Traceback" in line["traceback"]


def test_a_question_that_is_none_is_refused() -> None:
    answer = Seat(setup()).answer(QUESTION._replace(data=b"\x00"), WORLD_FILE)
    assert answer.refusal.startswith("Refused: job: ")


def test_who_is_made_of_something_else_says_of_what_and_answers_nothing() -> None:
    differing = {"numpy": "1.0", "foretwin": "0.1.0 (abc)", "planner mine": "3 (def)"}
    answer = Seat(setup(**differing)).answer(QUESTION, WORLD_FILE)
    assert answer.data == b""
    _, told = answer.strange.split(" has ")
    assert told == (
        f"foretwin {MADE_OF['foretwin']} instead of 0.1.0 (abc), "
        f"numpy {MADE_OF['numpy']} instead of 1.0, planner mine missing instead of 3 (def)"
    )


def test_a_changed_file_makes_another_foretwin(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert set(MADE_OF) >= {"python", "mujoco", "numba", "arithmetic", "planner pure_pursuit_idm"}
    copied = tmp_path / "sim_worker" / "seat.py"
    for room in seats._DECIDING:
        shutil.copytree(ROOT / room, tmp_path / room, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(seats, "__file__", str(copied))
    assert made_of([])["foretwin"] == MADE_OF["foretwin"]
    copied.write_text(copied.read_text() + "# changed")
    assert made_of([])["foretwin"] != MADE_OF["foretwin"]


def test_too_late_is_told_whatever_code_takes_errors_for_its_own_and_the_seat_goes_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def never(self: FuturesWorker, channel: str, question: msgspec.Struct) -> msgspec.Struct:
        while True:
            try:
                time.sleep(60.0)
            except Exception:
                continue

    seat = Seat(setup(limit_s=0.2))
    with monkeypatch.context() as patched:
        patched.setattr(FuturesWorker, "answer", never)
        late = seat.answer(QUESTION, WORLD_FILE)
    assert (late.refusal, late.late, late.data) == ("no answer in 0.2 s", True, b"")
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    seat._setup = setup(limit_s=60.0)
    fresh = Seat(setup()).answer(QUESTION, WORLD_FILE)
    assert played(seat.answer(QUESTION, WORLD_FILE)) == played(fresh)


def test_who_hangs_in_a_library_is_ended() -> None:
    code = (
        "import re, signal, sys; from foretwin.sim_worker import seat; seat.HANGS_S = 0.2\n"
        "signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGALRM])\n"
        "with seat._within(0.1): re.match('(a*)*b', 'a' * 60)\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=60.0,
        check=False,
    )  # fmt: skip
    assert ended.returncode == 1
    assert "Timeout" in ended.stderr


def test_a_process_keeps_its_seat_as_long_as_the_run_is_the_same() -> None:
    one, other = (content_bytes(setup(limit_s=limit_s)) for limit_s in (60.0, 61.0))
    first = answer_here(one, QUESTION, WORLD_FILE)
    assert played(answer_here(one, QUESTION, None)) == played(first)
    assert "did not come" in answer_here(other, QUESTION, None).refusal
    assert len(seats._HERE) == 1


def test_a_setup_that_is_none_is_refused() -> None:
    with pytest.raises(SchemaMismatch, match="the setup of a seat"):
        answer_here(b"garbage", QUESTION, WORLD_FILE)


def test_a_seat_needs_no_file_of_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    played(Seat(setup()).answer(QUESTION, WORLD_FILE))
    assert list(tmp_path.iterdir()) == []
