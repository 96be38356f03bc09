"""How everybody starts and moves in an OpenSCENARIO file: teleports, trajectories, braking."""

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
from foretwin.sim_worker.scenarios.openscenario_entities import reference_behind_centre_m
from foretwin.sim_worker.scenarios.roles import Cast, CastActor
from foretwin.world_gen.export.xml_tree import number

_STEP_S, _SPACING_M = 0.1, 0.5
_MOST_DRIFT_M = 0.06
_BEYOND_M = 20.0
"""Paths that are not timed go on so far, for whoever drives them faster."""


class Motion(NamedTuple):
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


def ego_motion(played: Cast, *, horizon_s: float) -> Motion:
    """Return the ego's motion along its path.

    It is timed backwards, as speeds have no sign there, and where the path has kinks, along which
    nobody moves as fast as an arc length says.
    """
    path, speed = FrenetPath(played.ego_xy_m), played.ego_speed_mps
    along = _spaced(speed * horizon_s)
    pose = path.pose_at(played.ego_arc_m + along, played.ego_lateral_m)
    drift_m = np.abs(arc_lengths(pose.xy_m) - along)[1:]
    if not played.reverse and float(drift_m.max()) <= _MOST_DRIFT_M:
        name = f"{EGO}_speed_mps"
        return Motion(EGO, pose, along / speed, False, f"${name}", {name: speed})
    time = _instants(horizon_s)
    pose = path.pose_at(played.ego_arc_m + speed * time, played.ego_lateral_m)
    if not played.reverse:
        return Motion(EGO, pose, time, True, number(speed), {})
    pose = pose._replace(yaw_rad=pose.yaw_rad + math.pi)
    return Motion(EGO, pose, time, True, number(-speed), {})


def actor_motion(actor: CastActor, *, horizon_s: float) -> Motion:
    """Return another road user's motion as its conduct has it, were nobody to react."""
    path, speed = FrenetPath(actor.xy_m), actor.speed_mps
    behind = reference_behind_centre_m(actor.kind)
    stops = actor.conduct == "stops" and speed > 0.0
    if speed <= 0.0:
        time = np.zeros(1)
    elif stops:
        time = _spaced(speed * horizon_s) / speed
    else:
        time = _instants(horizon_s)
    pose = _reference(path.pose_at(actor.start_arc_m + speed * time, actor.lateral_m), behind)
    if not stops:
        return Motion(actor.name, pose, time, True, number(speed), {})
    numbers = {
        f"{actor.name}_speed_mps": speed,
        f"{actor.name}_acts_after_s": actor.acts_after_s,
        f"{actor.name}_decel_mps2": actor.decel_mps2,
    }
    said, brakes_after, brakes_by = (f"${name}" for name in numbers)
    return Motion(actor.name, pose, time, False, said, numbers, brakes_after, brakes_by)


def _instants(horizon_s: float) -> Array:
    return np.asarray(np.arange(math.ceil(horizon_s / _STEP_S - 1e-9) + 1) * _STEP_S)


def _spaced(far_m: float) -> Array:
    return np.asarray(np.arange(math.ceil((far_m + _BEYOND_M) / _SPACING_M) + 1) * _SPACING_M)


def _reference(centre: PathPose, behind_m: float) -> PathPose:
    forward = np.stack([np.cos(centre.yaw_rad), np.sin(centre.yaw_rad)], axis=-1)
    return centre._replace(xy_m=centre.xy_m - behind_m * forward)


def starts(motion: Motion) -> etree._Element:
    """Return the actions that put an entity at its start, with its speed."""
    private = etree.Element("Private", entityRef=motion.name)
    teleport = etree.SubElement(etree.SubElement(private, "PrivateAction"), "TeleportAction")
    _position(teleport, motion.pose, 0)
    _speed(etree.SubElement(private, "PrivateAction"), motion.speed)
    return private


def maneuver_group(motion: Motion) -> etree._Element:
    """Return what an entity does: follow its trajectory and, if it stops, brake."""
    group = etree.Element("ManeuverGroup", name=f"{motion.name} group", maximumExecutionCount="1")
    actors = etree.SubElement(group, "Actors", selectTriggeringEntities="false")
    etree.SubElement(actors, "EntityRef", entityRef=motion.name)
    maneuver = etree.SubElement(group, "Maneuver", name=f"{motion.name} maneuver")
    follow = _event(maneuver, f"{motion.name} follows", "0")
    action = etree.SubElement(follow, "RoutingAction")
    _trajectory(etree.SubElement(action, "FollowTrajectoryAction"), motion)
    if motion.brakes_after_s:
        brakes = _event(maneuver, f"{motion.name} brakes", motion.brakes_after_s)
        _speed(brakes, "0", by_mps2=motion.brakes_by_mps2)
    return group


def after(seconds: str, *, tag: str, name: str) -> etree._Element:
    """Return a trigger by the simulation's time."""
    trigger = etree.Element(tag)
    group = etree.SubElement(trigger, "ConditionGroup")
    condition = etree.SubElement(group, "Condition", name=name, delay="0", conditionEdge="none")
    value = etree.SubElement(condition, "ByValueCondition")
    etree.SubElement(value, "SimulationTimeCondition", value=seconds, rule="greaterOrEqual")
    return trigger


def _event(maneuver: etree._Element, name: str, seconds: str) -> etree._Element:
    event = etree.SubElement(
        maneuver, "Event", name=name, priority="parallel", maximumExecutionCount="1"
    )
    action = etree.SubElement(event, "Action", name=f"{name}, action")
    event.append(after(seconds, tag="StartTrigger", name=f"{name}, when"))
    return etree.SubElement(action, "PrivateAction")


def _speed(action: etree._Element, target: str, *, by_mps2: str = "") -> None:
    """Add the setting of a speed: at once, or at a rate."""
    speed = etree.SubElement(etree.SubElement(action, "LongitudinalAction"), "SpeedAction")
    how = ("linear", "rate", by_mps2) if by_mps2 else ("step", "time", "0")
    etree.SubElement(
        speed, "SpeedActionDynamics", dynamicsShape=how[0], dynamicsDimension=how[1], value=how[2]
    )
    aim = etree.SubElement(speed, "SpeedActionTarget")
    etree.SubElement(aim, "AbsoluteTargetSpeed", value=target)


def _trajectory(action: etree._Element, motion: Motion) -> None:
    reference = etree.SubElement(action, "TrajectoryRef")
    trajectory = etree.SubElement(
        reference, "Trajectory", name=f"{motion.name} trajectory", closed="false"
    )
    line = etree.SubElement(etree.SubElement(trajectory, "Shape"), "Polyline")
    for i in range(len(motion.pose.xy_m)):
        vertex = etree.SubElement(line, "Vertex")
        if motion.timed:
            vertex.set("time", number(motion.time_s[i]))
        _position(vertex, motion.pose, i)
    timing = etree.SubElement(action, "TimeReference")
    if motion.timed:
        etree.SubElement(timing, "Timing", domainAbsoluteRelative="relative", scale="1", offset="0")
    else:
        etree.SubElement(timing, "None")
    etree.SubElement(action, "TrajectoryFollowingMode", followingMode="position")


def _position(parent: etree._Element, pose: PathPose, i: int) -> None:
    x, y = pose.xy_m[i]
    etree.SubElement(
        etree.SubElement(parent, "Position"), "WorldPosition", x=number(x), y=number(y),
        h=number(math.remainder(float(pose.yaw_rad[i]), math.tau)),
    )  # fmt: skip
