"""`foretwin compare` of runs and sweeps as a user runs it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from foretwin.orchestrator.commands.cli import run as command
from foretwin.orchestrator.commands.compare_runs import _measure_lines
from foretwin.sim_worker.futures.job_tables import JOB_TABLES
from tests.orchestrator.across.test_changes import case, sweep_of
from tests.orchestrator.lake.made_runs import TOLD, write


@pytest.fixture
def sweeps(tmp_path: Path) -> tuple[str, str]:
    """One, and one (with a space in its name) in which seven of 28 newly fail, at every place."""
    first = sweep_of(tmp_path / "before", [case(number) for number in range(28)])
    rows = [case(number, collided=number < 7, min_clearance_m=0.1) for number in range(28)]
    return str(first), str(sweep_of(tmp_path / "after it", rows, seed=4))


def test_what_changed_is_said_with_how_sure_it_is_and_how_to_see_it(
    sweeps: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert command(["compare", *sweeps]) == 0

    said = capsys.readouterr().out
    assert "collided: 0 → 7: 7 newly failing, 0 fixed\n" in said
    assert "in percentage points: +25 [+25, +25] (7 places), p = 0.0156, significant\n" in said
    assert "min_clearance_m (m)" in said
    assert "worse" in said
    assert f"newly failing: scp at n0: scp 0: foretwin repeat '{sweeps[1]}' mine-0" in said
    assert "places where cases changed: 7 of 7" in said
    assert "seed: None → 4" in said


def test_changes_that_may_be_chance_are_counted_and_listed_with_all(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = str(sweep_of(tmp_path / "before", [case(n, min_clearance_m=1.0) for n in range(28)]))
    rows = [case(n, min_clearance_m=1.1 if n % 7 % 2 else 0.91) for n in range(28)]
    second = str(sweep_of(tmp_path / "after", rows, seed=4))

    assert command(["compare", first, second]) == 0
    short = capsys.readouterr().out
    assert command(["compare", first, second, "--all"]) == 0
    whole = capsys.readouterr().out

    assert "1 measure changed not significantly: --all" in short
    assert "min_clearance_m (m)" not in short
    assert "min_clearance_m (m)" in whole
    assert "--all" not in whole


def test_measures_that_one_side_alone_has_are_told_where_that_is_no_chance(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = str(sweep_of(tmp_path / "before", [case(n, metric_ttc=None) for n in range(28)]))
    rows = [case(n, metric_ttc=0.5 if n < 9 else None) for n in range(28)]
    rows[9] = case(9, metric_ttc=None, progress_m=1.0)
    second = str(sweep_of(tmp_path / "after", rows, seed=4))

    assert command(["compare", first, second]) == 0
    short = capsys.readouterr().out
    assert command(["compare", first, second, "--all"]) == 0
    whole = capsys.readouterr().out

    ttc = "metric_ttc: only A has a value in 0 cases, only B in 9, p adjusted 0.0312; what "
    assert f"{ttc}changed is told of 0 with both" in short
    assert "1 more measure has a value on one side alone in some cases: --all" in short
    assert "progress_m: only A has a value in 0 cases, only B in 1, p adjusted 1;" in whole
    assert "on one side alone" not in whole


def test_at_one_place_counts_are_told_and_nothing_is_called_significant(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [case(n, junction_id="n", metric_ttc=None) for n in range(28)]
    hit = [row | {"collided": row["case"] < 12, "min_clearance_m": 0.2} for row in rows]
    hit[20] |= {"metric_ttc": 0.5}
    sweeps = [str(sweep_of(tmp_path / name, of)) for name, of in (("a", rows), ("b", hit))]

    assert command(["compare", *sweeps, "--fail-on-worse"]) == 3
    short = capsys.readouterr().out
    assert command(["compare", *sweeps, "--all"]) == 0
    whole = capsys.readouterr().out

    assert "collided: 0 → 12: 12 newly failing, 0 fixed\n" in short
    assert "in percentage points: +42.9 (too few to tell: 1 place)\nfewer than 6 places" in short
    assert "1 measure changed at too few places to tell: --all" in short
    (clearance,) = (line for line in whole.splitlines() if line.startswith("min_clearance_m"))
    assert clearance.split("(too few to tell: 1 place)")[1].strip() == "too few places"
    assert "only B in 1, at too few places to tell (1); what changed" in whole
    assert "significant" not in short + whole


def test_what_is_surest_stands_first() -> None:
    change = {"mean": 1.0, "low": None, "units": 3}
    rows = [
        {"measure": name, "unit": "m", "first": 0.0, "second": 1.0, "change": change,
         "word": "worse", "relative": False, "p_adjusted": p_value}
        for name, p_value in (("a", 0.04), ("b", None), ("c", 0.001))
    ]  # fmt: skip

    lines = list(_measure_lines(rows, every=True))

    assert [line[0] for line in lines[1:]] == ["c", "a", "b"]


def test_a_score_that_is_relative_to_others_of_its_job_is_said_to_be(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The same motion has another score where another case beside it went farther."""
    runs = []
    for name, score in (("before", 0.5), ("after", 0.75)):
        out = sweep_of(tmp_path / name, [case(n, metric_driving_score=score) for n in range(28)])
        metric = [{"name": "driving_score", "unit": "1", "better": "higher"}]
        write(out / "metrics.parquet", metric, JOB_TABLES["metrics"], TOLD)
        runs.append(str(out))

    assert command(["compare", *runs]) == 0

    said = capsys.readouterr().out
    assert "better\nmetric_driving_score: relative to the farthest" in said


