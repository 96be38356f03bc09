"""The table of channels: every Zenoh key of foretwin with its type, rate and quality of service.

Keys are full expressions under `foretwin/v1/`, each with the vehicle's or the run's id in it.
"""

from __future__ import annotations

import functools

from foretwin.contracts import (
    camera_image,
    drive,
    fleet,
    gap,
    lights,
    marks,
    placement,
    planner_link,
    point_cloud,
    radar_list,
    roles,
    runner,
    sensed_motion,
    siblings,
    side_by_side,
    simulation,
    towards_vehicle,
    tuning,
    virtual_traffic,
    world_building,
)
from foretwin.contracts.channel import (
    LIVE,
    LOCK_STEP,
    RECORDED,
    REQUEST,
    RESULT,
    WATCH,
)
from foretwin.contracts.channel import BusRole as BusRole
from foretwin.contracts.channel import Channel as Channel
from foretwin.contracts.channel import Priority as Priority
from foretwin.contracts.channel import Qos as Qos
from foretwin.contracts.channel import Writer as Writer

PREFIX = "foretwin/v1"

_VEHICLE, _RUN = "vehicle/{vehicle}", "run/{run}"
_WORKER = f"{_RUN}/worker/{{process}}"

_CAR, _OPERATOR, _PLANNER = (Writer("car"),), (Writer("operator"),), (Writer("planner"),)
_ORCHESTRATOR, _ANY_WORKER = (Writer("orchestrator"),), (Writer("worker"),)

_WHO_RECKONS_TIME = Writer("viewer"), Writer("recorder"), Writer("worker", "tuning")

