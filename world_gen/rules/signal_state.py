"""What colour each signal group shows at a time of the drive: by its plan, or as heard live."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import SignalColour
from foretwin.contracts.signals import LearntSignal, SignalPlan
from foretwin.contracts.too_old import LIGHT_FOR_S
from foretwin.contracts.world import World


class LiveColour(NamedTuple):
    """What a group was last heard to show, and when in seconds of the drive."""

    time_s: float
    colour: SignalColour


class HeardCycle(NamedTuple):
    """A cycle that a group was heard to repeat: one begins at `begins_s`, each of its colours
    `from_s` later."""

    begins_s: float
    cycle_s: float
    from_s: tuple[float, ...]
    colours: tuple[SignalColour, ...]

    def colour_at(self, time_s: float) -> SignalColour:
        """Return what the group shows at a time, if it goes on so."""
        into_s = (time_s - self.begins_s) % self.cycle_s
        return self.colours[bisect_right(self.from_s, into_s) - 1]


def heard_cycle(learnt: LearntSignal, stamp_ns: int) -> HeardCycle:
    """Return what was learnt of a group, in seconds from a stamp on."""
    begins_s = (learnt.begins_ns - stamp_ns) / 1e9
    return HeardCycle(begins_s, learnt.cycle_s, learnt.from_s, learnt.colours)


def cycle_s(plan: SignalPlan) -> float:
    """Return how long a plan's cycle takes."""
    return sum(phase.green_s + plan.amber_s + plan.all_red_s for phase in plan.phases)


def parts_of_cycle(plan: SignalPlan, time_s: Array) -> npt.NDArray[np.intp]:
    """Return (K,) which parts of a plan's cycle times (K,) fall into; none changes colours."""
    red_amber_s = min(plan.red_amber_s, plan.all_red_s)
    red_s = plan.all_red_s - red_amber_s
    parts = [(phase.green_s, plan.amber_s, red_s, red_amber_s) for phase in plan.phases]
    if not parts:
        return np.zeros(len(time_s), dtype=np.intp)
    ends = np.cumsum(parts)
    into_s = (time_s - plan.offset_s) % ends[-1]
    return np.asarray(np.searchsorted(ends, into_s, side="right"))


def colours_at(
    plan: SignalPlan, time_s: float, live: Mapping[str, LiveColour] | None = None
) -> dict[str, SignalColour]:
    """Return the colour of each group of a plan at a drive time.

    A group that the next phase lets go as well stays green in between. Those on foot get no
    amber. What was heard no more than `LIGHT_FOR_S` ago counts instead, unless it is `unknown`;
    so does what is heard later than `time_s`, since clocks differ.
    """
    colours: dict[str, SignalColour] = {group.id: "red" for group in plan.groups}
    into_s = (time_s - plan.offset_s) % cycle_s(plan) if plan.phases else 0.0
    on_foot = {g.id for g in plan.groups if g.crossing_ids and not g.connection_ids}
    for i, phase in enumerate(plan.phases):
        step_s = phase.green_s + plan.amber_s + plan.all_red_s
        if into_s < step_s:
            following = plan.phases[(i + 1) % len(plan.phases)].green_group_ids
            if into_s >= step_s - min(plan.red_amber_s, plan.all_red_s):
                colours.update((name, "red_amber") for name in following if name not in on_foot)
            for name in phase.green_group_ids:
                if into_s < phase.green_s or name in following:
                    colours[name] = "green"
                elif into_s < phase.green_s + plan.amber_s and name not in on_foot:
                    colours[name] = "amber"
            break
        into_s -= step_s
    for name, heard in (live or {}).items():
        if name in colours and time_s - heard.time_s <= LIGHT_FOR_S and heard.colour != "unknown":
            colours[name] = heard.colour
    return colours


def world_colours_at(world: World, time_s: float) -> dict[str, SignalColour]:
    """Return the colour of each signal group of a World at a drive time, as `colours_at` does."""
    plans = [junction.plan for junction in world.junctions if junction.plan is not None]
    found: dict[str, SignalColour] = {}
    for plan in (*plans, *world.crossing_plans):
        found.update(colours_at(plan, time_s))
    return found
