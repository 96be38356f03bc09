"""What is left out of a message or a file means nothing, none or zero, but for what is listed."""

from __future__ import annotations

import importlib
import pkgutil
from typing import Any

import msgspec
import pytest

from foretwin import contracts
from foretwin.contracts import (
    anchor,
    anchor_file,
    beside_road,
    camera_image,
    campaign,
    codec,
    cpu_use,
    credentials,
    drive,
    elevation,
    fleet,
    forecast,
    frames,
    futures,
    gap,
    guard,
    layout,
    lights,
    marks,
    numbering,
    parts,
    placement,
    planner_link,
    planner_serving,
    point_cloud,
    process_setup,
    provenance,
    radar_list,
    refusal_counts,
    roads_shown,
    roles,
    runner,
    scenario,
    segments,
    sensed_motion,
    sensor_drift,
    sensor_turns,
    setup,
    siblings,
    side_by_side,
    signals,
    simulation,
    tally,
    towards_vehicle,
    tracks,
    tuning,
    vehicle,
    virtual_traffic,
    world,
    world_building,
)

COVERS = (
    "foretwin.contracts.drive",
    "foretwin.contracts.parts",
    "foretwin.contracts.process_setup",
    "foretwin.contracts.simulation",
    "foretwin.contracts.towards_vehicle",
    "foretwin.contracts.tuning",
)

OSM = "© OpenStreetMap contributors"
LISTED: dict[str, dict[str, Any]] = {
    "ActorPart": {
        "kind": "car", "turn": "straight", "speed_mps": 8.33, "conduct": "heedless",
        "impact_share": 0.5, "gap_m": 20.0, "decel_mps2": 4.0,
    },
    "Anchor": {"scale": 1.0},
    "AnchorFile": {"scale": 1.0},
    "Area": {"source": "inferred"},
    "Connection": {"control": "none"},
    "Drift": {"time_s": 100.0},
    "DriveEnd": {"reason": "end of source"},
    "EnlistRequest": {"simulations": 32, "kept_worlds": 8, "control_hz": 20.0},
    "EgoPart": {"turn": "straight", "speed_mps": 8.33},
    "Mount": {"forward_m": 1.4, "up_m": 1.9},
    "FollowLimits": {
        "accel_mps2": 1.0, "jerk_mps3": 2.0, "yaw_accel_radps2": 0.3, "yaw_jerk_radps3": 0.6,
        "reach_m": 20.0,
    },
    "Future": {"planner": "pure_pursuit_idm"},
    "CopilotSetup": {
        "host": "127.0.0.1", "attribution": OSM, "seat": "co-pilot", "awaited": True,
    },
    "GapAlarm": {"over": True},
    "Job": {"accident_motion": True, "control_hz": 20.0, "engine": "mujoco", "schema_version": 1},
    "Lane": {
        "turns_source": "inferred", "direction_source": "inferred", "change": "both",
        "change_source": "default",
    },
    "LayoutColumn": {"share": 1.0},
    "LayoutRow": {"share": 1.0},
    "MirrorSample": {"role": "all"},
    "OwnRefusals": {"counted_all": True},
    "Parameter": {"source": "default"},
    "PlannedMotions": {"link": 1},
    "PlannerJoined": {"link": 1},
    "PlannerScene": {"link": 1},
    "PlannerTiming": {"rate_hz": 10.0},
    "ProcessSetup": {"grace_s": 30.0},
    "ReplaySetup": {"speed": 1.0},
    "Road": {"lane_count_source": "inferred"},
    "Roll": {"most_bytes": 67_108_864, "most_s": 3600.0},
    "Scenario": {"horizon_s": 8.0, "lead_time_s": 4.0, "samples": 1},
    "SensorSetup": {"sees": "world"},
    "Siblings": {"engine": "off", "share": 0.2},
    "StackSetup": {"instances": 1, "answer_within_s": 60.0, "start_within_s": 120.0},
    "StandinSetup": {"speed": 1.0},
    "Tally": {"part": 1},
    "TrafficCourse": {"on": True},
    "VehicleFile": {"scale": 1.0},
    "VehicleInfo": {"reference_point": "unknown"},
    "VehicleState": {"yaw_valid": True, "control_mode": "unknown"},
    "VehicleStatus": {"control_mode": "unknown", "gear": "unknown", "indicator": "unknown"},
    "ViewerSetup": {
        "live": "none", "page_port": 9090, "title": "foretwin", "attribution": OSM,
    },
    "VirtualTraffic": {"source": "off", "scenario": "cpta", "count": 20},
    "Where": {"setting": "junction"},
    "WorkerSetup": {
        "simulations": 32, "kept_worlds": 8, "control_hz": 20.0, "mirror_window_s": 8.0,
        "mirror_rate_hz": 10.0, "threads": 1,
    },
    "World": {"attribution": OSM},
    "WorldPlaces": {"attribution": OSM},
}  # fmt: skip
"""Of faults those that are neutral are listed in the table of numbers."""
FILES = (campaign, credentials, process_setup, roles, scenario, segments, setup, vehicle)
MESSAGES = (
    anchor, anchor_file, beside_road, camera_image, cpu_use, drive, elevation, fleet, forecast,
    frames, futures, gap, layout, lights, marks, numbering, parts, placement, planner_link,
    planner_serving, point_cloud, provenance, radar_list, refusal_counts, roads_shown, runner,
    sensed_motion, sensor_drift, sensor_turns, siblings, side_by_side, signals, simulation, tally,
    towards_vehicle, tracks, tuning, virtual_traffic, world, world_building,
)  # fmt: skip
KINDS = sorted(
    {
        kind
        for module in (*FILES, *MESSAGES)
        for kind in vars(module).values()
        if isinstance(kind, type)
        and issubclass(kind, msgspec.Struct)
        and kind is not msgspec.Struct
    },
    key=lambda kind: kind.__name__,
)


