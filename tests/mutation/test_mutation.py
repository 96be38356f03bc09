"""The mutation run itself: what it draws, what it runs, and that it tells the living from the
dead."""

from __future__ import annotations

import os
import random

import pytest

from tests.mutation.__main__ import LEAST_KILLED, Mutant, Report, draw, planted, run
from tests.mutation.noticing import checkout, files_of
from tests.test_mirrored import modules

SEED = int(os.environ.get("FORETWIN_MUTATION_SEED", "0")) or random.SystemRandom().randrange(
    1, 10**6
)
SEGMENTS = "foretwin.contracts.segments"


@pytest.mark.judge
@pytest.mark.timeout(7200)
def test_most_mutants_are_killed(capsys: pytest.CaptureFixture[str]) -> None:
    with capsys.disabled():
        report = run(SEED, 60)
    assert report.planted == "killed"
    assert report.killed + 2.0 * report.error >= LEAST_KILLED, "the rest is chance of the draw"


@pytest.mark.judge
@pytest.mark.timeout(600)
def test_a_change_is_noticed_and_no_change_is_not() -> None:
    text = modules()[SEGMENTS].read_text(encoding="utf-8")
    with checkout() as tree:
        assert tree.fate(SEGMENTS, text + "# as it was\n") == "survived"
        assert tree.fate(SEGMENTS, text.replace("number == 1", "number == 2")) == "killed"
        assert tree.fate(SEGMENTS, text) == "survived", "what was changed is put back"


@pytest.mark.judge
@pytest.mark.timeout(600)
def test_a_seed_draws_the_same_mutants_each_in_one_line() -> None:
    drawn = draw(7, 12)
    assert drawn == draw(7, 12)
    assert len({(one.module, one.line, one.text) for one in drawn}) == 12
    for one in drawn:
        was = modules()[one.module].read_text(encoding="utf-8")
        assert one.text != was
        assert abs(len(one.text.splitlines()) - len(was.splitlines())) <= 1


def test_the_planted_mutant_can_be_planted() -> None:
    assert planted().text != modules()[planted().module].read_text(encoding="utf-8")
    assert files_of(planted().module)[0] == "tests/telemetry/ros2/test_safety.py"


def test_tests_of_several_processes_are_left_out() -> None:
    module = "foretwin.orchestrator.drive.drive"
    assert not [name for name in files_of(module) if name.startswith("tests/system/")]
    assert set(files_of(module)) <= set(files_of(module, system=True))


def test_the_share_comes_with_its_error() -> None:
    mutant = Mutant("m", 1, "o", "a", "b", "text")
    fates = [(mutant, "killed")] * 8 + [(mutant, "timed out"), (mutant, "survived")]
    report = Report(fates, "killed")  # type: ignore[arg-type]
    assert report.killed == 0.9
    assert report.error == pytest.approx(0.0949, abs=1e-4)
