"""How entities start and move in an OpenSCENARIO file: teleports, trajectories, braking."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from lxml import etree

from foretwin.contracts.arrays import Array
from foretwin.contracts.scenario import EGO
from foretwin.geometry.frenet_path import FrenetPath, PathPose
from foretwin.geometry.polyline import arc_lengths
from foretwin.sim_worker.scenarios.openscenario_entities import (
    element,
    make,
    reference_behind_centre_m,
)
from foretwin.sim_worker.scenarios.roles import StagedActor, StagedCase
from foretwin.world_gen.export.xml_tree import number

_STEP_S, _SPACING_M = 0.1, 0.5
_MOST_DRIFT_M = 0.06
_NEAR_IMPACT_M, _FRONT_M = 0.1, 3.7
"""Planned impacts happen so near their point, which lies about so far ahead of base_link."""
_BEYOND_M = 20.0
"""Paths that are not timed go on so far, for whoever drives them faster."""


class EntityMotion(NamedTuple):
    """One entity's start and way: `pose` of its reference points (N, 2) and headings (N,).

    At `time_s` (N,) it is there: `timed`, or because of its speed. `speed` is a number or, as
    `$name`, one of the `parameters`; so are `brakes_after_s` and `brakes_by_mps2`, which are empty
    for most.
    """

    name: str
    pose: PathPose
    time_s: Array
    timed: bool
    speed: str
    parameters: Mapping[str, float]
    brakes_after_s: str = ""
    brakes_by_mps2: str = ""

    @property
    def moves(self) -> bool:
        """Return whether it does not merely stand."""
        return len(self.time_s) > 1


def ego_motion(
    played: StagedCase, *, horizon_s: float, alone: PathPose | None = None
) -> EntityMotion:
    """Return the ego's motion along its path.

    It is timed backwards, as speeds have no sign there, and where the path has kinks, along which
    no car moves as fast as an arc length says. `alone` is where it really drives at `instants`, if
    that is known: timed like this where its path would miss the planned impact.
    """
    if alone is not None and played.impact_with and _off_path_m(played, alone) > _NEAR_IMPACT_M:
        speed = -played.ego_speed_mps if played.place.reverse else played.ego_speed_mps
        return EntityMotion(EGO, alone, instants(horizon_s), True, number(speed), {})
    path, speed = FrenetPath(played.place.ego.xy_m), played.ego_speed_mps
    along = _spaced(speed * horizon_s)
    pose = path.pose_at(played.ego_arc_m + along, played.ego_lateral_m)
    drift_m = np.abs(arc_lengths(pose.xy_m) - along)[1:]
    if not played.place.reverse and float(drift_m.max()) <= _MOST_DRIFT_M:
        name = f"{EGO}_speed_mps"
        return EntityMotion(EGO, pose, along / speed, False, f"${name}", {name: speed})
    time = instants(horizon_s)
    pose = path.pose_at(played.ego_arc_m + speed * time, played.ego_lateral_m)
    if not played.place.reverse:
        return EntityMotion(EGO, pose, time, True, number(speed), {})
    pose = pose._replace(yaw_rad=pose.yaw_rad + math.pi)
    return EntityMotion(EGO, pose, time, True, number(-speed), {})


def actor_motion(actor: StagedActor, *, horizon_s: float) -> EntityMotion:
    """Return another road user's motion as its conduct has it without reactions.

    Who stops is timed, too, where bends ask for other speeds before it stands.
    """
    moving, speed = actor.moving(FrenetPath(actor.xy_m)), actor.speed_mps
    behind = reference_behind_centre_m(actor.kind)
    time, steady = instants(horizon_s), moving._replace(paces=None)
    slower_m = np.abs(
        moving.arc_after(actor.start_arc_m, time) - steady.arc_after(actor.start_arc_m, time)
    )
    stops = actor.conduct == "stops" and speed > 0.0 and slower_m.max() <= _MOST_DRIFT_M
    if speed <= 0.0:
        time = np.zeros(1)
    elif stops:
        time, moving = _spaced(speed * horizon_s) / speed, steady._replace(brakes_after_s=math.inf)
    arc = moving.arc_after(actor.start_arc_m, time)
    pose = _reference(moving.path.pose_at(arc, actor.lateral_m), behind)
    if not stops:
        return EntityMotion(actor.name, pose, time, True, number(speed), {})
    numbers = {
        f"{actor.name}_speed_mps": speed,
        f"{actor.name}_acts_after_s": actor.acts_after_s,
        f"{actor.name}_decel_mps2": actor.decel_mps2,
    }
    said, brakes_after, brakes_by = (f"${name}" for name in numbers)
    return EntityMotion(actor.name, pose, time, False, said, numbers, brakes_after, brakes_by)


def _off_path_m(played: StagedCase, alone: PathPose) -> float:
    """Return how far an ego's front comes to be, until its impact, from where its path has it."""
    time_s: Array = np.arange(float(len(alone.xy_m))) * _STEP_S
    time_s = time_s[time_s < played.impact_time_s + _STEP_S]
    along = played.ego_arc_m + played.ego_speed_mps * time_s
    on_path = FrenetPath(played.place.ego.xy_m).pose_at(along, played.ego_lateral_m)
    driven = PathPose(*(column[: len(time_s)] for column in alone))
    if played.place.reverse:
        on_path = on_path._replace(yaw_rad=on_path.yaw_rad + math.pi)
    apart = _reference(driven, -_FRONT_M).xy_m - _reference(on_path, -_FRONT_M).xy_m
    return float(np.hypot(*apart.T).max())


