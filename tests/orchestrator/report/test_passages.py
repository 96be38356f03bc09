"""Which rounds belong to which passage of a junction, and which futures of it are told."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa

from foretwin.contracts.simulation import AMBER_FROM, RED_FROM
from foretwin.orchestrator.report.material import RunMaterial
from foretwin.orchestrator.report.passages import passages, tone_of, what_came, worst_of
from tests.orchestrator.report.told_runs import told_run


def test_a_junction_has_its_rounds_and_its_worst_futures(tmp_path: Path) -> None:
    run = RunMaterial(told_run(tmp_path))

    (one,) = passages(run)

    assert [row["round_id"] for row in one.rounds] == [0]
    assert one.futures == 9
    assert one.likeliest[0]["likelihood"] == max(row["likelihood"] for row in one.likeliest)
    assert one.arrived_s == 15.0
    came = what_came(run, one)
    assert came.errors_m == {1.0: 0.4, 2.0: 0.8}
    assert came.speed_mps == 8.0
    assert came.stood_s == 0.0


def test_rounds_go_to_the_first_passage_after_them(tmp_path: Path) -> None:
    run = RunMaterial(told_run(tmp_path))
    place = run.record["intersections"][0]
    run.record["intersections"] = [place | {"arrived_at_s": 5.0}, place | {"arrived_at_s": 30.0}]

    first, second = passages(run)

    assert (len(first.rounds), len(second.rounds)) == (0, 1)


def test_rounds_that_go_on_behind_a_junction_are_of_the_passage_just_made(tmp_path: Path) -> None:
    run = RunMaterial(told_run(tmp_path))
    place = run.record["intersections"][0]
    run.record["intersections"] = [place | {"arrived_at_s": at_s} for at_s in (15.0, 59.0, 80.0)]
    seconds = {"here": (10.0, 14.5, 16.0), "else": (17.0, 30.0), "again": (38.0, 58.0, 70.0, 81.0)}
    run.rounds = [
        run.rounds[0] | {"drive_time_s": at_s, "intersection_id": where}
        for name, times in seconds.items()
        for at_s in times
        for where in ["elsewhere" if name == "else" else place["id"]]
    ]

    first, second, third, elsewhere = (
        [row["drive_time_s"] for row in one.rounds] for one in passages(run)
    )

    assert first == [10.0, 14.5, 16.0]
    assert second == [38.0, 58.0]
    assert third == [70.0, 81.0]
    assert elsewhere == [17.0, 30.0]


def test_a_junction_that_was_not_reached_comes_last(tmp_path: Path) -> None:
    run = RunMaterial(told_run(tmp_path))
    run.record["intersections"] = []

    (one,) = passages(run)

    assert one.arrived_s is None
    assert len(one.rounds) == 1
    assert one.name.startswith("Kronen")
    assert what_came(run, one).speed_mps is None


def test_the_worst_are_one_of_each_scenario_and_none_that_is_harmless() -> None:
    rows = [
        future("a", "scp", 1e-6),
        future("b", "scp", 1e-5),
        future("c", "cpta", 1e-7),
        future("d", "", 0.0),
    ]

    worst = worst_of(pa.Table.from_pylist(rows), 5)

    assert [one["future_id"] for one in worst] == ["b", "c"]
    assert worst_of(None, 5) == ()


def test_colours_follow_the_one_table_of_limits() -> None:
    assert tone_of(None) == tone_of(AMBER_FROM / 2) == ""
    assert tone_of(AMBER_FROM) == "watch"
    assert tone_of(RED_FROM) == "bad"


def future(future_id: str, scenario: str, criticality: float) -> dict[str, object]:
    return {
        "future_id": future_id,
        "scenario": scenario,
        "name": scenario or "nominal",
        "collided": False,
        "criticality": criticality,
        "likelihood": 0.1,
    }