def test_of_forty_five_measures_those_are_shown_that_are_for_the_worse_or_the_better() -> None:
    change = {"mean": 1.0, "low": None, "units": 3}
    rows = [
        {"measure": f"m{place:02d}", "unit": "m", "first": 0.0, "second": 1.0, "change": change,
         "word": word, "relative": False, "p_adjusted": 1e-9 / (place + 1)}
        for place, word in enumerate(["worse"] * 9 + ["changed"] * 30 + ["better"] * 6)
    ]  # fmt: skip

    head, *shown, more = _measure_lines(rows, every=False)

    assert head.startswith("measure")
    assert [line[:3] for line in shown] == [
        *(f"m{place}" for place in range(44, 38, -1)),
        *(f"m0{place}" for place in range(8, 2, -1)),
    ]
    assert more == "33 more changed significantly (30 changed, 3 worse): --all"
    assert len(list(_measure_lines(rows, every=True))) == 46


def test_exit_code_3_is_for_those_who_ask(
    sweeps: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert command(["compare", *sweeps, "--fail-on-worse"]) == 3
    assert command(["compare", *reversed(sweeps), "--fail-on-worse"]) == 0
    capsys.readouterr()
    assert command(["compare", *sweeps, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["failing"]["newly"] == 7


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        (["A", "A"], "name another, or two of its --planners A,B"),
        (["A", "A", "--planners", "mine"], "two names, as in --planners mine,yours"),
        (["A", "A", "--planners", "mine,yours"], "no futures of planner 'yours': has mine"),
        (["A", "LOG"], "is neither a run nor a sweep"),
        (["A", "nowhere"], "nowhere: no such folder"),
        (["A", "B", "--out", "here"], "--out and declarations are for recorded drives"),
        (["LOG", "LOG", "--fail-on-worse"], "--fail-on-worse and --all are for runs"),
    ],
)
def test_what_cannot_be_compared_is_one_line(
    sweeps: tuple[str, str],
    tmp_path: Path,
    asked: list[str],
    told: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    log = tmp_path / "drive.csv"
    log.touch()
    named = {"A": sweeps[0], "B": sweeps[1], "LOG": str(log)}

    assert command(["compare", *(named.get(word, word) for word in asked)]) == 2

    said = capsys.readouterr().err
    assert told in said
    assert said.count("\n") == 1