def nothing(default: Any) -> Any:
    """Return what says nothing in the place of a default."""
    if isinstance(default, msgspec.Struct):
        told = [field for field in msgspec.structs.fields(type(default)) if field.required]
        return type(default)(**{field.name: field.type() for field in told})
    return None if default is None else type(default)()


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_what_is_not_said_is_nothing_or_listed(kind: type[msgspec.Struct]) -> None:
    if kind is scenario.FaultPart:
        return
    listed: dict[str, Any] = {}
    for one in reversed(kind.__mro__):
        listed |= LISTED.get(one.__name__, {})
    for field in msgspec.structs.fields(kind):
        default = field.default
        if field.default_factory is not msgspec.NODEFAULT:
            default = field.default_factory()
        if default is not msgspec.NODEFAULT:  # else it has to be said
            assert default == listed.get(field.name, nothing(default)), field.name


def test_no_type_of_a_message_or_file_is_left_out() -> None:
    named = {module.__name__ for module in (*FILES, *MESSAGES)}
    for module in pkgutil.iter_modules(contracts.__path__, f"{contracts.__name__}."):
        kinds = vars(importlib.import_module(module.name)).values()
        own = [kind for kind in kinds if getattr(kind, "__module__", "") == module.name]
        if any(isinstance(one, type) and issubclass(one, msgspec.Struct) for one in own):
            assert module.name in named


def test_everything_listed_is_there() -> None:
    fields = {kind.__name__: {f.name for f in msgspec.structs.fields(kind)} for kind in KINDS}
    for name, listed in LISTED.items():
        assert listed.keys() <= fields[name]


@pytest.mark.parametrize("module", FILES, ids=lambda module: module.__name__)
def test_what_a_file_holds_that_nobody_knows_is_refused(module: Any) -> None:
    """A word that is spelt wrong would be passed over otherwise."""
    of_module = [kind for kind in KINDS if kind.__module__ == module.__name__]
    read = [kind for kind in of_module if kind.__name__ not in WRITTEN_ONLY]
    assert read
    assert all(kind.__struct_config__.forbid_unknown_fields for kind in read)


WRITTEN_ONLY = {
    "UseRoles", "OtherVehicle", "OtherVehicles", "CastVehicle", "MirrorCast", "Parameter",
    "VehicleEncounter", "JoinRequest", "JoinReply",
}  # fmt: skip
"""Messages, and what stands in a file that says itself what it knows."""


def test_nothing_was_left_out_of_a_message_that_was_not_told() -> None:
    message = drive.SpeedSample(stamp_ns=1, speed_mps=2.0)
    assert codec.Envelope(1, 2, message).left_out == 0
    assert guard.Admitted(message).left_out == 0
    assert runner.TaskCount() == runner.TaskCount(given=0, results=0, refused=0, lost=0)
