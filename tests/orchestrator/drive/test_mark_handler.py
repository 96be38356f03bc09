"""Events that somebody marks: rows of the run, events for those who watch, refusals with a line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from foretwin.contracts.bus import Mailbox
from foretwin.contracts.marks import MarkReply, MarkRequest
from tests.orchestrator.house import House

COVERS = ("foretwin.contracts.marks",)


@pytest.fixture
def house(tmp_path: Path) -> House:
    return House(tmp_path)


def marked(house: House, **fields: Any) -> Any:
    asked = MarkRequest(**{"mark_id": "m1", "by": "co-pilot", "utc_ns": 5, **fields})
    answers = Mailbox(1)
    house.bus.request("mark", asked, answers, run=house.plan.run_id)
    house.settle()
    return answers.take()


def rows(house: House) -> list[dict[str, Any]]:
    house.tables.close()
    return pq.read_table(house.plan.folder / "results" / "marks.parquet").to_pylist()


def test_a_mark_is_kept_with_when_where_and_by_whom(house: House) -> None:
    house.drive(20)
    state = house.conductor.intake.latest.state
    reply = marked(house, note="cut in").message

    start_ns = house.conductor.intake.start_stamp_ns
    drive_s = pytest.approx((state.stamp_ns - start_ns) / 1e9)
    assert reply == MarkReply(
        mark_id="m1", stamp_ns=state.stamp_ns, drive_time_s=reply.drive_time_s, count=1
    )
    assert reply.drive_time_s == drive_s
    told = [one.text for one in house.watched("event") if "marked" in one.text]
    assert told == [f"marked at {reply.drive_time_s:.1f} s by co-pilot: cut in"]
    assert rows(house) == [
        {
            "mark_id": "m1",
            "stamp_ns": state.stamp_ns,
            "drive_time_s": drive_s,
            "utc_ns": 5,
            "by": "co-pilot",
            "note": "cut in",
            "junction_id": house.mission.junction_id,
            "lat_deg": state.position.lat_deg,
            "lon_deg": state.position.lon_deg,
        }
    ]
    assert house.mission.junction_id is not None


def test_a_note_that_comes_later_keeps_the_stamp_and_counts_no_second_mark(house: House) -> None:
    house.drive(5)
    first = marked(house).message
    house.drive(15)
    later = marked(house, note="tram", by="driver").message
    second = marked(house, mark_id="m2").message

    assert (later.stamp_ns, later.count) == (first.stamp_ns, 1)
    assert second.stamp_ns > first.stamp_ns
    assert second.count == 2
    kept = rows(house)
    assert [(one["mark_id"], one["note"], one["by"]) for one in kept] == [
        ("m1", "", "co-pilot"),
        ("m1", "tram", "driver"),
        ("m2", "", "co-pilot"),
    ]
    assert [one["lat_deg"] is None for one in kept] == [False, True, False]


def test_a_note_finds_its_mark_by_its_stamp_where_another_orchestrator_took_it(
    house: House,
) -> None:
    house.drive(15)
    stamp_ns = house.states[3].stamp_ns
    assert marked(house, stamp_ns=stamp_ns, note="tram").message.stamp_ns == stamp_ns


@pytest.mark.parametrize(
    "wrong",
    [{"mark_id": ""}, {"mark_id": "x" * 65}, {"by": "x" * 65}, {"note": "x" * 2001}],
)
def test_what_is_no_mark_is_answered_and_counted(house: House, wrong: dict[str, str]) -> None:
    reply = marked(house, **wrong)
    assert reply.message is None
    assert "mark" in reply.error
    assert house.conductor.refusals.record()["refused"]
    assert rows(house) == []
