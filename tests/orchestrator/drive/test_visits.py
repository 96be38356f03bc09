"""Visits: when a World was asked for, ready and needed, and when the car was there."""

from __future__ import annotations

import pytest

from foretwin.orchestrator.drive.visits import Moment, VisitBook
from tests.orchestrator.grid_map import FRAME, grid, junctions
from tests.orchestrator.trip import world_named

JUNCTION = junctions(grid(3, 3))[0]
NAME = JUNCTION.summary.id
WORLD = world_named(NAME, FRAME)


def seen() -> VisitBook:
    book = VisitBook()
    assert book.see(JUNCTION, Moment(100.0, 0.0), load=True)
    return book


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
    assert book.arrived == []


def test_a_world_without_hope_stays_so_on_the_next_passage() -> None:
    book = seen()
    book.latest(NAME).failed = True
    book.arrive(NAME, Moment(110.0, 10.0))

    assert not book.see(JUNCTION, Moment(111.0, 11.0), load=True)
    assert book.latest(NAME) is not book.arrived[0]
    assert book.latest(NAME).failed
