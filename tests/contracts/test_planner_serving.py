"""A driving stack's side of the link: each scene is answered once, whatever the stack does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from foretwin.contracts import planner_serving
from foretwin.contracts.bus import Mailbox
from foretwin.contracts.errors import UserError
from foretwin.contracts.planner_link import (
    LINK_VERSION,
    PlannedMotions,
    PlannerJoined,
    PlannerScene,
)
from foretwin.contracts.planner_serving import LINK_GIVEN, Answering, serve_planner
from tests.contracts.memory_bus import MemoryBus
from tests.sim_worker.planners.a_stack import straight_on

IDS = {"run": "r1", "process": "w0"}


def scene(question: int = 1, **changed: Any) -> PlannerScene:
    one, road = np.ones(1), np.arange(8.0).reshape(4, 2)
    given: dict[str, Any] = {
        "run_id": "r1", "worker_id": "w0", "job": 0, "question": question, "futures": (0,),
        "time_s": 0.0, "answer_within_s": 1.0, "states": np.zeros((1, 8)),
        "road_users": np.zeros((1, 0, 7)), "path_xy_m": road, "speed_limit_mps": np.ones(4),
        "arc_m": one, "offset_m": one, "target_speed_mps": one, "stop_arc_m": one,
        "length_m": 4.0, "width_m": 2.0, "rear_overhang_m": 1.0, "wheelbase_m": 2.5,
        "link": LINK_VERSION, "reset": question == 1,
    }  # fmt: skip
    return PlannerScene(**(given | changed))


class Asks:
    """A stack that says what it was called with, and who asks it."""

    def __init__(self, answer: Any = straight_on) -> None:
        self.bus, self.called, self._answer = MemoryBus(), [], answer
        self.answers = Mailbox(8)
        self.bus.subscribe("planned_motions", self.answers, **IDS)
        self.stack = Answering(self.bus, self._plan, self._reset, **IDS)

    def _plan(self, scene: PlannerScene) -> PlannedMotions:
        self.called.append(f"plan {scene.question}")
        return self._answer(scene)

    def _reset(self, scene: PlannerScene) -> None:
        self.called.append(f"reset {scene.question}")

    def ask(self, *scenes: PlannerScene) -> list[PlannedMotions]:
        for one in scenes:
            self.bus.publish("planner_scene", one, **IDS)
            assert self.stack.take(0.0)
        return [self.answers.take().message() for _ in range(len(self.answers))]


def test_futures_begin_with_a_reset_and_each_question_is_answered_once() -> None:
    asks = Asks()
    answers = asks.ask(scene(), scene(), scene(2))
    assert asks.called == ["reset 1", "plan 1", "plan 2"], "asked twice, the same is said again"
    assert [one.question for one in answers] == [1, 1, 2]
    assert {one.link for one in answers} == {LINK_VERSION}
    assert not asks.stack.take(0.0)


def test_what_it_raises_is_said_in_one_line_and_it_goes_on(
    capsys: pytest.CaptureFixture[str],
) -> None:
    def fails(scene: PlannerScene) -> PlannedMotions | None:
        if scene.question == 1:
            raise ValueError("no way\nto go")
        return None if scene.question == 2 else straight_on(scene)

    first, second, third = Asks(fails).ask(scene(), scene(2), scene(3))
    assert first.failure == "ValueError: no way to go"
    assert second.failure == "TypeError: plan returned NoneType, not PlannedMotions"
    assert (third.failure, third.futures) == ("", (0,))
    assert "in fails" in capsys.readouterr().err, "whoever wrote it wants to see where"


def test_an_older_foretwin_is_refused() -> None:
    with pytest.raises(UserError, match="worker w0: it speaks version 1 of the planner link"):
        Asks().ask(scene(link=1))


def test_with_nobody_to_join_it_says_so_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(planner_serving, "JOIN_S", 0.0)
    assert serve_planner(straight_on, name="mine", version="1", out=tmp_path) == 2
    said = capsys.readouterr().err
    how = "start one, or name the folder of its runs as `out`"
    assert said == f"mine: {tmp_path}: no drive is running there; {how}\n"


def test_it_drives_one_drive_after_the_other(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    answered: list[int] = []

    class Drive(MemoryBus):
        """Asks once and is gone; the third of them never begins."""

        begun = 0

        def __init__(self, setup: object) -> None:
            Drive.begun += 1
            if Drive.begun == 3:
                raise KeyboardInterrupt
            super().__init__()

        def __enter__(self) -> Drive:
            return self

        def __exit__(self, *_: object) -> None: ...

        @property
        def connected(self) -> bool:
            if Drive.begun in answered:
                return False
            self.publish("planner_scene", scene(), **IDS)
            answered.append(Drive.begun)
            return True

    monkeypatch.setattr(planner_serving, "ZenohBus", Drive)
    assert serve_planner(straight_on, name="mine", version="1", endpoint="tcp/HOST:1") == 0
    assert answered == [1, 2]
    assert capsys.readouterr().out == "ready\nthe drive is over; ready for the next one\n" * 2


@pytest.mark.parametrize("given", ["rubbish", msgspec.json.encode({"bus": 1}).decode()])
def test_a_link_that_cannot_be_read_is_one_line(
    given: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(LINK_GIVEN, given)
    assert serve_planner(straight_on, name="mine", version="1") == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_to_a_sweep_it_says_who_it_is_until_it_is_asked_and_leaves_with_the_worker() -> None:
    class Sweep(MemoryBus):
        """Asks once it has heard twice who is there, answers nothing, and is gone."""

        looks = 0

        @property
        def connected(self) -> bool:
            self.looks += 1
            if self.looks in (3, 4):
                self.publish("planner_scene", scene(self.looks - 2), **IDS)
            return self.looks < 6

    bus, joined, answers = Sweep(), Mailbox(8), Mailbox(8)
    bus.subscribe("planner_joined", joined, **IDS)
    bus.subscribe("planned_motions", answers, **IDS)
    who = PlannerJoined(name="mine", version="1", link=LINK_VERSION)
    Answering(bus, straight_on, None, **IDS).serve_sweep(who)
    assert [joined.take().message() for _ in range(len(joined))] == [who] * 3
    assert [answers.take().message().question for _ in range(len(answers))] == [1, 2]
