"""Which processes a drive consists of, and what each is started with."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec

from foretwin.contracts.anchor import Anchor
from foretwin.contracts.anchor_file import AnchorFile
from foretwin.contracts.credentials import make_credentials
from foretwin.contracts.local_bus import LocalBus
from foretwin.contracts.process_setup import BusSetup
from foretwin.contracts.setup import CopilotSetup, ViewerSetup, WorkerSetup
from foretwin.orchestrator.config import OtherVehicleConfig
from foretwin.orchestrator.drive.processes import (
    PROCESSES,
    TUNING,
    expected_ids,
    member,
    process_ids,
    row_of,
)
from foretwin.orchestrator.drive.watcher_setups import COPILOT, VIEWER, copilot_address
from foretwin.orchestrator.plan import DrivePlan, OtherVehiclePlan
from foretwin.telemetry.ros2.mapping import MappingFile, read_mapping
from tests.contracts.test_anchor import LOT, WORLD
from tests.orchestrator.trip import town_plan

COVERS = (
    "foretwin.orchestrator.drive.traffic_setup",
    "foretwin.orchestrator.drive.watcher_setups",
    "foretwin.orchestrator.other_vehicle_config",
)


def configured(plan: DrivePlan, **settings: object) -> DrivePlan:
    return replace(plan, config=msgspec.structs.replace(plan.config, **settings))


def ids(plan: DrivePlan) -> list[str]:
    return [one for row in PROCESSES for one in process_ids(row, plan)]


def autoware() -> MappingFile:
    return read_mapping(Path("autoware"))


def test_a_drive_has_its_workers_one_source_and_what_it_is_asked_for(tmp_path: Path) -> None:
    plan = configured(town_plan(tmp_path), workers=3, tuning="off", source="standin")
    workers = ["w0", "w1", "w2"]
    others = ["mirror", "recorder", "viewer", "vehicle"]
    assert ids(plan) == ["router", "builder", *workers, *others]
    assert expected_ids(plan) == {"builder", *workers, *others}, "who says that it is alive"
    assert TUNING in ids(configured(plan, tuning="report"))
    live = configured(plan, source="live")
    assert "vehicle" not in ids(live)
    assert "ros2" in ids(replace(live, ros2=autoware()))


def test_each_vehicle_beside_with_topics_of_its_own_has_its_gateway(tmp_path: Path) -> None:
    plan = configured(town_plan(tmp_path), tuning="off")
    anchor = Anchor(lot=LOT, world=WORLD)
    beside = tuple(
        OtherVehiclePlan(
            OtherVehicleConfig(id=name, live=True), plan.vehicle, True, ros2=topics, lot=lot
        )
        for name, topics, lot in (
            ("a", autoware(), None),
            ("b", None, None),
            ("c", autoware(), anchor),
        )
    )
    plan = replace(plan, beside=beside)
    (row,) = (row for row in PROCESSES if row.name == "ros2-beside")
    setups = [row.setup(plan, one) for one in process_ids(row, plan)]
    assert [setup.process_id for setup in setups] == ["ros2-beside0", "ros2-beside1"]
    assert [setup.vehicle_id for setup in setups] == ["a", "c"]
    assert [setup.anchor for setup in setups] == [None, anchor]  # type: ignore[attr-defined]


def test_every_process_is_started_for_this_run_and_the_mirror_plays_no_futures(
    tmp_path: Path,
) -> None:
    plan = configured(town_plan(tmp_path), source="standin")
    setups = {one: row.setup(plan, one) for row in PROCESSES for one in process_ids(row, plan)}
    assert all(setup.process_id == one for one, setup in setups.items())
    assert {(setup.run_id, setup.bus) for setup in setups.values()} == {(plan.run_id, plan.bus)}
    mirror, worker = setups["mirror"], setups["w0"]
    assert isinstance(mirror, WorkerSetup)
    assert isinstance(worker, WorkerSetup)
    assert (mirror.role, worker.role, mirror.planners) == ("mirror", "futures", ())
    assert plan.config.planner in worker.planners


def test_the_lot_of_a_car_is_drawn_with_its_fence(tmp_path: Path) -> None:
    plan, fence = town_plan(tmp_path), ((1.0, 2.0), (1.0, 3.0), (2.0, 3.0))
    (row,) = (row for row in PROCESSES if row.name == VIEWER)
    for file in (AnchorFile(lot=LOT, world=WORLD, fence=fence), None):
        setup = row.setup(replace(plan, anchor=file), VIEWER)
        assert isinstance(setup, ViewerSetup)
        drawn = (setup.anchor, setup.fence)
        assert drawn == (None, ()) if file is None else drawn == (file.anchor, fence)


def test_in_lock_step_tuning_does_not_begin_in_the_middle(tmp_path: Path) -> None:
    plan = town_plan(tmp_path)
    (row,) = (row for row in PROCESSES if row.name == TUNING)
    assert row_of(row, configured(plan, speed=1.0)).when_dead == "restart"
    assert row_of(row, configured(plan, speed=None)).when_dead == "report"


def test_the_copilot_display_is_a_viewer_whose_page_may_change_roles(tmp_path: Path) -> None:
    plan = configured(town_plan(tmp_path))
    assert COPILOT not in ids(plan)
    assert copilot_address(plan, plan.bus) is None
    make_credentials(tmp_path, ["viewer-copilot"])
    local = LocalBus(BusSetup(endpoint="unixsock-stream/x"), tmp_path)
    plan = replace(plan, copilot_port=8123, local=local)
    assert COPILOT in ids(plan)
    assert COPILOT in expected_ids(plan)
    own = plan.bus_of(member(plan, COPILOT))
    assert (member(plan, COPILOT).role, member(plan, COPILOT).name) == ("viewer", "viewer-copilot")
    (row,) = (one for one in PROCESSES if one.name == COPILOT)
    setup = row.setup(plan, COPILOT)
    assert isinstance(setup, CopilotSetup)
    assert (setup.host, setup.port, setup.bus) == ("127.0.0.1", 8123, own)
    assert setup.operator == local.setup_of("operator")
    address = copilot_address(plan, own)
    assert address is not None
    assert address.startswith("http://127.0.0.1:8123/")
    assert row.setup(replace(plan, local=None), COPILOT).operator is None
