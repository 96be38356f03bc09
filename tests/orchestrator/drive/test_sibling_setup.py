"""The second engine's process: a worker for two futures that gives way, where it can be there."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.errors import UserError
from foretwin.contracts.setup import WorkerSetup
from foretwin.contracts.siblings import Siblings
from foretwin.orchestrator.config import DriveConfig
from foretwin.orchestrator.drive import sibling_setup
from foretwin.orchestrator.drive.processes import rows_by_id
from foretwin.orchestrator.rounds.siblings import SIBLING
from tests.orchestrator.trip import town_plan

MULTIBODY = Siblings(engine="multibody")


def test_it_is_a_worker_for_two_futures_that_gives_way_from_its_start(tmp_path: Path) -> None:
    plan = town_plan(tmp_path, siblings=MULTIBODY)
    row = rows_by_id(plan)[SIBLING]
    setup = row.setup(plan, SIBLING)
    assert isinstance(setup, WorkerSetup)
    assert (setup.role, setup.simulations, setup.gives_way, row.nice) == ("futures", 2, True, 19)
    assert (setup.kept_worlds, setup.vehicle) == (3, plan.vehicle)
    assert "pure_pursuit_idm" in setup.planners


def test_in_lock_step_which_waits_for_it_it_does_not_give_way(tmp_path: Path) -> None:
    plan = town_plan(tmp_path, siblings=MULTIBODY, speed=None)
    row = rows_by_id(plan)[SIBLING]
    setup = row.setup(plan, SIBLING)
    assert isinstance(setup, WorkerSetup)
    assert (setup.gives_way, row.nice) == (False, 0)
    assert {one.nice for one in rows_by_id(plan).values()} == {0}


def test_a_drive_has_none_unless_asked(tmp_path: Path) -> None:
    assert SIBLING not in rows_by_id(town_plan(tmp_path))


def test_what_cannot_be_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    sibling_setup.check(DriveConfig(siblings=MULTIBODY))
    with pytest.raises(UserError, match="siblings: share 0: above 0, at most 1"):
        DriveConfig(siblings=Siblings(share=0.0)).validate()
    with pytest.raises(UserError, match="siblings: --planner remote is a process"):
        sibling_setup.check(DriveConfig(siblings=MULTIBODY, planner="remote"))
    sibling_setup.check(DriveConfig(planner="remote"))
    monkeypatch.setattr(sibling_setup, "trouble_with_engine", lambda name: f"no {name} here")
    with pytest.raises(UserError, match="siblings, engine gazebo: no gazebo here"):
        sibling_setup.check(DriveConfig(siblings=Siblings(engine="gazebo")))
