"""Drives the cars of a scene: planners look, decide, and the stage moves everybody on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from contracts.arrays import Array
from sim_worker.actors.perception import Lead
from sim_worker.actors.traffic import EgoBoxes
from sim_worker.planners.base import Planner, PlannerOutput, PlannerView, rows_of
from sim_worker.planners.path import FrenetPoint
from sim_worker.planners.registry import load_planner
from sim_worker.scene import Scene
from sim_worker.stage import Controls, Stage
from sim_worker.vehicle.planar import box_centre_from_base_m

Flags = npt.NDArray[np.bool_]
Rows = npt.NDArray[np.intp]

DECIDE_EVERY_S = 0.2
"""How often law-abiding road users think again."""


class DriveRecord(NamedTuple):
    """What was recorded at T control ticks.

    States (S, T, 8), static contacts and validity (S, T), progress (S,) along the path; of road
    users poses (S, T, R, 3) and speeds (S, T, R). `failures` (S,) says why a planner failed.
    """

    states: Array
    static_contact: Flags
    valid: Flags
    progress_m: Array
    users: Array
    user_speed_mps: Array
    failures: tuple[str, ...]


def drive(scene: Scene, stage: Stage, *, ticks: int) -> DriveRecord:
    """Seed the stage with the scene's starts and drive for a number of control ticks."""
    faults = scene.faults
    stage.seed(
        scene.starts,
        steering_delay_s=stage.vehicle.steering_delay_s.value + faults.steering_delay_s,
        friction_factor=faults.friction_factor,
    )
    loop = _Loop(scene, stage, ticks)
    for tick in range(ticks):
        loop.advance(tick)
    return loop.record()


class _Loop:
    def __init__(self, scene: Scene, stage: Stage, ticks: int) -> None:
        self._scene, self._stage = scene, stage
        count = len(scene.starts)
        self._planners = _Planners(scene.planners)
        self._states = np.empty((count, ticks + 1, 8))
        self._states[:, 0] = stage.states
        self._contact = np.zeros((count, ticks + 1), dtype=bool)
        self._valid = np.ones((count, ticks + 1), dtype=bool)
        self._sound = True
        self._arc = scene.start_arc_m
        self._lead = Lead(np.full(count, np.inf), np.zeros(count))
        self._centre_m = box_centre_from_base_m(stage.vehicle)
        self._front_m = self._centre_m + stage.vehicle.length_m.value / 2.0
        self._decide_every = max(round(DECIDE_EVERY_S / stage.control_dt_s), 1)
        traffic = scene.traffic
        most = 0 if traffic is None else traffic.arc_m.shape[1]
        self._users = np.empty((count, ticks + 1, most, 3))
        self._user_speed = np.empty((count, ticks + 1, most))
        self._note_users(0)
        self._red = np.full((1, 0), np.inf)

    def advance(self, tick: int) -> None:
        scene, stage = self._scene, self._stage
        time_s = tick * stage.control_dt_s
        now = stage.states
        if not self._sound:
            # What has failed is not shown to planners: one bad future must not spoil the job.
            now = np.where(self._valid[:, tick, None], now, scene.starts)
        place = scene.path.locate(now[:, :2], near_arc_m=self._arc)
        self._arc = place.arc_m
        if tick % self._decide_every == 0:
            self._decide(time_s, now, place)
        answer = self._planners.plan(self._view(tick, time_s, now, place))
        accel, angle = scene.faults.spoil(answer)
        stage.step(Controls(accel, angle))
        if scene.traffic is not None:
            scene.traffic.step(time_s=time_s, dt_s=stage.control_dt_s)
        self._keep(tick + 1)

    def _decide(self, time_s: float, now: Array, place: FrenetPoint) -> None:
        """Look at the lights, and let the law-abiding look at everybody."""
        scene = self._scene
        self._red = scene.red_arcs_m(time_s)
        if scene.traffic is None or not scene.traffic.reacts:
            return
        yaw = now[:, 2]
        centre = now[:, :2] + self._centre_m * np.column_stack([np.cos(yaw), np.sin(yaw)])
        vehicle = self._stage.vehicle
        ego = EgoBoxes(
            poses=np.column_stack([centre, yaw]),
            speed_mps=now[:, 3],
            path_of=0,
            arc_m=place.arc_m + self._centre_m,
            length_m=vehicle.length_m.value,
            width_m=vehicle.width_m.value,
        )
        scene.traffic.decide(ego, self._red)

    def _view(self, tick: int, time_s: float, now: Array, place: FrenetPoint) -> PlannerView:
        scene = self._scene
        target, stop, seen = scene.aims.target_speed_mps, None, None
        if scene.sight is not None and scene.traffic is not None:
            ahead = np.column_stack([np.cos(now[:, 2]), np.sin(now[:, 2])])
            seen = scene.sight.look(tick, scene.traffic, now[:, :2] + self._front_m * ahead)
            self._lead = scene.sight.lead(seen, place)
        if scene.limit_share is not None:
            target = target * scene.path.at_nodes(scene.limit_share, place.arc_m)
        if self._red.shape[1]:
            lines = np.broadcast_to(self._red[0], (len(now), self._red.shape[1]))
            passed = lines < (place.arc_m + self._front_m)[:, None]
            stop = np.where(passed, np.inf, lines).min(axis=1)
        believed = scene.faults.believed(now, place)
        return PlannerView(
            time_s=time_s,
            states=believed.states,
            path=scene.path,
            arc_m=place.arc_m,
            offset_m=believed.offset_m,
            desired_offset_m=scene.aims.offset_m,
            target_speed_mps=target,
            speed_factor=scene.aims.speed_factor,
            lead_gap_m=self._lead.gap_m,
            lead_speed_mps=self._lead.speed_mps,
            vehicle=self._stage.vehicle,
            stop_arc_m=stop,
            users=seen,
            ground=scene.ground,
            car_plan=scene.car_plan,
        )

    def _keep(self, tick: int) -> None:
        stage = self._stage
        self._states[:, tick] = stage.states
        if stage.looked:
            self._contact[:, tick] = stage.static_contact
        self._note_users(tick)
        diverged = stage.diverged()
        if not self._sound or diverged.any() or self._planners.any_failed:
            well = ~diverged & ~self._planners.failed
            self._valid[:, tick] = self._valid[:, tick - 1] & well
            self._sound = bool(self._valid[:, tick].all())

    def _note_users(self, tick: int) -> None:
        traffic = self._scene.traffic
        if traffic is not None:
            self._users[:, tick] = traffic.poses
            self._user_speed[:, tick] = traffic.speed_mps

    def record(self) -> DriveRecord:
        scene = self._scene
        ends = np.where(self._valid[:, -1:], self._states[:, -1, :2], scene.starts[:, :2])
        end = scene.path.locate(ends, near_arc_m=self._arc).arc_m
        return DriveRecord(
            self._states,
            self._contact,
            self._valid,
            end - scene.start_arc_m,
            self._users,
            self._user_speed,
            tuple(
                self._planners.reasons[row] or ("" if self._valid[row, -1] else "diverged")
                for row in range(len(scene.starts))
            ),
        )


