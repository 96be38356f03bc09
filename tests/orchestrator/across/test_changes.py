from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.across.changes import changes_between, is_worse
from foretwin.orchestrator.across.pairs import side_of
from foretwin.orchestrator.sweep.folder import SUMMARY
from foretwin.sim_worker.futures.job_tables import JOB_TABLES
from tests.orchestrator.lake.made_runs import TOLD, made_run, made_sweep, write

COVERS = ("foretwin.orchestrator.across.pairs",)


def case(
    number: int, *, collided: bool = False, planner: str = "mine", **more: Any
) -> dict[str, Any]:
    row = {
        "future_id": f"{planner}-{number}", "index": number, "junction_id": f"n{number % 7}",
        "place": "", "scenario": "scp", "case": number, "vehicle": "car", "seed": 1,
        "planner": planner, "name": f"scp {number}", "valid": True, "failure": "", "left_out": "",
        "collided": collided, "min_clearance_m": 0.0 if collided else 1.0 + number / 100.0,
        "metric_ttc": 2.0, "trajectory_sha256": f"{number} {collided}",
    }  # fmt: skip
    return row | more


def sweep_of(folder: Path, rows: list[dict[str, Any]], **record: Any) -> Path:
    made_sweep(folder, jobs=0, **record)
    write(folder / "rows" / "job-000000.parquet", rows, JOB_TABLES["futures"], TOLD)
    metric = [{"name": "ttc", "unit": "s", "better": "higher"}]
    write(folder / "metrics.parquet", metric, JOB_TABLES["metrics"], TOLD)
    return folder


def compared(first: Path, second: Path, *planners: str) -> dict[str, Any]:
    of_first, of_second = planners or (None, None)
    return changes_between(side_of(first, of_first), side_of(second, of_second))


def test_the_same_sweep_twice_has_not_changed(tmp_path: Path) -> None:
    rows = [case(number, collided=number < 3) for number in range(20)]

    found = compared(sweep_of(tmp_path / "a", rows), sweep_of(tmp_path / "b", rows[::-1]))

    assert (found["pairs"], found["equal"], found["only_first"]) == (20, 20, 0)
    assert (found["failing"]["newly"], found["failing"]["p_value"]) == (0, 1.0)
    assert {row["word"] for row in found["measures"]} == {"the same"}
    assert found["inputs"] == {}
    assert not is_worse(found)


def test_newly_failing_and_fixed_cases_are_named_place_by_place(tmp_path: Path) -> None:
    before = [case(number, collided=number == 0) for number in range(28)]
    after = [case(number, collided=number in (7, 14, 8)) for number in range(28)]

    found = compared(sweep_of(tmp_path / "a", before), sweep_of(tmp_path / "b", after, seed=2))

    assert [one["case"] for one in found["newly_failing"]] == [7, 14, 8]
    assert [one["case"] for one in found["fixed"]] == [0]
    failing = found["failing"]
    assert (failing["first"], failing["second"], failing["newly"], failing["fixed"]) == (1, 3, 3, 1)
    assert failing["p_value"] == pytest.approx(0.5)  # One more at two of seven places.
    places = {row["junction_id"]: (row["newly"], row["fixed"]) for row in found["places"]}
    assert (places["n0"], places["n1"], places["n2"]) == ((2, 1), (1, 0), (0, 0))
    assert found["places"][0]["junction_id"] in ("n0", "n1")
    assert found["inputs"] == {"seed": {"first": None, "second": 2}}


def test_one_case_more_that_collides_is_worse_wherever_it_is(tmp_path: Path) -> None:
    here = [case(number, collided=number == 0, junction_id="n") for number in range(28)]
    first = sweep_of(tmp_path / "first", here)
    for name, hit, worse in (("one", {0, 1}, True), ("other", {1}, False), ("none", set(), False)):
        rows = [case(number, collided=number in hit, junction_id="n") for number in range(28)]
        found = compared(first, sweep_of(tmp_path / name, rows))

        assert is_worse(found) is worse
        assert found["failing"]["p_value"] is None


