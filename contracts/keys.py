"""The table of channels: every Zenoh key of foretwin with its type, rate and quality of service.

Keys are full expressions under `foretwin/v1/`, each with the vehicle's or the run's id in it.
"""

from __future__ import annotations

import functools
from typing import Literal, NamedTuple

import msgspec

from foretwin.contracts import (
    drive,
    gap,
    placement,
    planner_link,
    roles,
    runner,
    side_by_side,
    simulation,
    towards_vehicle,
    tuning,
)

PREFIX = "foretwin/v1"

Priority = Literal["real_time", "interactive_high", "data_high", "data", "background"]


class Qos(NamedTuple):
    """Zenoh's priority, whether a full queue drops or blocks, and whether batching is skipped."""

    priority: Priority
    block: bool
    express: bool


LIVE = Qos("interactive_high", block=False, express=False)
RESULT = Qos("data_high", block=False, express=False)
WATCH = Qos("data", block=False, express=False)
REQUEST = Qos("interactive_high", block=True, express=True)


class Channel(NamedTuple):
    """One row of the table; `rate_hz` is the usual rate, None where it is on demand."""

    name: str
    key: str
    kind: type[msgspec.Struct]
    reply: type[msgspec.Struct] | None
    rate_hz: float | None
    qos: Qos
    purpose: str


def _row(
    name: str,
    key: str,
    kind: type[msgspec.Struct],
    rate_hz: float | None,
    qos: Qos,
    purpose: str,
    reply: type[msgspec.Struct] | None = None,
) -> Channel:
    return Channel(name, f"{PREFIX}/{key}", kind, reply, rate_hz, qos, purpose)


_TELEMETRY = "vehicle/{vehicle}/telemetry"
_RUN = "run/{run}"

CHANNELS: dict[str, Channel] = {
    channel.name: channel
    for channel in (
        # What the vehicle sends.
        _row("gnss", f"{_TELEMETRY}/gnss", drive.GnssFix, 10, LIVE, "antenna position"),
        _row("imu", f"{_TELEMETRY}/imu", drive.ImuSample, 100, LIVE, "specific force and rates"),
        _row("speed", f"{_TELEMETRY}/speed", drive.SpeedSample, 50, LIVE, "wheel speed"),
        _row("heading", f"{_TELEMETRY}/heading", drive.HeadingSample, 10, LIVE, "measured yaw"),
        _row("steering", f"{_TELEMETRY}/steering", drive.SteeringSample, 50, LIVE, "steering"),
        _row("control", f"{_TELEMETRY}/control", drive.ControlCommand, 50, LIVE, "ADS commands"),
        _row("plan", f"{_TELEMETRY}/plan", drive.PlannedTrajectory, 10, LIVE, "ADS plan"),
        _row("status", f"{_TELEMETRY}/status", drive.VehicleStatus, 10, LIVE, "mode and gear"),
        _row("objects", f"{_TELEMETRY}/objects", drive.RoadUsers, 10, LIVE, "detected road users"),
        _row("signals", f"{_TELEMETRY}/signals", drive.SignalState, 1, LIVE, "signal colours"),
        _row("end", f"{_TELEMETRY}/end", drive.DriveEnd, None, LIVE, "the drive is over"),
        # What is derived from it.
        _row("state", "vehicle/{vehicle}/state", drive.VehicleState, 50, LIVE, "estimated state"),
        _row("route", "vehicle/{vehicle}/route", drive.RouteToGoal, 1, LIVE, "where the ADS goes"),
        # Questions to the vehicle's process.
        _row("info", "vehicle/{vehicle}/info", drive.InfoRequest, None, REQUEST,
             "what the vehicle is", drive.VehicleInfo),
        _row("advance", "vehicle/{vehicle}/advance", drive.AdvanceRequest, None, REQUEST,
             "lock step: go on until", drive.AdvanceReply),
        # Work.
        _row("job", f"{_RUN}/worker/{{process}}/job", runner.JobRequest, 2, REQUEST,
             "simulate futures", runner.JobAnswer),
        _row("place", f"{_RUN}/worker/{{process}}/place", placement.PlaceRequest, None, REQUEST,
             "find places for scenarios", placement.WorldPlaces),
        _row("prepare", f"{_RUN}/worker/{{process}}/prepare", simulation.PrepareRequest, None,
             REQUEST, "load a World", simulation.PrepareReply),
        _row("use_world", f"{_RUN}/worker/{{process}}/use_world", simulation.ActiveWorld, None,
             REQUEST, "the mirror's World", simulation.ActiveWorld),
        _row("use_vehicle", f"{_RUN}/worker/{{process}}/use_vehicle", tuning.UseVehicle, None,
             REQUEST, "parameters from now on", tuning.UseVehicle),
        _row("tune", f"{_RUN}/worker/{{process}}/tune", tuning.TuneRequest, None, REQUEST,
             "lock step: weigh what was sent", tuning.TuneReply),
        _row("use_roles", f"{_RUN}/worker/{{process}}/use_roles", roles.UseRoles, None, REQUEST,
             "the mirror's roles", roles.UseRoles),
        _row("set", f"{_RUN}/set", tuning.SetRequest, None, REQUEST, "change a running drive",
             tuning.SetReply),
        _row("build", f"{_RUN}/builder/{{process}}/build", simulation.BuildRequest, None, REQUEST,
             "build a World", simulation.BuildReply),
        # What those who watch receive.
        _row("round", f"{_RUN}/round", simulation.RoundView, 2, RESULT, "one round of futures"),
        _row("comparison", f"{_RUN}/comparison", simulation.Comparison, 8, RESULT,
             "nominal future against reality"),
        _row("plan_comparison", f"{_RUN}/plan_comparison", simulation.PlanComparison, 2, RESULT,
             "the car's plan against ours"),
        _row("other_vehicles", f"{_RUN}/other_vehicles", roles.OtherVehicles, 50, LIVE,
             "states of the vehicles beside the car"),
        _row("disagreement", f"{_RUN}/disagreement", side_by_side.Disagreement, None, RESULT,
             "human and ADS disagree"),
        _row("mirror", f"{_RUN}/mirror", simulation.MirrorSample, 10, RESULT,
             "twin, shadow, ghost and their gap"),
        _row("gap", f"{_RUN}/gap", gap.GapSample, 4, RESULT, "model against reality"),
        _row("gap_alarm", f"{_RUN}/gap_alarm", gap.GapAlarm, None, RESULT, "a gap beyond limits"),
        _row("verdict", f"{_RUN}/verdict", gap.Verdict, None, RESULT, "which of the two is wrong"),
        _row("identification", f"{_RUN}/identification", tuning.Identification, 0.2, RESULT,
             "what the driving says of the vehicle"),
        _row("parameter", f"{_RUN}/parameter", tuning.ParameterChange, None, RESULT,
             "a parameter that counts from now on"),
        _row("active_world", f"{_RUN}/active_world", simulation.ActiveWorld, None, RESULT,
             "which World counts"),
        _row("world", f"{_RUN}/world", simulation.WorldNotice, None, RESULT, "a World is ready"),
        _row("worker_status", f"{_RUN}/worker_status", simulation.WorkerStatus, 2, WATCH,
             "health of the workers"),
        _row("progress", f"{_RUN}/progress", simulation.Progress, 5, WATCH, "one line"),
        _row("event", f"{_RUN}/event", simulation.Event, None, RESULT, "worth telling"),
        _row("run_end", f"{_RUN}/run_end", simulation.RunEnd, None, RESULT, "write and leave"),
        # Towards a real vehicle, through a gateway that bounds it; off unless switched on twice.
        _row("authority", f"{_RUN}/authority", towards_vehicle.Authority, 20, LIVE,
             "the orchestrator is in charge"),
        _row("vehicle_command", f"{_RUN}/vehicle_command", towards_vehicle.VehicleCommand, 50,
             LIVE, "what the vehicle shall do"),
        _row("virtual_objects", f"{_RUN}/virtual_objects", drive.RoadUsers, 10, LIVE,
             "road users that are simulated"),
        # A driving stack in another process as planner under test.
        _row("planner_scene", f"{_RUN}/worker/{{process}}/planner_scene",
             planner_link.PlannerScene, None, LIVE, "futures at one instant: what to do?"),
        _row("planned_motions", f"{_RUN}/worker/{{process}}/planned_motions",
             planner_link.PlannedMotions, None, LIVE, "what a driving stack would do"),
    )
}  # fmt: skip
"""All channels by name."""

