"""A second engine plays beside the rounds, within its share, and nobody waits for it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pyarrow.parquet as pq
import pytest

from foretwin.contracts.futures import FuturesResult
from foretwin.contracts.siblings import Siblings
from foretwin.orchestrator.rounds import siblings as under_test
from foretwin.orchestrator.rounds.siblings import SIBLING
from tests.orchestrator.drive.test_tuning_link import answer, asked, set_mass
from tests.orchestrator.house import House, Worker

TOOK_S = 0.3


class SiblingHouse(House):
    """A house with a second engine, whose cars are so many metres to the side at the end, and a
    clock that stands unless a test moves it."""

    def __init__(self, folder: Path, patch: pytest.MonkeyPatch, *, share: float = 1.0) -> None:
        chosen = Siblings(engine="multibody", share=share)
        # A round of a busy machine would be late, and have no siblings.
        super().__init__(folder, siblings=chosen, rate_hz=0.01)
        self.aside_m, self.hits = 0.0, False
        self.second = self.begin()
        self.now_s = 1000.0
        patch.setattr(under_test.time, "monotonic", lambda: self.now_s)
        self.siblings = self.conductor.rounds.siblings
        self.bus.subscribe("sibling", self.seen, run=self.plan.run_id)

    def begin(self) -> Worker:
        second = Worker(self.plan, self.bus, SIBLING)
        second.spoil = self.aside
        self.settle()
        return second

    def aside(self, result: FuturesResult) -> FuturesResult:
        moved = result.trajectory.states.copy()
        moved[:, :, 1] += np.linspace(0.0, self.aside_m, moved.shape[1], dtype=np.float32)
        trajectory = msgspec.structs.replace(result.trajectory, states=moved)
        hit = np.full(len(moved), self.hits)
        outcome = msgspec.structs.replace(result.outcome, collided=hit)
        return msgspec.structs.replace(result, trajectory=trajectory, outcome=outcome)

    def round(self) -> None:
        assert self.conductor.start_round()
        self.work()

    def answer(self) -> None:
        """Let the second engine answer, which took 0.3 s of a core."""
        self.second.cpu_s += TOOK_S
        self.second.answer()
        self.settle()

    def rows(self, name: str) -> list[dict[str, Any]]:
        rows: list[dict[str, Any]] = pq.read_table(
            self.plan.folder / "results" / f"{name}.parquet"
        ).to_pylist()
        return rows


@pytest.fixture
def house(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SiblingHouse:
    made = SiblingHouse(tmp_path, monkeypatch)
    made.drive(20)
    return made


def test_nominal_and_worst_future_are_played_a_second_time(house: SiblingHouse) -> None:
    house.aside_m = 1.0
    house.round()
    (question,) = house.second.take()
    job = question.message().decoded()
    assert job.engine == "multibody"
    assert job.futures[0].index == 0
    assert 1 <= len(job.futures) <= 2
    assert (job.metrics, job.accidents) == ((), False), "they cost, and change no motion"
    assert {one.id for one in job.scenarios} == {one.scenario_id for one in job.futures} - {""}
    house.second.answer_one(question)
    house.settle()
    (shown, *_) = house.watched("sibling")
    house.end()
    rows = house.rows("siblings")
    assert [row["which"] for row in rows] == ["nominal", "worst"][: len(rows)]
    assert rows[0]["future_id"] == house.rows("futures")[0]["future_id"] == shown.future_id
    apart = [rows[0][f"apart_{after}_s_m"] for after in (1, 2, 4)]
    assert apart == pytest.approx([0.125, 0.25, 0.5], abs=1e-3)
    assert {row["engine"] for row in house.rows("jobs")} == {"mujoco"}


@pytest.mark.parametrize(
    ("criticality", "lost", "asked"),
    [
        ([0.1, 0.2, 0.3, 0.9, 0.4, 0.5], 3, [0, 5]),
        ([0.1, 0.2, 0.3, 0.9, 0.4, 0.5], 1, [0, 3]),
        ([0.9, 0.2, 0.3, 0.8, 0.4, 0.5], 1, [0]),
        ([0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1, [0]),
        ([0.1, np.nan, 0.3, 0.9, 0.4, 0.5], 3, [0, 5]),
    ],
)
def test_the_worst_is_the_most_critical_that_is_whole(
    house: SiblingHouse,
    monkeypatch: pytest.MonkeyPatch,
    criticality: list[float],
    lost: int,
    asked: list[int],
) -> None:
    taken: list[Any] = []
    with monkeypatch.context() as patched:
        patched.setattr(house.siblings, "take_round", lambda *round_: taken.append(round_))
        house.round()
    ((done, futures, rows),) = taken
    valid = np.arange(6) != lost
    other = futures._replace(criticality=np.array(criticality), valid=valid)
    house.siblings.take_round(done, other, rows)
    (question,) = house.second.take()
    assert [one.index for one in question.message().decoded().futures] == asked
    (kept,) = house.siblings._asked.values()
    assert kept.future_ids == tuple(rows[place]["future_id"] for place in asked)
    assert kept.criticality.tolist() == [criticality[place] for place in asked]
    assert np.array_equal(kept.states, futures.states[asked].astype(np.float32))
    house.tables.close()


def test_what_the_drive_shows_is_laid_beside_how_far_engines_are_apart(house: SiblingHouse) -> None:
    for number, aside_m in enumerate((4.0, 1.0, 2.0, 3.0)):
        house.drive(21 + number)
        house.aside_m = aside_m
        house.round()
        house.answer()
        house.now_s += 10.0
    house.drive(120)
    house.end()
    count = house.siblings.count
    assert [apart_m for apart_m, _ in count.pairs] == pytest.approx([2.0, 0.5, 1.0, 1.5], abs=1e-2)
    wrong_m = [row["nominal_fde_m"] for row in house.rows("comparisons") if row["horizon_s"] == 4]
    assert [error_m for _, error_m in count.pairs] == wrong_m


def test_it_has_its_share_and_one_question_at_a_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    house = SiblingHouse(tmp_path, monkeypatch, share=0.1)
    house.drive(20)
    house.round()
    house.now_s += 1.0
    house.round()
    assert house.siblings.count.dropped == {"busy": 1}
    house.answer()
    house.now_s += 1.9
    house.round()
    assert house.siblings.count.dropped["share"] == 1, "0.3 s of a tenth of a core are 3 s"
    house.now_s += 0.2
    house.round()
    assert house.siblings.waits
    house.answer()
    assert house.siblings.count.cpu_s == pytest.approx(2 * TOOK_S)
    house.tables.close()


def test_it_is_the_first_to_be_dropped(house: SiblingHouse) -> None:
    pace = house.conductor.rounds.pace
    pace.now = pace.now._replace(futures=3)
    house.round()
    assert not house.siblings.waits
    assert house.siblings.count.dropped == {"late": 1}
    house.tables.close()


def test_its_death_costs_no_round(house: SiblingHouse) -> None:
    house.round()
    house.second.die()
    house.settle()
    assert not house.siblings.waits
    house.round()
    assert house.siblings.count.dropped == {"failed": 1, "gone": 1}
    house.second = house.begin()
    house.now_s += 1.0
    house.round()
    house.answer()
    assert house.conductor.rounds.tally.run == 3
    assert house.siblings.count.rounds == 1
    house.tables.close()


def test_new_parameters_reach_it_and_no_round_waits_for_that(house: SiblingHouse) -> None:
    told = [asked(house, worker.process_id) for worker in house.workers]
    house.round()
    house.answer()
    second = asked(house, SIBLING)
    set_mass(house)
    house.conductor.make_changes()
    for questions in told:
        answer(questions)
    house.settle()
    assert house.conductor.tuning.parameters.settled, "it has not answered"
    answer(second)
    house.settle()
    house.now_s += 10.0
    house.round()
    (question,) = house.second.take()
    assert question.message().decoded().vehicle_version == 1
    house.second.cpu_s += TOOK_S
    house.second.answer_one(question)
    house.settle()
    assert house.siblings.count.cpu_s == pytest.approx(2 * TOOK_S), "it is the same life"
    house.tables.close()


def test_disagreement_is_told_and_not_all_the_time(house: SiblingHouse) -> None:
    told = []
    for aside_m, until in ((1.9, 70), (2.2, 120), (2.2, 170), (2.2, 220)):
        house.aside_m = aside_m
        house.round()
        house.answer()
        told.append([one.text for one in house.watched("event") if "engines" in one.text])
        house.now_s += 1.0
        house.drive(until)  # five seconds on: how fast a machine plays them is no matter
    text = "engines disagree: MuJoCo and multibody are 1.1 m apart in 4 s"
    assert told == [[], [text], [], [text]]
    house.tables.close()


def test_a_nominal_future_that_collides_on_one_engine_alone_matters(house: SiblingHouse) -> None:
    house.hits = True
    house.round()
    house.answer()
    (text,) = (one.text for one in house.watched("event") if "engines" in one.text)
    assert text == "engines disagree: the nominal future collides on multibody alone"
    assert house.siblings.count.differ["nominal"] == house.siblings.count.mattered >= 1
    house.tables.close()


def test_no_more_than_eight_reasons_for_no_answer_are_told(house: SiblingHouse) -> None:
    for number in range(12):
        house.round()
        for question in house.second.take():
            question.refuse(f"reason {number}")
        house.settle()
        house.now_s += 60.0
    told = [one.text for one in house.watched("event") if "beside MuJoCo" in one.text]
    assert told == [f"multibody beside MuJoCo: reason {number}" for number in range(8)]
    house.tables.close()


def test_an_answer_of_no_use_is_dropped_and_told_once(house: SiblingHouse) -> None:
    house.second.spoil = lambda result: msgspec.structs.replace(result, future_indices=(77,))
    for _ in range(3):
        house.round()
        for _ in range(3):
            house.second.answer()
            house.settle()
    told = [one.text for one in house.watched("event") if "beside MuJoCo" in one.text]
    assert len(told) == 1
    assert "futures that were not asked for" in told[0]
    assert house.siblings.count.rounds == 0
    house.tables.close()