_TABLE: dict[tuple[str, Qos, tuple[Writer, ...]], dict[str, Channel]] = {
    # What the vehicle sends.
    (f"{_VEHICLE}/telemetry", RECORDED, _CAR): {
        "gnss": Channel(drive.GnssFix, 10, "antenna position"),
        "imu": Channel(drive.ImuSample, 100, "specific force and rates"),
        "speed": Channel(drive.SpeedSample, 50, "wheel speed"),
        "heading": Channel(drive.HeadingSample, 10, "measured yaw"),
        "steering": Channel(drive.SteeringSample, 50, "steering"),
        "control": Channel(drive.ControlCommand, 50, "ADS commands"),
        "plan": Channel(drive.PlannedTrajectory, 10, "ADS plan"),
        "status": Channel(drive.VehicleStatus, 10, "mode and gear"),
        "objects": Channel(drive.RoadUsers, 10, "detected road users"),
        "signals": Channel(drive.SignalState, 1, "signal colours"),
        "end": Channel(drive.DriveEnd, None, "the drive is over"),
    },
    # What is derived from it.
    (_VEHICLE, RECORDED, _ORCHESTRATOR): {
        "state": Channel(drive.VehicleState, 50, "estimated state"),
    },
    (_VEHICLE, RECORDED, _CAR): {
        "injection": Channel(towards_vehicle.Injection, 5, "whether it is shown what is virtual"),
    },
    (_VEHICLE, WATCH, _CAR): {
        "real_cloud": Channel(point_cloud.PointCloud, 10, "what a lidar of the car measured"),
    },
    (_VEHICLE, LIVE, _CAR): {
        "route": Channel(drive.RouteToGoal, 1, "where the ADS goes"),
    },
    # Questions to the vehicle's process.
    (_VEHICLE, REQUEST, (*_ORCHESTRATOR, *_WHO_RECKONS_TIME)): {
        "info": Channel(drive.InfoRequest, None, "what the vehicle is", drive.VehicleInfo),
    },
    (_VEHICLE, LIVE, _ORCHESTRATOR): {
        "surroundings": Channel(drive.OthersAround, 20, "who else is around, by its own clock"),
    },
    (_VEHICLE, REQUEST, _ORCHESTRATOR): {
        "vehicle_clock": Channel(fleet.ClockQuestion, 1, "time on board", drive.VehicleTime),
        "advance": Channel(drive.AdvanceRequest, None, "lock step: go on", drive.AdvanceReply),
    },
    # Work.
    (_WORKER, REQUEST, _ORCHESTRATOR): {
        "job": Channel(runner.JobRequest, 2, "simulate futures", runner.JobAnswer),
        "place": Channel(
            placement.PlaceRequest, None, "find places for scenarios", placement.WorldPlaces
        ),
        "build_world": Channel(
            world_building.WantedWorld, None, "build a World of a sweep", world_building.BuiltWorld
        ),
        "prepare": Channel(
            simulation.PrepareRequest, None, "load a World", simulation.PrepareReply
        ),
        "use_world": Channel(
            simulation.ActiveWorld, None, "the mirror's World", simulation.ActiveWorld
        ),
        "use_vehicle": Channel(
            tuning.UseVehicle, None, "parameters from now on", tuning.UseVehicle
        ),
        "tune": Channel(
            tuning.TuneRequest, None, "lock step: weigh what was sent", tuning.TuneReply
        ),
        "use_course": Channel(
            virtual_traffic.TrafficCourse,
            2,
            "virtual traffic's World, and the car's way",
            virtual_traffic.TrafficCourse,
        ),
        "use_roles": Channel(roles.UseRoles, None, "the mirror's roles", roles.UseRoles),
        # Of workers on other machines.
        "enlist": Channel(fleet.EnlistRequest, None, "with what we play", fleet.Enlisted),
        "admit": Channel(fleet.Admittance, None, "whether it may", fleet.Admittance),
        "clock": Channel(fleet.ClockQuestion, 1, "its clock and link", fleet.ClockAnswer),
    },
    (_RUN, REQUEST, _ANY_WORKER): {
        "world_file": Channel(fleet.WorldQuestion, None, "a World by its hash", fleet.WorldBytes),
    },
    (f"{_RUN}/builder/{{process}}", REQUEST, _ORCHESTRATOR): {
        "build": Channel(simulation.BuildRequest, None, "build a World", simulation.BuildReply),
    },
    (f"{_RUN}/beside/{{vehicle}}", REQUEST, _CAR): {
        "join": Channel(roles.JoinRequest, 1, "speak as a vehicle beside the car", roles.JoinReply),
    },
    (_RUN, REQUEST, _OPERATOR): {
        "set": Channel(tuning.SetRequest, None, "change a running drive", tuning.SetReply),
    },
    (_RUN, REQUEST, (Writer("viewer"), *_OPERATOR)): {
        "mark": Channel(marks.MarkRequest, None, "mark an event", marks.MarkReply),
    },
    # What those who watch receive.
    (_RUN, RESULT, _ORCHESTRATOR): {
        "round": Channel(simulation.RoundView, 2, "one round of futures"),
        "comparison": Channel(simulation.Comparison, 8, "nominal future against reality"),
        "plan_comparison": Channel(simulation.PlanComparison, 2, "the car's plan against ours"),
        "disagreement": Channel(side_by_side.Disagreement, None, "human and ADS disagree"),
        "sibling": Channel(siblings.SiblingFuture, 4, "a future on a second engine"),
        "parameter": Channel(tuning.ParameterChange, None, "a parameter that counts from now on"),
        "active_world": Channel(simulation.ActiveWorld, None, "which World counts"),
        "world": Channel(simulation.WorldNotice, None, "a World is ready"),
        "run_end": Channel(simulation.RunEnd, None, "write and leave"),
    },
    (_RUN, RESULT, (*_ORCHESTRATOR, Writer("recorder"))): {
        "event": Channel(simulation.Event, None, "worth telling"),
    },
    (_RUN, RESULT, (Writer("worker", "mirror"),)): {
        "mirror": Channel(simulation.MirrorSample, 10, "twin, shadow, ghost and their gap"),
    },
    (_RUN, RESULT, (Writer("worker", "tuning"),)): {
        "gap": Channel(gap.GapSample, 4, "model against reality"),
        "gap_alarm": Channel(gap.GapAlarm, None, "a gap beyond limits"),
        "verdict": Channel(gap.Verdict, None, "which of the two is wrong"),
        "identification": Channel(
            tuning.Identification, 0.2, "what the driving says of the vehicle"
        ),
    },
    (_RUN, LIVE, (Writer("worker", "traffic"),)): {
        "virtual_traffic": Channel(drive.RoadUsers, 20, "road users of one going simulation"),
    },
    (_RUN, WATCH, (Writer("worker", "sensors"),)): {
        "point_cloud": Channel(point_cloud.PointCloud, 10, "what virtual lidars measure"),
        "camera_image": Channel(camera_image.CameraImage, 10, "what virtual cameras see"),
        "sensed_gnss": Channel(sensed_motion.SensedFix, 10, "what virtual receivers measure"),
        "sensed_imu": Channel(sensed_motion.SensedImu, 50, "what virtual inertial sensors measure"),
        "radar_list": Channel(radar_list.RadarList, 20, "what virtual radars measure"),
    },
    (_RUN, WATCH, _ORCHESTRATOR): {
        "worker_status": Channel(simulation.WorkerStatus, 2, "health of the workers"),
        "progress": Channel(simulation.Progress, 5, "one line"),
    },
    # The vehicles beside the car, and what goes towards a real vehicle: through a gateway that
    # bounds it, off unless switched on twice.
    (_RUN, LIVE, _ORCHESTRATOR): {
        "other_vehicles": Channel(roles.OtherVehicles, 50, "states of the vehicles beside the car"),
        "lights": Channel(lights.ShownLights, 10, "what the lights of the World in force show"),
        "authority": Channel(towards_vehicle.Authority, 20, "the orchestrator is in charge"),
    },
    # Nothing of ours says it; a planner that may, signs it with the run's key.
    (_RUN, LIVE, _PLANNER): {
        "vehicle_command": Channel(towards_vehicle.VehicleCommand, 50, "what the vehicle shall do"),
    },
    (_RUN, LIVE, _OPERATOR): {
        "virtual_objects": Channel(drive.RoadUsers, 10, "road users that are simulated"),
    },
    # A driving stack in another process as planner under test.
    (_WORKER, LOCK_STEP, _ANY_WORKER): {
        "planner_scene": Channel(
            planner_link.PlannerScene, None, "futures at one instant: what to do?"
        ),
    },
    (_WORKER, LOCK_STEP, _PLANNER): {
        "planned_motions": Channel(
            planner_link.PlannedMotions, None, "what a driving stack would do"
        ),
        "planner_joined": Channel(
            planner_link.PlannerJoined, None, "a driving stack that a sweep started is there"
        ),
    },
}
CHANNELS: dict[str, Channel] = {
    name: channel._replace(key=f"{PREFIX}/{place}/{name}", qos=qos, writers=writers)
    for (place, qos, writers), channels in _TABLE.items()
    for name, channel in channels.items()
}
"""All channels by name."""

TELEMETRY_CHANNELS = tuple(
    name for name, channel in CHANNELS.items() if "/telemetry/" in channel.key
)
"""What a vehicle may send, `end` included."""
SAMPLE_CHANNELS = tuple(name for name in TELEMETRY_CHANNELS if name != "end")
"""Those of a vehicle's samples, which are counted."""

ALIVE_KEY = f"{PREFIX}/{_RUN}/alive/{{process}}"
"""Under which each process of a run is alive; its token adds the life that it is in."""


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


def vehicle_that_joins(full_key: str) -> str:
    """Return the vehicle's id in the key by which it joins a run."""
    return full_key.rsplit("/", 2)[1]


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