def test_many_cases_at_one_place_are_a_fact_there_and_nothing_significant(tmp_path: Path) -> None:
    """Twelve of twenty at one of twenty places: every case for itself would have p = 0.0005."""
    rows = [case(n, junction_id=f"n{n // 20}", place=f"{n % 20}") for n in range(400)]
    hit = [row | {"collided": row["case"] < 12} for row in rows]

    found = compared(sweep_of(tmp_path / "a", rows), sweep_of(tmp_path / "b", hit))

    assert is_worse(found)
    assert found["failing"]["newly"] == 12
    assert found["failing"]["p_value"] > 0.9
    assert found["places"][0] == {
        "junction_id": "n0", "pairs": 20, "first": 0, "second": 12, "newly": 12, "fixed": 0,
    }  # fmt: skip


def test_futures_of_five_approaches_are_five_places_however_many(tmp_path: Path) -> None:
    """Without a systematic change at five junctions 85 % of draws were called significant."""
    rng = np.random.default_rng(0)
    places, shift = [n % 5 for n in range(400)], rng.normal(0.0, 0.3, 5)
    before = [case(n, junction_id=f"n{at}", metric_ttc=2.0) for n, at in enumerate(places)]
    after = [row | {"metric_ttc": 2.0 + shift[n % 5]} for n, row in enumerate(before)]

    found = compared(sweep_of(tmp_path / "a", before), sweep_of(tmp_path / "b", after))

    ttc = next(row for row in found["measures"] if row["measure"] == "metric_ttc")
    assert (ttc["change"]["units"], ttc["p_adjusted"], ttc["word"]) == (5, None, "too few places")
    assert ttc["change"]["mean"] == pytest.approx(shift.mean())


def test_rows_in_another_order_and_sides_in_the_other_one_say_the_same(tmp_path: Path) -> None:
    # Places are drawn by chance: which ones must not hang on the order.
    rng = np.random.default_rng(3)
    more = [{"metric_ttc": float(rng.normal(2.0))} for n in range(20)]
    before = [case(n, **one) for n, one in enumerate(more)]
    after = [row | {"metric_ttc": row["metric_ttc"] + rng.normal(0.5)} for row in before]
    a, b = sweep_of(tmp_path / "a", before), sweep_of(tmp_path / "b", after)
    shuffled = sweep_of(tmp_path / "c", [before[i] for i in rng.permutation(20)])

    found = compared(a, b)
    turned = compared(b, a)["measures"]

    assert compared(shuffled, b)["measures"] == found["measures"]
    for mine, its in zip(found["measures"], turned, strict=True):
        change, back = mine["change"], its["change"]
        assert change["p_value"] == back["p_value"]
        signs = [change["mean"], change["low"], change["high"]]
        assert signs == pytest.approx([-back["mean"], -back["high"], -back["low"]])


def test_two_planners_of_one_sweep_are_paired_case_by_case(tmp_path: Path) -> None:
    rows = [case(n, planner="mine") for n in range(14)]
    rows += [case(n, planner="yours", collided=n % 2 == 0, metric_ttc=1.0) for n in range(14)]
    sweep = sweep_of(tmp_path / "sweep", rows)

    found = compared(sweep, sweep, "mine", "yours")

    assert (found["pairs"], found["failing"]["newly"]) == (14, 7)
    assert found["inputs"] == {"planner": {"first": ["mine"], "second": ["yours"]}}
    ttc = next(row for row in found["measures"] if row["measure"] == "metric_ttc")
    assert (ttc["change"]["mean"], ttc["word"], ttc["unit"]) == (-1.0, "worse", "s")
    assert ttc["change"]["units"] == 7
    assert compared(sweep, sweep)["pairs"] == 28


def test_what_one_side_alone_has_a_value_of_is_counted_beside_the_means(tmp_path: Path) -> None:
    near = [number % 2 == 0 for number in range(28)]
    before = [case(n, metric_ttc=2.0 if near[n] else None) for n in range(28)]
    after = [case(n, metric_ttc=2.1 if near[n] else 0.5) for n in range(28)]
    first, second = sweep_of(tmp_path / "a", before), sweep_of(tmp_path / "b", after)

    found = compared(first, second)

    (ttc,) = [row for row in found["measures"] if row["measure"] == "metric_ttc"]
    assert (ttc["pairs"], ttc["word"]) == (14, "better")  # of those that were near before
    (alone,) = found["alone"]
    p_value = pytest.approx(2.0 * 0.5**7)  # At all of seven places, however many cases.
    assert alone == {
        "measure": "metric_ttc", "first": 0, "second": 14, "both": 14, "units": 7,
        "p_value": p_value, "p_adjusted": p_value,
    }  # fmt: skip
    assert compared(first, first)["alone"] == []


