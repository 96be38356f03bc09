"""The table of processes that a drive consists of, and what each is started with."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from foretwin.contracts.access import BusMember
from foretwin.contracts.keys import BusRole
from foretwin.contracts.local_bus import CAR_OF, OUTSIDERS, member_of
from foretwin.contracts.process_setup import RouterSetup
from foretwin.contracts.roles import CastVehicle, MirrorCast
from foretwin.contracts.setup import (
    BuilderSetup,
    ProcessSetup,
    ReplaySetup,
    Ros2Setup,
    StandinSetup,
    TuningSetup,
    WorkerSetup,
)
from foretwin.orchestrator.drive import sensors_setup as sensors
from foretwin.orchestrator.drive import sibling_setup as sibling
from foretwin.orchestrator.drive import traffic_setup as traffic
from foretwin.orchestrator.drive.watcher_setups import (
    COPILOT,
    RECORDER,
    VIEWER,
    copilot_setup,
    recorder_setup,
    viewer_setup,
)
from foretwin.orchestrator.plan import DrivePlan, OtherVehiclePlan
from foretwin.orchestrator.rounds.jobs import planners_of
from foretwin.orchestrator.runner.supervisor import WhenDead

ORCHESTRATOR, SUPERVISOR = "orchestrator", "supervisor"
ROUTER, BUILDER, MIRROR, TUNING = "router", "builder", "mirror", "tuning"
VEHICLE, ROS2_BESIDE = "vehicle", "ros2-beside"

_ROLES: dict[str, BusRole] = {
    ORCHESTRATOR: "orchestrator",
    RECORDER: "recorder",
    VIEWER: "viewer",
    COPILOT: "viewer",
    VEHICLE: "car",
    "ros2": "car",
    ROS2_BESIDE: "car",
}
"""Roles of processes by name, where it is none of a worker; a gateway speaks for its vehicle."""

_MakesSetup = Callable[[DrivePlan, str], ProcessSetup]


class ProcessRow(NamedTuple):
    """A kind of process: module below `foretwin`, when it runs, how many, what its death does."""

    name: str
    module: str
    when_dead: WhenDead
    setup: _MakesSetup
    nice: int = 0
    """Added to the scheduling niceness: who writes for later gives way to who is waited for."""
    runs: Callable[[DrivePlan], bool] = lambda _: True
    how_many: Callable[[DrivePlan], int] | None = None
    """So many there are, each named with a number; None for the one process of this name."""


def member(plan: DrivePlan, process_id: str) -> BusMember:
    """Return as whom a process speaks on the bus."""
    role = _ROLES.get(process_id.rstrip("0123456789"), _ROLES.get(process_id, "worker"))
    vehicle_id = plan.config.vehicle_id
    if process_id.startswith(ROS2_BESIDE):
        vehicle_id = _beside(plan, process_id).config.id
    return member_of(role, process_id, vehicle_id=vehicle_id)


def members(plan: DrivePlan) -> tuple[BusMember, ...]:
    """Return everybody who may join the bus of a drive."""
    config = plan.config
    outside = [other.id for other in config.vehicles if other.live and other.ros2 is None]
    if config.resolved_source == "live" and plan.ros2 is None:
        outside.append(config.vehicle_id)
    return (
        *(member(plan, one) for one in (ORCHESTRATOR, *sorted(expected_ids(plan)))),
        *(BusMember(f"{CAR_OF}{one}", "car", vehicle_id=one) for one in outside),
        *OUTSIDERS,
    )


def _base(plan: DrivePlan, process_id: str) -> dict[str, Any]:
    return {
        "run_id": plan.run_id,
        "process_id": process_id,
        "vehicle_id": plan.config.vehicle_id,
        "bus": plan.bus_of(member(plan, process_id)),
        "log_file": str(plan.folder / "log.jsonl"),
        "trace_dir": None if plan.trace_dir is None else str(plan.trace_dir),
    }


def _router(plan: DrivePlan, process_id: str) -> ProcessSetup:
    return RouterSetup(
        **_base(plan, process_id) | {"bus": plan.router_bus},
        word_file=str(plan.router_word_file),
        folder=None if plan.local is None else str(plan.local.folder),
    )


def _worker(plan: DrivePlan, process_id: str) -> ProcessSetup:
    return WorkerSetup(
        **_base(plan, process_id),
        role="mirror" if process_id == MIRROR else "futures",
        worlds_dir=str(plan.worlds_dir),
        vehicle=plan.vehicle,
        drive_frame=plan.drive_frame,
        commands_recorded=plan.commands_recorded,
        mirror_cast=MirrorCast(
            others=tuple(
                CastVehicle(
                    vehicle_id=one.config.id,
                    vehicle=one.vehicle,
                    commands_recorded=one.commands_recorded,
                )
                for one in plan.beside
            ),
            limits=plan.config.follow,
        ),
        planners=() if process_id == MIRROR else tuple(planners_of(plan.config.planner)),
    )


def _tuning(plan: DrivePlan, process_id: str) -> ProcessSetup:
    return TuningSetup(
        **_base(plan, process_id),
        vehicle=plan.vehicle,
        drive_frame=plan.drive_frame,
        slopes=None if plan.slopes is None else str(plan.slopes_file),
    )


def _tunes(plan: DrivePlan) -> bool:
    return plan.config.tuning_choice.mode != "off"


def _builder(plan: DrivePlan, process_id: str) -> ProcessSetup:
    clip = plan.clip
    return BuilderSetup(
        **_base(plan, process_id),
        map=str(plan.map_file),
        near_deg=() if clip is None else tuple((a, b) for a, b in clip.line_deg.tolist()),
        margin_m=0.0 if clip is None else clip.margin_m,
        added_roads=plan.added_roads,
        driven_edges=plan.driven_edges,
        dem=plan.config.dem,
        tracks=plan.config.tracks,
        worlds_dir=str(plan.worlds_dir),
        cache_dir=str(plan.config.worlds_cache),
        given_worlds=plan.config.worlds,
    )


def _made_by(made: Callable[[DrivePlan, dict[str, Any]], ProcessSetup]) -> _MakesSetup:
    return lambda plan, process_id: made(plan, _base(plan, process_id))


def _replay(plan: DrivePlan, process_id: str) -> ProcessSetup:
    return ReplaySetup(
        **_base(plan, process_id),
        log=str(plan.log_file),
        start_s=plan.config.start_s,
        end_s=plan.config.end_s,
        speed=plan.config.speed,
        anchor=plan.lot,
    )


def _standin(plan: DrivePlan, process_id: str) -> ProcessSetup:
    return StandinSetup(
        **_base(plan, process_id),
        path_file=str(plan.standin_path_file),
        end_s=plan.config.end_s,
        speed=plan.config.speed,
        seed=plan.config.seed,
        plan_shift_m=plan.config.standin_plan_shift_m,
        parameters_file=plan.config.standin_parameters,
        anchor=plan.lot,
    )


def _ros2(plan: DrivePlan, process_id: str) -> ProcessSetup:
    assert plan.ros2 is not None
    return Ros2Setup(
        **_base(plan, process_id),
        mapping=plan.ros2.text,
        mapping_name=plan.ros2.name,
        drive_frame=plan.drive_frame,
        towards_vehicle=plan.config.towards_vehicle,
        order_keys=plan.order_keys,
        vehicle=plan.vehicle,
        anchor=plan.lot,
        fence=() if plan.anchor is None else plan.anchor.fence,
        mounts=sensors.mounts(plan.sensors),
    )


def _ros2_of_others(plan: DrivePlan) -> list[OtherVehiclePlan]:
    return [one for one in plan.beside if one.ros2 is not None]


def _beside(plan: DrivePlan, process_id: str) -> OtherVehiclePlan:
    return _ros2_of_others(plan)[int(process_id.removeprefix(ROS2_BESIDE))]


def _ros2_beside(plan: DrivePlan, process_id: str) -> ProcessSetup:
    one = _beside(plan, process_id)
    assert one.ros2 is not None
    return Ros2Setup(
        **_base(plan, process_id) | {"vehicle_id": one.config.id},
        mapping=one.ros2.text,
        mapping_name=one.ros2.name,
        drive_frame=plan.drive_frame,
        listens_only=True,
        anchor=one.lot,
    )


def _source_is(source: str) -> Callable[[DrivePlan], bool]:
    return lambda plan: plan.config.resolved_source == source


_REPLAY, _STANDIN = "telemetry.processes.replay", "telemetry.standin"
PROCESSES = (
    ProcessRow(ROUTER, "contracts.router", "restart", _router),
    ProcessRow(BUILDER, "orchestrator.worlds.builder_process", "restart", _builder, nice=10),
    ProcessRow("w", "sim_worker", "restart", _worker, how_many=lambda plan: plan.config.workers),
    ProcessRow(sibling.SIBLING, "sim_worker", "restart", _made_by(sibling.made), 19, sibling.runs),
    ProcessRow(MIRROR, "sim_worker", "restart", _worker),
    ProcessRow(traffic.TRAFFIC, traffic.MODULE, "restart", _made_by(traffic.made), 0, traffic.runs),
    ProcessRow(TUNING, "sim_worker.analysis.process", "restart", _tuning, nice=10, runs=_tunes),
    ProcessRow(sensors.SENSORS, sensors.MODULE, "restart", _made_by(sensors.made), 5, sensors.runs),
    ProcessRow(RECORDER, "telemetry.processes.recorder", "restart", _made_by(recorder_setup)),
    ProcessRow(VIEWER, "viewer", "restart", _made_by(viewer_setup), nice=10),
    ProcessRow(
        COPILOT,
        "viewer.copilot",
        "restart",
        _made_by(copilot_setup),
        nice=5,
        runs=lambda plan: plan.copilot_port is not None,
    ),
    ProcessRow(VEHICLE, _REPLAY, "end_drive", _replay, runs=_source_is("log")),
    ProcessRow(VEHICLE, _STANDIN, "end_drive", _standin, runs=_source_is("standin")),
    # Never started again: what has stopped towards a vehicle must not resume by itself.
    ProcessRow(
        "ros2", "telemetry.ros2", "end_drive", _ros2, runs=lambda plan: plan.ros2 is not None
    ),
    ProcessRow(
        ROS2_BESIDE,
        "telemetry.ros2",
        "restart",
        _ros2_beside,
        how_many=lambda plan: len(_ros2_of_others(plan)),
    ),
)
"""In the order in which they are started: the router before the orchestrator is on the bus, and it
ends after all others; the vehicle waits for the orchestrator's token."""


