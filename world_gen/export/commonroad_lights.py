"""Traffic lights of a CommonRoad scenario, with cycles from the signal plans."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from lxml import etree

from foretwin.contracts.signals import SignalPlan
from foretwin.contracts.world import Turn, World
from foretwin.world_gen.export.commonroad_elements import IdCounter, child, position
from foretwin.world_gen.export.lanelets import indicated

_DIRECTIONS: Mapping[frozenset[Turn], str] = {
    frozenset({"right"}): "right",
    frozenset({"straight"}): "straight",
    frozenset({"left"}): "left",
    frozenset({"left", "straight"}): "leftStraight",
    frozenset({"straight", "right"}): "straightRight",
    frozenset({"left", "right"}): "leftRight",
}


class CycleElement(NamedTuple):
    """A stretch of a light's cycle."""

    color: str
    duration_s: float


class CommonRoadLights:
    """Elements of all lights, and which of them each lane obeys."""

    def __init__(self) -> None:
        self.elements: list[Any] = []
        self._of: dict[str, list[int]] = {}

    def of(self, lane_id: str) -> Sequence[int]:
        """Return the ids of the lights that a lane obeys."""
        return self._of.get(lane_id, ())

    def add(self, element: Any, number: int, lane_ids: Sequence[str]) -> None:
        """Take up a light."""
        self.elements.append(element)
        for lane_id in lane_ids:
            self._of.setdefault(lane_id, []).append(number)


def cycle(plan: SignalPlan, group_id: str) -> list[CycleElement]:
    """Return what a group's light shows over one cycle, from the start of its first phase.

    A group that is green in the next phase too stays green between them.
    """
    shown: list[CycleElement] = []

    def show(color: str, duration_s: float) -> None:
        if duration_s <= 0.0:
            return
        if shown and shown[-1].color == color:
            shown[-1] = CycleElement(color, shown[-1].duration_s + duration_s)
        else:
            shown.append(CycleElement(color, duration_s))

    for i, phase in enumerate(plan.phases):
        following = plan.phases[(i + 1) % len(plan.phases)]
        green = group_id in phase.green_group_ids
        stays = green and group_id in following.green_group_ids
        show("green" if green else "red", phase.green_s)
        show("green" if stays else "yellow" if green else "red", plan.amber_s)
        show("green" if stays else "red", plan.all_red_s)
    return shown


def traffic_lights(
    world: World, lanes: Mapping[str, int], time_step_s: float, ids: IdCounter
) -> CommonRoadLights:
    """Return a light for each head that some lane obeys; one without a plan is not active."""
    plans = {
        group.id: junction.plan
        for junction in world.junctions
        if junction.plan is not None
        for group in junction.plan.groups
    }
    lights = CommonRoadLights()
    for signal in world.signals:
        governed = [name for name in signal.lane_ids if name in lanes]
        if not governed:
            continue
        number = ids.new()
        element = etree.Element("trafficLight", id=str(number))
        plan = plans.get(signal.group_id)
        shown = cycle(plan, signal.group_id) if plan is not None else []
        _add_cycle(element, shown, time_step_s)
        position(element, signal.position)
        child(element, "direction", _direction(world, governed, signal.group_id))
        child(element, "active", "true" if shown else "false")
        lights.add(element, number, governed)
    return lights


def _add_cycle(light: Any, shown: Sequence[CycleElement], time_step_s: float) -> None:
    parent = child(light, "cycle")
    for color, duration_s in shown or [CycleElement("inactive", time_step_s)]:
        element = child(parent, "cycleElement")
        child(element, "duration", max(round(duration_s / time_step_s), 1))
        child(element, "color", color)


def _direction(world: World, lane_ids: Sequence[str], group_id: str) -> str:
    """Return for which turns a light stands, by the connections of its group."""
    side = world.intersection.driving_side
    turns = frozenset(
        indicated(c.turn, side)
        for c in world.connections
        if c.from_lane_id in lane_ids and c.signal_group_id in (None, group_id)
    )
    return _DIRECTIONS.get(turns, "all")
