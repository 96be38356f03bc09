"""Drives the cars of a scene: planners look, decide, and the stage moves all on."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.play import Play
from foretwin.sim_worker.futures.scene import JobScene
from foretwin.sim_worker.planner_interface import (
    Briefing,
    Planner,
    PlannerOutput,
    PlannerView,
    PlayAgain,
    RemembersWithinJob,
    TakesBriefing,
    ViewOfSome,
)
from foretwin.sim_worker.planners.registry import load_planner

Stacks = Mapping[str, TakesBriefing]
"""Driving stacks of a sweep, by the names under which its futures know them."""
NO_STACKS: Stacks = MappingProxyType({})


class DriveRecord(NamedTuple):
    """What was recorded at T control ticks.

    States (S, T, 8), static contacts and validity (S, T), progress (S,) along the path; of road
    users poses (S, T, R, 3) and speeds (S, T, R). `failures` (S,) says why a planner failed,
    `remarks` (S,) what one that did not has to say; `lost` are places of those whose planner's
    process hung or died.
    """

    states: Array
    static_contact: Flags
    valid: Flags
    progress_m: Array
    users: Array
    user_speed_mps: Array
    failures: tuple[str, ...]
    remarks: tuple[str, ...]
    lost: tuple[int, ...] = ()


def drive(
    scene: JobScene,
    stage: BatchSimulation,
    *,
    ticks: int,
    stacks: Stacks = NO_STACKS,
    brief: Callable[[], Briefing] | None = None,
) -> DriveRecord:
    """Seed the stage with the scene's starts and drive for a number of control ticks.

    Planners that are none of foretwin's are looked for among the `stacks`; who wants it is told
    what `brief` returns. Raises PlayAgain as they do.
    """
    play, planners = Play(scene, stage), _Planners(scene.planners, stacks, brief)
    count, traffic = len(scene.starts), scene.traffic
    most = 0 if traffic is None else traffic.arc_m.shape[1]
    states = np.empty((count, ticks + 1, 8))
    contact = np.zeros((count, ticks + 1), dtype=bool)
    valid, sound = np.ones((count, ticks + 1), dtype=bool), True
    users, user_speed = np.empty((count, ticks + 1, most, 3)), np.empty((count, ticks + 1, most))

    def keep(tick: int) -> None:
        states[:, tick] = stage.states
        if stage.looked:
            contact[:, tick] = stage.static_contact
        if traffic is not None:
            users[:, tick], user_speed[:, tick] = traffic.poses, traffic.speed_mps

    keep(0)
    for tick in range(ticks):
        if sound:
            view = play.look(tick, stage.states, stage.heading)
        else:
            # What has failed is not shown to planners: one bad future must not spoil the job.
            view = play.look(tick, np.where(valid[:, tick, None], stage.states, scene.starts))
        play.act(tick * stage.control_dt_s, planners.plan(view))
        keep(tick + 1)
        if not sound or planners.any_failed or stage.any_diverged():
            valid[:, tick + 1] = valid[:, tick] & ~stage.diverged() & ~planners.failed
            sound = bool(valid[:, tick + 1].all())
    ends = np.where(valid[:, -1:], states[:, -1, :2], scene.starts[:, :2])
    progress = scene.path.locate(ends, near_arc_m=play.arc_m).arc_m - scene.start_arc_m
    failures = [
        reason or ("" if well else "diverged")
        for reason, well in zip(planners.reasons, valid[:, -1], strict=True)
    ]
    return DriveRecord(
        states,
        contact,
        valid,
        progress,
        users,
        user_speed,
        tuple(failures),
        tuple(planners.remarks()),
        planners.lost(),
    )


class _Planners:
    """All planners of a job, each with its rows; one that fails takes only its own rows along."""

    def __init__(
        self, names: Sequence[str], stacks: Stacks, brief: Callable[[], Briefing] | None
    ) -> None:
        self.failed: Flags = np.zeros(len(names), dtype=bool)
        self.any_failed = False
        self.reasons = [""] * len(names)
        self._groups: list[tuple[str, Planner, Indices, ViewOfSome]] = []
        for kind in sorted(set(names)):
            rows = np.flatnonzero([name == kind for name in names])
            planner = _begun(kind, rows, stacks, brief)
            self._groups.append((kind, planner, rows, ViewOfSome(rows)))

    def plan(self, view: PlannerView) -> PlannerOutput:
        if len(self._groups) == 1:
            name, planner, rows, _ = self._groups[0]
            return self._ask(name, planner, rows, view)
        accel, angle = np.zeros(len(view.arc_m)), np.zeros(len(view.arc_m))
        alone = view._replace(users=None)
        for name, planner, rows, some in self._groups:
            shown = view if getattr(planner, "looks_at_users", True) else alone
            accel[rows], angle[rows] = self._ask(name, planner, rows, some.of(shown))
        return PlannerOutput(accel, angle)

    def _ask(self, name: str, planner: Planner, rows: Indices, view: PlannerView) -> PlannerOutput:
        if self.any_failed and self.failed[rows].all():
            return PlannerOutput(np.zeros(len(rows)), np.zeros(len(rows)))
        try:
            accel, angle = planner.plan(view)
            if np.shape(accel) != (len(rows),) or np.shape(angle) != (len(rows),):
                raise ValueError(
                    f"answers of shapes {np.shape(accel)} and {np.shape(angle)}, not {(len(rows),)}"
                )
        except PlayAgain:
            raise
        except Exception as error:
            # The others go on without it, whatever it was.
            self._fail(name, rows, f"{type(error).__name__}: {error}", view.time_s)
            return PlannerOutput(np.zeros(len(rows)), np.zeros(len(rows)))
        # Of what is no number, the sum of all products is none either.
        if not math.isfinite(np.dot(accel, angle)):
            fine = np.isfinite(accel + angle)
            said = getattr(planner, "remarks", {})
            for place in np.flatnonzero(~fine):
                reason = said.get(int(place), "answers what is no number")
                self._fail(name, rows[place : place + 1], reason, view.time_s)
            accel, angle = np.where(fine, accel, 0.0), np.where(fine, angle, 0.0)
        return PlannerOutput(accel, angle)

    def remarks(self) -> list[str]:
        """Return what planners have to say of the cars that they did drive, empty for most."""
        found = [""] * len(self.reasons)
        for _, planner, rows, _ in self._groups:
            for place, said in getattr(planner, "remarks", {}).items():
                if not self.failed[rows[place]]:
                    found[rows[place]] = said
        return found

    def lost(self) -> tuple[int, ...]:
        """Return the places of those whose planner's process hung or died."""
        found = [
            int(rows[place])
            for _, planner, rows, _ in self._groups
            for place in getattr(planner, "lost", ())
        ]
        return tuple(sorted(found))

    def _fail(self, name: str, rows: Indices, reason: str, time_s: float) -> None:
        for row in rows[~self.failed[rows]]:
            self.reasons[row] = f"planner {name!r} at {time_s:g} s: {' '.join(reason.split())}"
        self.failed[rows] = True
        self.any_failed = True


def _begun(
    name: str, rows: Indices, stacks: Stacks, brief: Callable[[], Briefing] | None
) -> Planner:
    """Return what drives some rows of a job from its first tick to its last."""
    if name in stacks and brief is not None:
        return stacks[name].begin_briefed(brief().of_rows(rows))
    planner = load_planner(name)
    if isinstance(planner, TakesBriefing) and brief is not None:
        return planner.begin_briefed(brief().of_rows(rows))
    return planner.begin(len(rows)) if isinstance(planner, RemembersWithinJob) else planner