def instants(horizon_s: float) -> Array:
    """Return the times (N,) of timed trajectories, from the beginning of a case on."""
    return np.asarray(np.arange(math.ceil(horizon_s / _STEP_S - 1e-9) + 1) * _STEP_S)


def _spaced(far_m: float) -> Array:
    return np.asarray(np.arange(math.ceil((far_m + _BEYOND_M) / _SPACING_M) + 1) * _SPACING_M)


def _reference(centre: PathPose, behind_m: float) -> PathPose:
    forward = np.stack([np.cos(centre.yaw_rad), np.sin(centre.yaw_rad)], axis=-1)
    return centre._replace(xy_m=centre.xy_m - behind_m * forward)


def starts(motion: EntityMotion) -> etree._Element:
    """Return the actions that put an entity at its start, with its speed."""
    return make.Private(
        make.PrivateAction(make.TeleportAction(_position(motion.pose, 0))),
        make.PrivateAction(_speed(motion.speed)),
        entityRef=motion.name,
    )


def maneuver_group(motion: EntityMotion) -> etree._Element:
    """Return what an entity does: follow its trajectory and, if it stops, brake."""
    name = motion.name
    events = [_event(f"{name} follows", "0", make.RoutingAction(_follow(motion)))]
    if motion.brakes_after_s:
        brakes = _speed("0", by_mps2=motion.brakes_by_mps2)
        events.append(_event(f"{name} brakes", motion.brakes_after_s, brakes))
    return make.ManeuverGroup(
        make.Actors(make.EntityRef(entityRef=name), selectTriggeringEntities="false"),
        make.Maneuver(*events, name=f"{name} maneuver"),
        name=f"{name} group",
        maximumExecutionCount="1",
    )


def after(seconds: str, *, tag: str, name: str) -> etree._Element:
    """Return a trigger by the simulation's time."""
    condition = make.Condition(
        make.ByValueCondition(make.SimulationTimeCondition(value=seconds, rule="greaterOrEqual")),
        name=name,
        delay="0",
        conditionEdge="none",
    )
    return element(tag, make.ConditionGroup(condition))


def _event(name: str, seconds: str, action: etree._Element) -> etree._Element:
    return make.Event(
        make.Action(make.PrivateAction(action), name=f"{name}, action"),
        after(seconds, tag="StartTrigger", name=f"{name}, when"),
        name=name,
        priority="parallel",
        maximumExecutionCount="1",
    )


def _speed(target: str, *, by_mps2: str = "") -> etree._Element:
    """Return the setting of a speed: at once, or at a rate."""
    shape, dimension, value = ("linear", "rate", by_mps2) if by_mps2 else ("step", "time", "0")
    how = {"dynamicsShape": shape, "dynamicsDimension": dimension, "value": value}
    return make.LongitudinalAction(
        make.SpeedAction(
            make.SpeedActionDynamics(**how),
            make.SpeedActionTarget(make.AbsoluteTargetSpeed(value=target)),
        )
    )


def _follow(motion: EntityMotion) -> etree._Element:
    vertices = [make.Vertex(_position(motion.pose, i)) for i in range(len(motion.pose.xy_m))]
    timing = element("None")
    if motion.timed:
        for vertex, time_s in zip(vertices, motion.time_s, strict=True):
            vertex.set("time", number(time_s))
        timing = make.Timing(domainAbsoluteRelative="relative", scale="1", offset="0")
    shape = make.Shape(make.Polyline(*vertices))
    return make.FollowTrajectoryAction(
        make.TrajectoryRef(
            make.Trajectory(shape, name=f"{motion.name} trajectory", closed="false")
        ),
        make.TimeReference(timing),
        make.TrajectoryFollowingMode(followingMode="position"),
    )


def _position(pose: PathPose, i: int) -> etree._Element:
    x, y = pose.xy_m[i]
    heading = math.remainder(float(pose.yaw_rad[i]), math.tau)
    return make.Position(make.WorldPosition(x=x, y=y, h=heading))
