"""What chaos has found, played again by itself: faults that were too much together."""

from __future__ import annotations

import shutil

import pytest

from tests.chaos.drive import carry_out
from tests.chaos.faults import Case, Fault

pytestmark = [pytest.mark.chaos, pytest.mark.judge, pytest.mark.timeout(600)]

FOUND = {
    # Log, parameters and the router's word were written once more, which ended the next one.
    "the orchestrator and the router die while the disk is full": (
        Fault(2.0, "full", "disk", 8.0), Fault(4.0, "kill", "orchestrator"),
        Fault(6.0, "kill", "router"), Fault(7.0, "segv", "orchestrator"),
        Fault(7.5, "kill", "w"),
    ),
    # What the car had to say then, and kept, was asked for once, when nobody could answer yet.
    "the router dies while a car that stood still catches up": (
        Fault(3.0, "stop", "vehicle", 2.6), Fault(5.7, "hup", "router"),
        Fault(9.0, "stop", "vehicle", 2.6), Fault(11.7, "kill", "router"),
    ),
    # What waited for room in its memory was given up as unwritten.
    "the recorder is ended while the disk is full": (
        Fault(3.0, "full", "disk", 6.0), Fault(5.0, "term", "recorder"),
        Fault(7.5, "term", "recorder"),
    ),
    # Its last word was said while the orchestrator had no link, and the drive went on for ever.
    "the car ends while the orchestrator stands still": (Fault(19.0, "stop", "orchestrator", 9.9),),
    "everybody dies while the supervisor stands still": (
        Fault(2.0, "stop", "supervisor", 8.0), Fault(4.0, "kill", "router"),
        Fault(4.5, "kill", "orchestrator"), Fault(5.0, "segv", "recorder"),
        Fault(5.5, "kill", "w"), Fault(6.0, "kill", "viewer"), Fault(6.5, "kill", "mirror"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FOUND)
def test_what_was_found_once_goes_well(name: str) -> None:
    outcome = carry_out(Case(1, 0, "standin", "socket", False, FOUND[name]))
    assert outcome.wrong == []
    assert len(outcome.done) == len(FOUND[name])
    assert outcome.code in (0, 3)
    assert not any(one.lost_s for one in outcome.done)
    if outcome.folder.exists():
        shutil.rmtree(outcome.folder)