def row_of(row: ProcessRow, plan: DrivePlan) -> ProcessRow:
    """Return a row as it counts in one drive.

    In lock step nothing may be lost, and what was in a router that died is; nor may anybody begin
    in the middle who answers for all samples from the first one on; and all are waited for.
    """
    if not plan.config.lock_step:
        return row
    may_fall = (TUNING, sensors.SENSORS, RECORDER, VIEWER, COPILOT)
    when_dead: WhenDead = "report" if row.name in may_fall else row.when_dead
    return row._replace(nice=0, when_dead="end_drive" if row.name == ROUTER else when_dead)


def rows_by_id(plan: DrivePlan) -> dict[str, ProcessRow]:
    """Return the row of each process of a drive, in the order in which they are started."""
    return {one: row_of(row, plan) for row in PROCESSES for one in process_ids(row, plan)}


def expected_ids(plan: DrivePlan) -> frozenset[str]:
    """Return the ids of all processes of a drive that say on the bus that they are alive."""
    rows = (row for row in PROCESSES if row.name != ROUTER)
    return frozenset(one for row in rows for one in process_ids(row, plan))


def process_ids(row: ProcessRow, plan: DrivePlan) -> tuple[str, ...]:
    """Return the ids of a row's processes in a drive."""
    if not row.runs(plan):
        return ()
    if row.how_many is None:
        return (row.name,)
    return tuple(f"{row.name}{number}" for number in range(row.how_many(plan)))