def test_numbers_and_seeds_tell_cases_apart(tmp_path: Path) -> None:
    first = sweep_of(tmp_path / "a", [case(n, friction_factor=1.0) for n in range(4)])
    second = sweep_of(tmp_path / "b", [case(n, friction_factor=0.5) for n in range(4)])

    with pytest.raises(UserError, match="have no case in common: sweeps are compared by junction"):
        compared(first, second)


def test_vehicles_are_compared_where_each_sweep_has_one(tmp_path: Path) -> None:
    car, van = ([case(n, vehicle=name) for n in range(4)] for name in ("car", "van"))
    first, second = sweep_of(tmp_path / "a", car), sweep_of(tmp_path / "b", van)
    both = sweep_of(tmp_path / "both", [*car, *van])

    assert compared(first, second)["pairs"] == 4
    assert (compared(both, both)["pairs"], compared(both, second)["pairs"]) == (8, 4)


def test_what_was_not_played_on_both_sides_is_counted_apart(tmp_path: Path) -> None:
    first = [case(0), case(1, left_out="no room"), case(2, valid=False), case(3)]
    second = [case(0, failure="died"), case(1), case(2, valid=False), case(3)]

    found = compared(sweep_of(tmp_path / "a", first), sweep_of(tmp_path / "b", second))

    assert found["not_played"] == {"newly": 1, "no_longer": 1, "neither": 1}
    assert found["failing"]["pairs"] == 1


def test_drives_are_paired_by_the_instants_of_their_futures(tmp_path: Path) -> None:
    folders = []
    for number, shift in ((0, 0), (1, 1)):
        run = made_run(tmp_path, number)
        rows = [
            case(n, stamp_ns=(n + shift) // 4, index=(n + shift) % 4, case=None) for n in range(12)
        ]
        at_one_place = [row | {"name": "x", "junction_id": "n"} for row in rows]
        file = run / "results" / "futures.parquet"
        write(file, at_one_place, JOB_TABLES["futures"], TOLD)
        folders.append(run)

    found = compared(*folders)

    assert (found["pairs"], found["only_first"], found["only_second"]) == (11, 1, 1)


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (lambda folder: made_run(folder / "runs"), "is a sweep, .* a drive: two of a kind"),
        (lambda folder: made_run(folder / "runs", exit="running"), "never came to its end"),
        (lambda folder: cut(made_sweep(folder / "cut")), "is cut short"),
    ],
)
def test_what_cannot_be_compared_is_one_line(tmp_path: Path, spoil: Any, told: str) -> None:
    first = sweep_of(tmp_path / "a", [case(0)])

    with pytest.raises(UserError, match=told) as found:
        compared(first, spoil(tmp_path))

    assert "\n" not in str(found.value)


def test_a_planner_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no futures of planner 'yours': has mine"):
        side_of(sweep_of(tmp_path / "a", [case(0)]), "yours")


def cut(sweep: Path) -> Path:
    file = next((sweep / "rows").iterdir())
    file.write_bytes(file.read_bytes()[:-3])
    return sweep


def test_settings_that_decide_futures_are_told(tmp_path: Path) -> None:
    rows = [case(0)]
    first, second = sweep_of(tmp_path / "a", rows), sweep_of(tmp_path / "b", rows)
    record = json.loads((second / SUMMARY).read_text())
    record["spec"] |= {"control_hz": 10.0, "job_timeout_s": 3.0}
    record["versions"] = {"foretwin": "9"}
    (second / SUMMARY).write_text(json.dumps(record))

    assert compared(first, second)["inputs"] == {
        "spec.control_hz": {"first": None, "second": 10.0},
        "versions.foretwin": {"first": None, "second": "9"},
    }
