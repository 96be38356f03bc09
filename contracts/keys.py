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

    key: str
    kind: type[msgspec.Struct]
    reply: type[msgspec.Struct] | None
    rate_hz: float | None
    qos: Qos
    purpose: str


class _Row(NamedTuple):
    """What a channel says, how often and what for; `reply` is the answer to a question."""

    kind: type[msgspec.Struct]
    rate_hz: float | None
    purpose: str
    reply: type[msgspec.Struct] | None = None


_VEHICLE, _RUN = "vehicle/{vehicle}", "run/{run}"
_WORKER = f"{_RUN}/worker/{{process}}"

_TABLE: dict[tuple[str, Qos], dict[str, _Row]] = {
    # What the vehicle sends.
    (f"{_VEHICLE}/telemetry", LIVE): {
        "gnss": _Row(drive.GnssFix, 10, "antenna position"),
        "imu": _Row(drive.ImuSample, 100, "specific force and rates"),
        "speed": _Row(drive.SpeedSample, 50, "wheel speed"),
        "heading": _Row(drive.HeadingSample, 10, "measured yaw"),
        "steering": _Row(drive.SteeringSample, 50, "steering"),
        "control": _Row(drive.ControlCommand, 50, "ADS commands"),
        "plan": _Row(drive.PlannedTrajectory, 10, "ADS plan"),
        "status": _Row(drive.VehicleStatus, 10, "mode and gear"),
        "objects": _Row(drive.RoadUsers, 10, "detected road users"),
        "signals": _Row(drive.SignalState, 1, "signal colours"),
        "end": _Row(drive.DriveEnd, None, "the drive is over"),
    },
    # What is derived from it.
    (_VEHICLE, LIVE): {
        "state": _Row(drive.VehicleState, 50, "estimated state"),
        "route": _Row(drive.RouteToGoal, 1, "where the ADS goes"),
    },
    # Questions to the vehicle's process.
    (_VEHICLE, REQUEST): {
        "info": _Row(drive.InfoRequest, None, "what the vehicle is", drive.VehicleInfo),
        "advance": _Row(drive.AdvanceRequest, None, "lock step: go on until", drive.AdvanceReply),
    },
    # Work.
    (_WORKER, REQUEST): {
        "job": _Row(runner.JobRequest, 2, "simulate futures", runner.JobAnswer),
        "place": _Row(
            placement.PlaceRequest, None, "find places for scenarios", placement.WorldPlaces
        ),
        "prepare": _Row(simulation.PrepareRequest, None, "load a World", simulation.PrepareReply),
        "use_world": _Row(
            simulation.ActiveWorld, None, "the mirror's World", simulation.ActiveWorld
        ),
        "use_vehicle": _Row(tuning.UseVehicle, None, "parameters from now on", tuning.UseVehicle),
        "tune": _Row(tuning.TuneRequest, None, "lock step: weigh what was sent", tuning.TuneReply),
        "use_roles": _Row(roles.UseRoles, None, "the mirror's roles", roles.UseRoles),
    },
    (f"{_RUN}/builder/{{process}}", REQUEST): {
        "build": _Row(simulation.BuildRequest, None, "build a World", simulation.BuildReply),
    },
    (_RUN, REQUEST): {
        "set": _Row(tuning.SetRequest, None, "change a running drive", tuning.SetReply),
    },
    # What those who watch receive.
    (_RUN, RESULT): {
        "round": _Row(simulation.RoundView, 2, "one round of futures"),
        "comparison": _Row(simulation.Comparison, 8, "nominal future against reality"),
        "plan_comparison": _Row(simulation.PlanComparison, 2, "the car's plan against ours"),
        "disagreement": _Row(side_by_side.Disagreement, None, "human and ADS disagree"),
        "mirror": _Row(simulation.MirrorSample, 10, "twin, shadow, ghost and their gap"),
        "gap": _Row(gap.GapSample, 4, "model against reality"),
        "gap_alarm": _Row(gap.GapAlarm, None, "a gap beyond limits"),
        "verdict": _Row(gap.Verdict, None, "which of the two is wrong"),
        "identification": _Row(tuning.Identification, 0.2, "what the driving says of the vehicle"),
        "parameter": _Row(tuning.ParameterChange, None, "a parameter that counts from now on"),
        "active_world": _Row(simulation.ActiveWorld, None, "which World counts"),
        "world": _Row(simulation.WorldNotice, None, "a World is ready"),
        "event": _Row(simulation.Event, None, "worth telling"),
        "run_end": _Row(simulation.RunEnd, None, "write and leave"),
    },
    (_RUN, WATCH): {
        "worker_status": _Row(simulation.WorkerStatus, 2, "health of the workers"),
        "progress": _Row(simulation.Progress, 5, "one line"),
    },
    # The vehicles beside the car, and what goes towards a real vehicle: through a gateway that
    # bounds it, off unless switched on twice.
    (_RUN, LIVE): {
        "other_vehicles": _Row(roles.OtherVehicles, 50, "states of the vehicles beside the car"),
        "authority": _Row(towards_vehicle.Authority, 20, "the orchestrator is in charge"),
        "vehicle_command": _Row(towards_vehicle.VehicleCommand, 50, "what the vehicle shall do"),
        "virtual_objects": _Row(drive.RoadUsers, 10, "road users that are simulated"),
    },
    # A driving stack in another process as planner under test.
    (_WORKER, LIVE): {
        "planner_scene": _Row(
            planner_link.PlannerScene, None, "futures at one instant: what to do?"
        ),
        "planned_motions": _Row(planner_link.PlannedMotions, None, "what a driving stack would do"),
    },
}
CHANNELS: dict[str, Channel] = {
    name: Channel(f"{PREFIX}/{place}/{name}", row.kind, row.reply, row.rate_hz, qos, row.purpose)
    for (place, qos), rows in _TABLE.items()
    for name, row in rows.items()
}
"""All channels by name."""

TELEMETRY_CHANNELS = tuple(
    name for name, channel in CHANNELS.items() if "/telemetry/" in channel.key
)
"""What a vehicle may send, `end` included."""

ALIVE_KEY = f"{PREFIX}/{_RUN}/alive/{{process}}"
"""Liveliness token of each process of a run."""


@functools.lru_cache(maxsize=1024)
def key(
    name: str, *, vehicle: str | None = None, run: str | None = None, process: str | None = None
) -> str:
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
