"""What changes between two runs of one drive."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from foretwin.orchestrator.agreement.difference import JudgedRun, difference_lines, difference_of


def disagreement(at_s: float, kind: str = "ads_stops") -> dict[str, Any]:
    return {
        "aspect": "pace", "kind": kind, "stamp_ns": round(at_s * 1e9), "drive_time_s": at_s,
        "lat_deg": 52.5, "lon_deg": 13.4,
    }  # fmt: skip


def window(
    at_s: float, outcome: str, driven_fails: str = "", not_observable: str = ""
) -> dict[str, Any]:
    return {
        "stamp_ns": round(at_s * 1e9), "drive_time_s": at_s, "intersection_id": "n4",
        "outcome": outcome, "observable": "comfort stop_line", "simulated_fails": "",
        "driven_fails": driven_fails, "not_observable": not_observable,
    }  # fmt: skip


def run(
    name: str,
    disagreements: list[dict[str, Any]],
    windows: list[dict[str, Any]],
    *,
    junctions: tuple[str, ...] = ("Mill Lane",),
    ade_m: float = 0.5,
) -> JudgedRun:
    overall = {"agree_pass": sum(w["outcome"] == "agree_pass" for w in windows)}
    record = {
        "map": {"file": f"{name}.osm"}, "config": {"vehicle": None},
        "side_by_side": {"disagreements": disagreements} if disagreements else None,
        "comparison": {"ade_m": {"1": ade_m, "8": 4.0}},
        "agreement": {"overall": overall} if windows else None,
        "intersections": [{"kind": "t_junction", "name": j, "id": "n"} for j in junctions],
        "off_road": [],
    }  # fmt: skip
    return JudgedRun(Path(name), record, windows, [0.1, 0.2])


def test_the_same_run_twice_changes_nothing() -> None:
    one = run("a", [disagreement(4.0)], [window(3.0, "agree_pass")])
    found = difference_of(one, one)
    assert found["disagreements"] == {"same": 1, "gone": [], "new": []}
    assert found["outcomes"] == []
    assert found["junctions"] == {"gone": [], "new": []}
    assert "verdicts that change: 0" in difference_lines(found)


def test_what_is_gone_what_is_new_and_whose_verdict_changes() -> None:
    before = run(
        "a", [disagreement(4.0), disagreement(9.0)],
        [window(3.0, "agree_pass"), window(4.0, "agree_pass"), window(7.0, "agree_pass")],
    )  # fmt: skip
    after = run(
        "b", [disagreement(4.5), disagreement(9.0, "ads_faster")],
        [window(3.1, "agree_pass"), window(4.0, "too_optimistic", "stop_line")],
        junctions=("Mill Lane", "Abbey Circle"), ade_m=0.6,
    )  # fmt: skip
    found = difference_of(before, after)
    assert found["disagreements"]["same"] == 1
    assert [one["kind"] for one in found["disagreements"]["gone"]] == ["ads_stops"]
    assert [one["kind"] for one in found["disagreements"]["new"]] == ["ads_faster"]
    (changed,) = found["outcomes"]
    assert changed["drive_time_s"] == 4.0
    assert (changed["before"]["outcome"], changed["after"]["driven_fails"]) == (
        "agree_pass", "stop_line",
    )  # fmt: skip
    assert found["junctions"]["new"] == ["t_junction Abbey Circle"]
    lines = difference_lines(found)
    assert "nominal future, ADE at 1 s: 0.5 → 0.6 m" in lines
    assert "agree pass: 3 → 1 windows" in lines
    assert any("too_optimistic" in line and "stop_line" in line for line in lines)


def test_runs_without_rounds_or_plans_are_compared_as_far_as_they_go() -> None:
    empty = run("a", [], [])
    found = difference_of(empty, run("b", [disagreement(1.0)], [window(3.0, "agree_pass")]))
    assert found["agreement"]["before"] is None
    assert len(found["disagreements"]["new"]) == 1
    assert difference_lines(found)


def test_each_side_names_what_it_was_driven_with() -> None:
    before, after = run("a", [], []), run("b", [], [])
    after.record["config"] |= {"vehicle": "car.toml", "worlds": "corrected"}
    assert difference_lines(difference_of(before, after))[:2] == [
        "before: a (map a.osm)",
        "after: b (map b.osm, vehicle car.toml, Worlds of corrected)",
    ]


def test_a_verdict_that_nobody_can_tell_any_more_says_of_what() -> None:
    before = run("a", [], [window(3.0, "agree_pass")])
    after = run("b", [], [window(3.0, "not_observable", not_observable="drivable_area")])
    (line,) = (one for one in difference_lines(difference_of(before, after)) if "3.0 s at" in one)
    assert line.endswith(
        "agree_pass (simulated fails nothing, driven nothing) → not_observable (simulated fails "
        "nothing, driven nothing, not observable: drivable_area)"
    )