class _Planners:
    """All planners of a job, each with its rows; one that fails takes only its own rows along."""

    def __init__(self, names: Sequence[str]) -> None:
        self.failed: Flags = np.zeros(len(names), dtype=bool)
        self.any_failed = False
        self.reasons = [""] * len(names)
        self._groups: list[tuple[str, Planner, Rows]] = [
            (kind, load_planner(kind), np.flatnonzero([name == kind for name in names]))
            for kind in sorted(set(names))
        ]

    def plan(self, view: PlannerView) -> PlannerOutput:
        if len(self._groups) == 1:
            name, planner, rows = self._groups[0]
            return self._ask(name, planner, rows, view)
        accel, angle = np.zeros(len(view.arc_m)), np.zeros(len(view.arc_m))
        for name, planner, rows in self._groups:
            accel[rows], angle[rows] = self._ask(name, planner, rows, rows_of(view, rows))
        return PlannerOutput(accel, angle)

    def _ask(self, name: str, planner: Planner, rows: Rows, view: PlannerView) -> PlannerOutput:
        if self.any_failed and self.failed[rows].all():
            return PlannerOutput(np.zeros(len(rows)), np.zeros(len(rows)))
        try:
            accel, angle = planner.plan(view)
            if np.shape(accel) != (len(rows),) or np.shape(angle) != (len(rows),):
                raise ValueError(
                    f"answers of shapes {np.shape(accel)} and {np.shape(angle)}, not {(len(rows),)}"
                )
        except Exception as error:
            # The others go on without it, whatever it was.
            self._fail(name, rows, f"{type(error).__name__}: {error}", view.time_s)
            return PlannerOutput(np.zeros(len(rows)), np.zeros(len(rows)))
        fine = np.isfinite(accel + angle)
        if not fine.all():
            self._fail(name, rows[~fine], "answers what is no number", view.time_s)
            accel, angle = np.where(fine, accel, 0.0), np.where(fine, angle, 0.0)
        return PlannerOutput(accel, angle)

    def _fail(self, name: str, rows: Rows, reason: str, time_s: float) -> None:
        for row in rows[~self.failed[rows]]:
            self.reasons[row] = f"planner {name!r} at {time_s:g} s: {' '.join(reason.split())}"
        self.failed[rows] = True
        self.any_failed = True
