"""What the lights of a World show while a job is played: as heard, as learnt, or by plan."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from foretwin.contracts.drive import SignalColour
from foretwin.contracts.futures import Job
from foretwin.contracts.world import World
from foretwin.world_gen.rules.signal_state import (
    HeardCycle,
    LiveColour,
    heard_cycle,
    world_colours_at,
)


class Lights(NamedTuple):
    """The colours of a World's lights during a job."""

    world: World
    start_s: float
    live: Mapping[str, LiveColour]
    learnt: Mapping[str, HeardCycle]
    by_plan: bool

    def at(self, time_s: float) -> dict[str, SignalColour]:
        """Return colours by group: those received, kept, of cycles that were learnt those that
        they come to, and by option those of the World's plans.

        A plan that no map holds is a guess: cars that follow a real one do not stop for it.
        """
        drive_s = self.start_s + time_s
        found = world_colours_at(self.world, drive_s) if self.by_plan else {}
        found.update((group, heard.colour) for group, heard in self.live.items())
        found.update((group, cycle.colour_at(time_s)) for group, cycle in self.learnt.items())
        return found


def lights_of(job: Job, world: World) -> Lights:
    """Return the lights of a job; its time 0 is the stamp of its state."""
    return Lights(
        world=world,
        start_s=job.drive_time_s,
        live={state.group_id: LiveColour(0.0, state.colour) for state in job.signals},
        learnt={one.group_id: heard_cycle(one, job.state.stamp_ns) for one in job.learnt_signals},
        by_plan=job.lights_by_plan,
    )
