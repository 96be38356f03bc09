"""run.json: the keys that were promised, valid JSON whatever happened, and its last line."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from foretwin.contracts.tally import Tally, tally_file, write_tally
from foretwin.orchestrator.drive.run_record import lost_lines, run_record, versions
from foretwin.orchestrator.drive.summary import summary_text, summed_up
from foretwin.orchestrator.record.run_state import write_record
from tests.orchestrator.house import House

COVERS = ("foretwin.orchestrator.drive.summary",)

PROMISED = {
    "run_id", "exit", "versions", "map", "seed", "route_source", "config", "intersections",
    "telemetry", "futures", "state_to_result_ms_p50", "state_to_result_ms_p95", "comparison",
    "workers", "dropped", "ledger",
}  # fmt: skip


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    made = House(tmp_path)
    yield made
    made.tables.close()


def record_of(house: House) -> dict[str, Any]:
    return run_record(house.conductor, 0, exit_word="completed", wall_s=12.3456, mono_s=1000.0)


@pytest.fixture(scope="module")
def ended(tmp_path_factory: pytest.TempPathFactory) -> House:
    """A house whose car has driven for a while, to its end."""
    made = House(tmp_path_factory.mktemp("ended"))
    made.drive(200, round_every=5)
    made.end()
    return made


def test_the_promised_keys_are_there_and_filled_by_a_drive(ended: House) -> None:
    record = record_of(ended)

    assert set(record) >= PROMISED
    assert record["map"]["sha256"] == ended.plan.osm.sha256
    assert (record["route_source"], record["seed"]) == ("given", 0)
    (junction,) = record["intersections"]
    assert set(junction) >= {
        "id", "kind", "lat", "lon", "arrived_at_s", "built_at_s", "world_ready_before_s",
        "rounds", "futures",
    }  # fmt: skip
    assert set(record["telemetry"]) >= {
        "received", "lost", "skipped_invalid", "age_ms_p50", "age_ms_p95",
    }  # fmt: skip
    assert set(record["futures"]) >= {
        "count", "distinct", "missed_rounds", "rounds", "sim_seconds", "cpu_seconds", "sha256",
    }  # fmt: skip
    assert set(record["comparison"]["ade_m"]) == {"1", "2", "4", "8"}
    assert set(record["comparison"]) >= {
        "ade_m", "constant_velocity_ade_m", "constant_turn_rate_ade_m", "independent",
    }  # fmt: skip
    assert record["workers"]["started"] == 2
    assert record["telemetry"]["received"] == 200
    assert record["state_to_result_ms_p50"] <= record["state_to_result_ms_p95"]
    assert record["wall_s"] == 12.346


def test_what_is_lost_is_in_the_record_and_in_its_last_lines(house: House) -> None:
    assert lost_lines(record_of(house)) == []
    house.drive(200, round_every=5)
    house.end()
    tally, published = Tally(), dict(house.conductor.intake.counts.by_channel)
    for channel, count in published.items():
        for seq in range(count):
            tally.numbers.take(channel, seq, sender=7)
            tally.settle("recorded" if seq else "unwritten", channel)
    write_tally(tally, tally_file(house.plan.recording))
    record = record_of(house)
    ledger = record["ledger"]["telemetry"]
    assert (ledger["published"], ledger["recorded"]) == (200, 200 - len(published))
    assert ledger["published"] == ledger["recorded"] + ledger["lost"]
    (line,) = [one for one in lost_lines(record) if "telemetry" in one]
    assert line.startswith(f"lost: {len(published)} of 200 telemetry samples are not recorded")

    record["troubles"] = ["viewer ended with code -9"]
    assert lost_lines(record) == ["error: viewer ended with code -9", line]


@pytest.mark.parametrize("length", [0, 1, 100])
def test_the_record_is_json_whatever_came_of_the_drive(house: House, length: int) -> None:
    if length:
        house.workers[0].diverges = house.workers[1].diverges = True
        house.drive(length, round_every=5)
        house.end()
    text = json.dumps(record_of(house), allow_nan=False)

    assert set(json.loads(text)) >= PROMISED


def test_the_stand_ins_commands_are_its_own_and_so_is_the_judgement(house: House) -> None:
    assert record_of(house)["comparison"]["independent"] is True
    house.conductor.mirror.independent = False
    assert record_of(house)["comparison"]["independent"] is False


def test_a_record_replaces_what_was_there(tmp_path: Path) -> None:
    file = tmp_path / "run.json"
    file.write_text("x" * 100_000)
    write_record({"run_id": "r", "name": "Straße"}, file)

    assert json.loads(file.read_text(encoding="utf-8")) == {"run_id": "r", "name": "Straße"}
    assert [p.name for p in tmp_path.iterdir()] == ["run.json"]


def test_the_ledger_says_what_became_of_rounds_and_jobs(house: House) -> None:
    house.drive(100, round_every=5)
    assert house.conductor.rounds.tally.run > 10
    house.drive(105)
    assert house.conductor.start_round()
    house.workers[0].answer()
    house.settle()
    house.conductor.rounds.close()
    tally = house.conductor.rounds.tally
    tally.due = tally.run + tally.missed + tally.unseeded + 1
    record = record_of(house)

    assert record["ledger"]["rounds"]["given_up"] == 1
    jobs = record["ledger"]["jobs"]
    assert jobs == {
        "given": 2 * tally.run + 2,
        "results": 2 * tally.run + 1,
        "refused": 0,
        "lost": 1,
    }
    assert record["troubles"] == []
    # The end came first, nothing failed; a recorder there was none.
    assert [line for line in lost_lines(record) if "telemetry" not in line] == []
    tally.due += 1
    assert record_of(house)["troubles"] == ["the ledger of rounds does not balance"]


def test_what_a_drive_lost_is_said_last(house: House) -> None:
    house.drive(200, round_every=5)
    house.conductor.rounds.tally.fail("3 workers died of it")
    (said,) = [line for line in lost_lines(record_of(house)) if "rounds are" in line]
    assert said.startswith("lost: 1 of ")
    assert said.endswith(", the last since: 3 workers died of it")


def test_versions_name_what_decides_results() -> None:
    assert set(versions()) >= {"python", "mujoco", "eclipse-zenoh", "numpy"}


def test_the_summary_names_every_junction_and_the_maps_source(ended: House) -> None:
    text = summary_text(record_of(ended))

    assert text.splitlines()[0].startswith("completed: 1 junction passed, ")
    assert "Mill Lane" in text
    assert text.splitlines()[-1] == ended.plan.osm.attribution


def test_a_drive_that_cannot_be_summed_up_is_over_and_kept(
    ended: House, caplog: pytest.LogCaptureFixture
) -> None:
    record = record_of(ended)
    assert summed_up(record) == (summary_text(record), False)
    text, failed = summed_up(record | {"agreement": {"windows": "many"}})
    assert text.startswith("completed: run.json says")
    assert failed
    assert "Traceback" in caplog.text


def test_the_summary_says_how_often_the_free_twin_was_beyond_a_limit(house: House) -> None:
    record = record_of(house)
    assert "left to itself" not in summary_text(record)

    record["free_twin"] = {"samples": 200, "beyond_limits": 3}
    assert "\n  the twin, left to itself, was beyond a limit 1.5% of the time\n" in summary_text(
        record
    )


def test_the_summary_says_where_the_map_helped_to_find_the_car(house: House) -> None:
    record = record_of(house)
    assert "GNSS" not in summary_text(record)

    record["telemetry"]["position_from"] = ["gnss", "map"]
    assert "\n  the car's position came from GNSS and the map\n" in summary_text(record)


@pytest.mark.parametrize(
    ("start_s", "before_s", "within_at_s", "said"),
    [
        (0.0, 0.008, 0.1, "its world was ready before the drive began"),
        (60.0, 0.008, 60.1, "its world was ready before the drive began"),
        (0.0, 17.82, 20.1, "): its world was ready 17.8 s before the car came near"),
        (0.0, -2.34, 0.1, "its world came 2.3 s late"),
        (0.0, -2.34, 20.1, "its world came 2.3 s late"),
    ],
)
def test_the_summary_says_when_a_world_was_ready(
    ended: House, start_s: float, before_s: float, within_at_s: float, said: str
) -> None:
    record = record_of(ended)
    record["config"]["start_s"] = start_s
    record["intersections"][0] |= {
        "world_ready_before_s": before_s, "within_radius_at_s": within_at_s,
    }  # fmt: skip

    assert said in summary_text(record)


def test_the_summary_says_how_soon_results_came_where_a_clock_ran(ended: House) -> None:
    record = record_of(ended) | {"state_to_result_ms_p95": 9123.4}
    first = summary_text(record).splitlines()[0]
    assert first.endswith("missed), 95 % within 9.1 s of the state")
    record["config"]["speed"] = None
    first = summary_text(record).splitlines()[0]
    assert first.endswith("missed), in lock step: the drive waited for each")
    record["state_to_result_ms_p95"] = None
    assert summary_text(record).splitlines()[0].endswith("missed)")


def test_a_drive_in_lock_step_waits_for_its_worlds_and_is_never_late(ended: House) -> None:
    record = record_of(ended)
    record["config"]["speed"] = None
    record["intersections"][0]["world_ready_before_s"] = -2.34
    assert "): its world was ready\n" in summary_text(record)
    record["intersections"][0]["built_at_s"] = None
    assert "): its world never came\n" in summary_text(record)


def test_the_summary_says_in_how_many_futures_a_scenario_was_not_placed(house: House) -> None:
    record = record_of(house)
    assert "not placed" not in summary_text(record)

    record["futures"]["not_placed"] = {"behind": 40, "beyond": 9, "in a house": 8, "in a pond": 2}
    told = "behind (40); beyond (9); in a house (8); other reasons (2)"
    said = f"\n  in 59 of the futures the scenario was not placed: {told}\n"
    assert said in summary_text(record)


def test_it_is_said_of_how_many_futures_another_planner_drove_and_how_many_failed(
    house: House,
) -> None:
    record = record_of(house)
    assert (record["futures"]["failed"], record["futures"]["remarked"]) == ({}, {})
    assert "planner" not in summary_text(record)

    record["futures"] |= {"count": 20, "remarked": {"the fallback acted": 14}, "failed": {"NaN": 3}}
    said = "\n  of 14 of the futures their planner has to say: the fallback acted (14)\n"
    assert said in summary_text(record)
    assert lost_lines(record) == ["failed: 3 of 20 futures: NaN (3)"]


def test_the_summary_owns_up_to_what_a_slow_machine_left_out(ended: House) -> None:
    record = record_of(ended)
    assert "too slow" not in summary_text(record)
    record["futures"] |= {
        "smaller_rounds": 12, "spared_rounds": 3, "rounds_by_futures": {"3": 12, "6": 2},
    }  # fmt: skip

    assert (
        "too slow for 6 futures in every round: 12 had 3, 2 had 6, 3 were left out\n"
        in summary_text(record)
    )
