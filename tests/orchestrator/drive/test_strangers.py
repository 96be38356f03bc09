"""Whoever says that it belongs to a run is believed where the run started it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from foretwin.orchestrator.drive.strangers import Strangers
from foretwin.orchestrator.instructions import Notice
from tests.orchestrator.house import House, Worker


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    made = House(tmp_path)
    yield made
    made.tables.close()


def test_a_process_that_this_run_did_not_start_is_given_nothing(house: House) -> None:
    house.drive(20)
    house.watched("event")
    strangers = [Worker(house.plan, house.bus, name) for name in ("w42", "w43", "evil")]
    house.settle()
    assert house.conductor.start_round()
    house.work()

    assert [s.jobs + len(s.prepared) for s in strangers] == [0, 0, 0]
    assert house.conductor.strangers.count == 3
    (told,) = (e.text for e in house.watched("event") if e.level == "warning")
    assert told.startswith("'w42' says that it belongs to this run")
    assert house.conductor.rounds.tally.run == 1


def test_a_strangers_name_is_told_so_that_a_terminal_shows_it() -> None:
    told: list[Notice] = []
    strangers = Strangers(frozenset({"w0"}), told.append)
    assert not strangers.refuse("w0", up=True)
    assert strangers.refuse("car-of-second", up=True)
    assert not told, "who speaks for a vehicle wants no work"
    assert strangers.refuse("\x1b[2Jw0", up=True)
    assert strangers.refuse("\x1b[2Jw0", up=False)
    assert strangers.count == 1
    assert told[0].text.isprintable()
