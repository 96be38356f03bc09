"""`foretwin set light.GROUP=red`: what the lights of the World in force show, and by whose word."""

from __future__ import annotations

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, get_args

import numpy as np

from foretwin.contracts.drive import SignalColour, SignalState
from foretwin.contracts.frames import geo_pose
from foretwin.contracts.lights import ShownLight, ShownLights, StopPlace, WhyShown
from foretwin.contracts.signals import LearntSignal, SignalPlan
from foretwin.contracts.too_old import LIGHT_FOR_S
from foretwin.contracts.world import World
from foretwin.orchestrator.runtime_configuration.handler import Made, RefusedError
from foretwin.world_gen.rules.signal_state import colours_at, cycle_s

AUTO = "auto"
"""Gives a light back to plan and car."""
SETTABLE: tuple[SignalColour, ...] = tuple(c for c in get_args(SignalColour) if c != "unknown")


class _ColourCourse(NamedTuple):
    """What a group shows from `from_s` of its cycle on, part by part."""

    offset_s: float
    cycle_s: float
    from_s: Sequence[float]
    colours: Sequence[SignalColour]

    def at(self, time_s: float) -> tuple[SignalColour, SignalColour | None, float | None]:
        """Return the colour at a time, the next one, and in how long that comes."""
        into_s = (time_s - self.offset_s) % self.cycle_s
        place = bisect_right(self.from_s, into_s) - 1
        now = self.colours[place]
        for later in range(1, len(self.colours)):
            turns, index = divmod(place + later, len(self.colours))
            if self.colours[index] != now:
                return now, self.colours[index], self.from_s[index] + turns * self.cycle_s - into_s
        return now, None, None


class LightsInForce:
    """The lights of the World in force: set by hand, heard, learnt or by plan, in this order."""

    def __init__(self) -> None:
        self.set: dict[str, SignalColour] = {}
        """By group; a light that was set stays so, in whatever World it stands."""
        self._world: World | None = None
        self._courses: dict[str, _ColourCourse] = {}
        self._stops: dict[str, tuple[StopPlace, ...]] = {}
        self._on_foot: frozenset[str] = frozenset()

    def use_world(self, world: World | None) -> None:
        """Tell of the lights of this World from now on."""
        self._world, self._courses, self._stops = world, {}, {}
        self._on_foot = frozenset()
        if world is None:
            return
        plans = [one.plan for one in world.junctions if one.plan is not None]
        for plan in (*plans, *world.crossing_plans):
            self._courses |= _courses(plan)
            walking = {g.id for g in plan.groups if g.crossing_ids and not g.connection_ids}
            self._on_foot |= walking
        self._stops = _stops(world)

    @property
    def groups(self) -> frozenset[str]:
        """The groups of lights in the World in force."""
        return frozenset(self._courses) | frozenset(self._stops)

    def shown(
        self,
        stamp_ns: int,
        start_ns: int,
        heard: Mapping[str, SignalState],
        learnt: Iterable[LearntSignal],
    ) -> ShownLights:
        """Return what all lights show at a stamp of the vehicle; `start_ns` is drive time 0."""
        fresh_ns = LIGHT_FOR_S * 1e9
        cycles = {
            one.group_id: _ColourCourse(
                (one.begins_ns - start_ns) / 1e9, one.cycle_s, one.from_s, one.colours
            )
            for one in learnt
        }
        time_s = (stamp_ns - start_ns) / 1e9
        lights = []
        for group in sorted(self.groups):
            why: WhyShown = "learnt" if group in cycles else "plan"
            course = cycles.get(group) or self._courses.get(group)
            colour, following, in_s = course.at(time_s) if course else ("unknown", None, None)
            told = self.set.get(group)
            if told is None and (last := heard.get(group)) is not None:
                told = last.colour if abs(stamp_ns - last.stamp_ns) <= fresh_ns else None
            if told is not None and told != "unknown":
                why = "set" if group in self.set else "heard"
                if told != colour or why == "set":
                    following = in_s = None
                colour = told
            lights.append(
                ShownLight(
                    group_id=group,
                    colour=colour,
                    why=why,
                    next_colour=following,
                    changes_in_s=in_s,
                    on_foot=group in self._on_foot,
                    stops=self._stops.get(group, ()),
                )
            )
        world_id = None if self._world is None else self._world.id
        return ShownLights(stamp_ns=stamp_ns, world_id=world_id, lights=tuple(lights))


def _courses(plan: SignalPlan) -> dict[str, _ColourCourse]:
    """Return what each group of a plan shows over a cycle."""
    if not plan.phases:
        return {g.id: _ColourCourse(0.0, 1.0, (0.0,), ("red",)) for g in plan.groups}
    red_amber_s = min(plan.red_amber_s, plan.all_red_s)
    parts = [
        part
        for phase in plan.phases
        for part in (phase.green_s, plan.amber_s, plan.all_red_s - red_amber_s, red_amber_s)
    ]
    ends_s = np.cumsum(parts).tolist()
    from_s = [0.0, *ends_s[:-1]]
    colours = [
        colours_at(plan, plan.offset_s + 0.5 * (begin + end))
        for begin, end in zip(from_s, ends_s, strict=True)
    ]
    return {
        g.id: _ColourCourse(plan.offset_s, cycle_s(plan), from_s, [one[g.id] for one in colours])
        for g in plan.groups
    }


def _stops(world: World) -> dict[str, tuple[StopPlace, ...]]:
    """Return where vehicles wait for each group."""
    groups: dict[str, set[str]] = defaultdict(set)
    for connection in world.connections:
        if connection.signal_group_id is not None:
            groups[connection.from_lane_id].add(connection.signal_group_id)
            groups[connection.id].add(connection.signal_group_id)
    for signal in world.signals:
        for lane_id in signal.lane_ids:
            groups[lane_id].add(signal.group_id)
    found: dict[str, list[StopPlace]] = defaultdict(list)
    for line in world.stop_lines:
        left, right = np.asarray(line.ends, dtype=np.float64)
        x_m, y_m = (0.5 * (left + right)).tolist()
        across = right - left
        # Who drives up to it has its right end to the right.
        yaw_rad = float(np.arctan2(across[0], -across[1]))
        at = geo_pose(world.frame, x_m, y_m, yaw_rad, alt_m=world.frame.origin.alt_m)
        for group in groups.get(line.across_id, ()):
            found[group].append(StopPlace(position=at.position, yaw_rad=at.yaw_rad))
    return {group: tuple(places) for group, places in found.items()}


@dataclass(frozen=True)
class LightHandler:
    """Makes the changes `light.GROUP`."""

    in_force: LightsInForce
    keys: str = "light.GROUP"
    at_once: bool = True
    """Whoever drives by a light shall see it now; a round in progress keeps what it began with."""

    def check(self, name: str, value: str) -> None:
        """Raise RefusedError for a light that is not there, or a colour that none has."""
        if name not in self.in_force.groups | self.in_force.set.keys():
            known = ", ".join(sorted(self.in_force.groups)[:12]) or "none"
            raise RefusedError(f"light.{name}: no such light around the car; there are: {known}")
        if value not in (*SETTABLE, AUTO):
            raise RefusedError(f"light.{name}={value}: must be {', '.join(SETTABLE)} or {AUTO}")

    def make(self, name: str, value: str, *, stamp_ns: int) -> Made:
        """Let the light show a colour until it is told otherwise."""
        before = self.in_force.set.pop(name, AUTO)
        if value != AUTO:
            self.in_force.set[name] = next(one for one in SETTABLE if one == value)
        return Made(before, value)
