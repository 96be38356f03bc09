"""Lights of a drive: told ten times a second, and at once where somebody flips one."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from foretwin.contracts.lights import ShownLights
from foretwin.contracts.mailbox import Mailbox
from foretwin.contracts.signals import LearntSignal
from foretwin.contracts.tuning import SetRequest
from tests.orchestrator.house import House
from tests.orchestrator.trip import town, town_world


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    made = House(tmp_path)
    yield made
    made.tables.close()


class Listener:
    """Who drives by the lights of a drive."""

    def __init__(self, house: House) -> None:
        self._mailbox = Mailbox(10_000)
        house.bus.subscribe("lights", self._mailbox, run=house.plan.run_id)

    def heard(self) -> list[ShownLights]:
        found = []
        while (item := self._mailbox.take()) is not None:
            found.append(item.message())
        return found


def signals_world() -> object:
    names = [one.summary.id for one in town().junctions if one.summary.control == "signals"]
    return town_world(names[0])


def test_lights_are_told_ten_times_a_second(house: House) -> None:
    listener = Listener(house)
    house.drive(101)
    told = listener.heard()
    stamps = [one.stamp_ns for one in told]
    assert all(b - a >= 100_000_000 for a, b in pairwise(stamps) if b != a)
    span_s = (house.states[100].stamp_ns - house.states[0].stamp_ns) / 1e9
    assert len(set(stamps)) >= 9 * span_s


def test_a_light_that_is_flipped_is_told_at_once_and_futures_see_it(house: House) -> None:
    listener = Listener(house)
    house.drive(20)
    lights = house.conductor.lights
    lights.use_world(signals_world())  # type: ignore[arg-type]
    group = sorted(lights.in_force.groups)[0]
    listener.heard()
    request = SetRequest(key=f"light.{group}", value="red")
    house.bus.request("set", request, Mailbox(1), run=house.plan.run_id)
    house.settle()
    house.conductor.make_changes()
    last = listener.heard()[-1]
    assert {(one.colour, one.why) for one in last.lights if one.group_id == group} == {
        ("red", "set")
    }
    reports = lights.among(house.conductor.intake.surroundings)
    assert [(one.group_id, one.colour) for one in reports.signals] == [(group, "red")]
    assert reports.signals[0].stamp_ns == house.conductor.intake.now_stamp_ns
    # A cycle that was learnt of it says nothing any more; one of another light does.
    learnt = [
        LearntSignal(
            group_id=name, begins_ns=0, cycle_s=60.0, from_s=(0.0,), colours=("green",), cycles=2,
            spread_s=0.0,
        )
        for name in (group, "another")
    ]  # fmt: skip
    reports = lights.among(reports._replace(learnt_signals=tuple(learnt)))
    assert [one.group_id for one in reports.learnt_signals] == ["another"]


def test_a_flip_waits_for_no_round_in_progress(
    house: House, monkeypatch: pytest.MonkeyPatch
) -> None:
    listener = Listener(house)
    house.drive(20)
    lights = house.conductor.lights
    lights.use_world(signals_world())  # type: ignore[arg-type]
    group = sorted(lights.in_force.groups)[0]
    monkeypatch.setattr(house.conductor.rounds, "open", [1])
    for key, value in ((f"light.{group}", "green"), ("role.ego", "shadow")):
        request = SetRequest(key=key, value=value)
        house.bus.request("set", request, Mailbox(1), run=house.plan.run_id)
    house.settle()
    house.conductor.make_changes()
    assert [change.key for change in house.conductor.changes.made] == [f"light.{group}"]
    assert house.conductor.changes.waiting
    assert "set" in {one.why for one in listener.heard()[-1].lights}
