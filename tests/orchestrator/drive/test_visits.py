"""Visits: when a World was asked for, ready and needed, and when the car was there."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.running import MOST_LISTED
from foretwin.orchestrator.drive import visits
from foretwin.orchestrator.drive.visits import Moment, VisitBook
from foretwin.orchestrator.record.visited import by_passage
from foretwin.world_gen.junctions.intersections import Junction
from tests.orchestrator.grid_map import FRAME, grid, junctions
from tests.orchestrator.trip import world_named

JUNCTION = junctions(grid(3, 3))[0]
NAME = JUNCTION.summary.id
WORLD = world_named(NAME, FRAME)


def seen() -> VisitBook:
    book = VisitBook()
    assert book.see(JUNCTION, Moment(100.0, 0.0), load=True)
    return book


def _called(name: str) -> Junction:
    summary = msgspec.structs.replace(JUNCTION.summary, id=name)
    return msgspec.structs.replace(JUNCTION, summary=summary)


def ready_before_s(book: VisitBook, *, mono_s: float) -> float:
    (visit,) = book.arrived
    return visit.record(mono_s=mono_s)["world_ready_before_s"]


def test_a_world_is_ready_before_by_the_time_until_the_car_enters_its_radius() -> None:
    book = seen()
    book.take_world(NAME, WORLD, Moment(103.0, 3.0))
    book.enter(NAME, Moment(120.0, 20.0))
    book.enter(NAME, Moment(121.0, 21.0))
    book.arrive(NAME, Moment(135.0, 35.0))

    (visit,) = book.arrived
    record = visit.record(mono_s=500.0)
    assert (record["built_at_s"], record["arrived_at_s"]) == (3.0, 35.0)
    assert record["within_radius_at_s"] == 20.0
    assert record["world_ready_before_s"] == 17.0


def test_a_world_that_came_after_the_car_is_late_by_the_time_between() -> None:
    book = seen()
    book.enter(NAME, Moment(120.0, 20.0))
    book.arrive(NAME, Moment(135.0, 35.0))
    book.take_world(NAME, WORLD, Moment(140.0, 40.0))

    assert ready_before_s(book, mono_s=500.0) == -20.0


def test_a_world_that_never_came_is_late_and_never_null() -> None:
    book = seen()
    book.enter(NAME, Moment(120.0, 20.0))
    book.arrive(NAME, Moment(135.0, 35.0))

    assert ready_before_s(book, mono_s=150.0) == -30.0
    (visit,) = book.arrived
    assert visit.record(mono_s=150.0)["built_at_s"] is None


def test_a_car_that_was_there_before_it_was_near_entered_on_arrival() -> None:
    book = seen()
    book.take_world(NAME, WORLD, Moment(103.0, 3.0))
    book.arrive(NAME, Moment(135.0, 35.0))

    assert ready_before_s(book, mono_s=500.0) == 32.0


def test_seeing_a_junction_again_asks_for_nothing_until_more_is_wanted() -> None:
    book = VisitBook()
    assert book.see(JUNCTION, Moment(0.0, 0.0), load=False)
    assert not book.see(JUNCTION, Moment(1.0, 1.0), load=False)
    assert book.see(JUNCTION, Moment(2.0, 2.0), load=True)
    assert not book.see(JUNCTION, Moment(3.0, 3.0), load=True)
    assert not book.see(JUNCTION, Moment(4.0, 4.0), load=False)
    assert book.latest(NAME).load


def test_a_junction_never_seen_has_no_visit() -> None:
    book = VisitBook()

    assert book.get(NAME) is None
    with pytest.raises(KeyError):
        book.latest(NAME)
    book.enter(NAME, Moment(0.0, 0.0))
    assert not book.arrived


def test_a_world_without_hope_stays_so_on_the_next_passage() -> None:
    book = seen()
    book.latest(NAME).failed = True
    book.arrive(NAME, Moment(110.0, 10.0))

    assert not book.see(JUNCTION, Moment(111.0, 11.0), load=True)
    assert book.latest(NAME) not in book.arrived
    assert book.latest(NAME).failed


def test_a_day_of_junctions_keeps_the_worlds_of_those_seen_lately(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(visits, "MOST_JUNCTIONS", 2)
    book, places = VisitBook(), junctions(grid(4, 4))
    first, second, third, *_ = places
    for at_s, junction in ((0.0, first), (10.0, second), (20.0, third)):
        assert book.see(junction, Moment(at_s, at_s), load=True)
        book.take_world(junction.summary.id, WORLD, Moment(at_s, at_s))
    assert book.get(first.summary.id) is not None, "seen lately"
    late = Moment(500.0, 500.0)
    book.arrive(first.summary.id, late)
    assert not book.see(second, late, load=True), "known still"
    assert book.see(places[3], late, load=True)
    assert book.get(first.summary.id) is None
    (visit,) = book.arrived
    assert visit.world is None
    assert visit.record(mono_s=600.0)["built_at_s"] == 0.0
    assert book.see(first, late, load=True), "as new"
    book.take_world("never seen", WORLD, late)


def test_more_passages_than_are_listed_are_counted() -> None:
    book = seen()
    for at_s in range(MOST_LISTED + 5):
        book.arrive(NAME, Moment(at_s, at_s))
        book.see(JUNCTION, Moment(at_s, at_s), load=True)
    assert (len(book.arrived), book.arrived.left_out) == (MOST_LISTED, 5)


@given(st.lists(st.tuples(st.sampled_from("ab"), st.sampled_from(["round", "arrival"]))))
def test_rounds_are_counted_as_tables_tell_them_afterwards(
    happens: list[tuple[str, str]],
) -> None:
    """Around a block of houses a junction is ahead again as soon as the car has passed it."""
    book = VisitBook()
    rounds: list[dict[str, Any]] = []
    reached: list[dict[str, Any]] = []
    places = {name: _called(name) for name in "ab"}
    for at_s, (name, what) in enumerate(happens, start=1):
        now = Moment(at_s, at_s)
        for one in places.values():
            book.see(one, now, load=True)
        if what == "round":
            book.count_round(name, futures=at_s)
            row = {"intersection_id": name, "drive_time_s": at_s, "futures": at_s}
            rounds.append(row)
        else:
            book.arrive(name, now)
            reached.append({"id": name, "arrived_at_s": at_s})

    counted = [(one["rounds"], one["futures"]) for one in book.records(mono_s=0.0)]

    told = by_passage(rounds, reached)
    of = [told.get((one["id"], place), []) for place, one in enumerate(reached)]
    assert counted == [(len(rows), sum(row["futures"] for row in rows)) for rows in of]


def test_a_junction_is_known_by_its_streets_where_they_have_names() -> None:
    book = seen()
    assert book.name_of(NAME) == NAME
    named = msgspec.structs.replace(JUNCTION.summary, id="n99", name="Mill Lane")
    book.see(msgspec.structs.replace(JUNCTION, summary=named), Moment(0.0, 0.0), load=True)
    assert [book.name_of(one) for one in ("n99", "n2")] == ["Mill Lane", "n2"]