TELEMETRY_CHANNELS = tuple(
    name for name, channel in CHANNELS.items() if "/telemetry/" in channel.key
)
"""What a vehicle may send, `end` included."""

ALIVE_KEY = f"{PREFIX}/{_RUN}/alive/{{process}}"
"""Liveliness token of each process of a run."""


@functools.lru_cache(maxsize=1024)
def key(name: str, *, vehicle: str | None = None, run: str | None = None,
        process: str | None = None) -> str:  # fmt: skip
    """Return the full key of channel `name`; `process` may be `*` in subscriptions.

    Raises KeyError for an unknown channel and ValueError for a missing or malformed id.
    """
    if name not in CHANNELS:
        raise KeyError(f"unknown channel {name!r}; known: {', '.join(sorted(CHANNELS))}")
    return _fill(CHANNELS[name].key, vehicle=vehicle, run=run, process=process)


def alive_key(*, run: str, process: str) -> str:
    """Return the liveliness key of a process, or of all with `*`."""
    return _fill(ALIVE_KEY, run=run, process=process)


def process_of_alive_key(full_key: str) -> str:
    """Return the process id in a liveliness key."""
    return full_key.rsplit("/", 1)[1]


def vehicle_of_key(full_key: str) -> str:
    """Return the vehicle's id in the key of a channel of a vehicle."""
    return full_key.removeprefix(f"{PREFIX}/vehicle/").split("/", 1)[0]


def run_of_alive_key(full_key: str) -> str:
    """Return the run id in a liveliness key."""
    return full_key.rsplit("/", 3)[1]


def _fill(template: str, **ids: str | None) -> str:
    given: dict[str, str] = {}
    for name, value in ids.items():
        if value is None:
            if f"{{{name}}}" in template:
                raise ValueError(f"key {template} needs an id for {name!r}")
            continue
        if value != "*" and (not value or any(c in value for c in "/*$#?{} ")):
            raise ValueError(f"{name} id {value!r} must be one word without / * $ # ?")
        given[name] = value
    return template.format(**given)
