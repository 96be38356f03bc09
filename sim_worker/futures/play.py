"""A scene in motion, one control tick at a time: what planners see, and what their answers do."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array, Indices
from foretwin.geometry.frenet_path import FrenetPoint
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation, Controls
from foretwin.sim_worker.driver_model import DECIDE_EVERY_S
from foretwin.sim_worker.futures.scene import JobScene
from foretwin.sim_worker.planner_interface import PlannerOutput, PlannerView
from foretwin.sim_worker.road_users.crowd import EgoBoxes
from foretwin.sim_worker.road_users.perception import Lead
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m

_MAX_PACE_MPS = 80.0
"""No car gets on faster along its path: much more than any drives, since one that is beside a bend
on the inner side gets on faster than it drives."""


class Play:
    """The cars of a scene on a stage, and all other road users on their paths.

    Each tick is a `look` followed by an `act`. `scene.traffic` and the stage hold what is now.
    """

    def __init__(self, scene: JobScene, stage: BatchSimulation) -> None:
        """Seed the stage with the scene's starts."""
        self.scene, self.stage = scene, stage
        count = len(scene.starts)
        stage.seed(
            scene.starts,
            steering_delay_s=_steering_delay_s(scene, stage),
            friction_factor=scene.numbers.applied("ground.friction_factor", 1.0),
            backwards=scene.backwards,
        )
        self.arc_m = scene.start_arc_m.copy()
        self._lead = Lead(np.full(count, np.inf), np.zeros(count))
        self.centre_m = box_centre_from_base_m(stage.vehicle)
        self.front_m = self.centre_m + stage.vehicle.length_m.value / 2.0
        self._decide_every = max(round(DECIDE_EVERY_S / stage.control_dt_s), 1)
        self._tick_reach_m = _MAX_PACE_MPS * stage.control_dt_s
        self._red = np.full((1, 0), np.inf)

    def restart(self, rows: Indices, scene: JobScene, *, looked: bool) -> None:
        """Begin `rows` anew, as `scene` has them; the others go on.

        Traffic and sight of both were `begun` from one. `looked` says that planners have looked
        since the last act; they do so again now.
        """
        others = np.ones(len(scene.starts), dtype=bool)
        others[rows] = False
        before, self.scene = self.scene, scene
        self.stage.reseed(
            rows,
            scene.starts[rows],
            steering_delay_s=_steering_delay_s(scene, self.stage)[rows],
            friction_factor=scene.numbers.applied("ground.friction_factor", 1.0)[rows],
        )
        self.arc_m = np.where(others, self.arc_m, scene.start_arc_m)
        if scene.traffic is not None and before.traffic is not None:
            scene.traffic.carry_on(before.traffic, others)
        if scene.sight is not None and before.sight is not None:
            scene.sight.carry_on(before.sight, others, looked=looked)

    def look(self, tick: int, now: Array, heading: Array | None = None) -> PlannerView:
        """Return what planners see of the states (S, 8), the law-abiding having decided.

        `heading` (2, S) is the cosine and sine of their yaw, where these are known.
        """
        time_s = tick * self.stage.control_dt_s
        place = self._locate(now)
        if tick % self._decide_every == 0:
            every_s = self._decide_every * self.stage.control_dt_s
            self._decide(self.scene.red_arcs_m(time_s), now, place, every_s)
        return self._view(tick, time_s, now, place, heading)

    def look_by_row(self, ticks: Indices, lights_s: Array, now: Array) -> PlannerView:
        """Do the same for cars that began at different times, and decide at every tick.

        `ticks` (S,) are those since each began, `lights_s` (S,) the times by which lights run.
        """
        place = self._locate(now)
        times, which = np.unique(lights_s, return_inverse=True)
        red = np.stack([self.scene.red_arcs_m(float(time_s)) for time_s in times])
        red_arcs_m = red[which] if self.scene.rules.groups else red[0]
        self._decide(red_arcs_m, now, place, self.stage.control_dt_s)
        return self._view(ticks, np.nan, now, place)

    def act(self, time_s: float | Array, answer: PlannerOutput) -> None:
        """Advance by one control tick; `time_s` is one, or (S, 1)."""
        scene, stage = self.scene, self.stage
        accel, angle = scene.numbers.spoil(answer)
        stage.step(Controls(accel, angle))
        if scene.traffic is not None:
            scene.traffic.step(time_s=time_s, dt_s=stage.control_dt_s)

    def _locate(self, now: Array) -> FrenetPoint:
        place = self.scene.path.locate(
            now[:, :2], near_arc_m=self.arc_m, within_m=self._tick_reach_m
        )
        self.arc_m = place.arc_m
        return place

    def _decide(self, red_arcs_m: Array, now: Array, place: FrenetPoint, every_s: float) -> None:
        """Update the lights, and let law-abiding road users decide, as they do `every_s`."""
        scene, self._red = self.scene, red_arcs_m
        if scene.traffic is None or not scene.traffic.reacts:
            return
        yaw = now[:, 2]
        centre = now[:, :2] + self.centre_m * np.column_stack([np.cos(yaw), np.sin(yaw)])
        vehicle = self.stage.vehicle
        ego = EgoBoxes(
            poses=np.column_stack([centre, yaw]),
            speed_mps=now[:, 3],
            path_of=0,
            arc_m=place.arc_m + self.centre_m,
            length_m=vehicle.length_m.value,
            width_m=vehicle.width_m.value,
        )
        scene.traffic.decide(ego, red_arcs_m, every_s=every_s)

    def _view(
        self,
        tick: int | Indices,
        time_s: float,
        now: Array,
        place: FrenetPoint,
        heading: Array | None = None,
    ) -> PlannerView:
        scene = self.scene
        (target, rising), stop, seen = scene.aims.at(tick * self.stage.control_dt_s), None, None
        if scene.sight is not None and scene.traffic is not None:
            eyes = now[:, :2]
            if scene.sight.needs_eyes:
                ahead = np.column_stack([np.cos(now[:, 2]), np.sin(now[:, 2])])
                eyes = eyes + self.front_m * ahead
            seen = scene.sight.look(tick, scene.traffic, eyes)
            self._lead = scene.sight.lead(seen, place)
        if scene.limit_share is not None:
            share = scene.path.at_nodes(scene.limit_share, place.arc_m)
            target = target * share
        if self._red.shape[-1]:
            lines = self._red[..., 0, :]
            passed = lines < (place.arc_m + self.front_m)[:, None]
            stop = np.where(passed, np.inf, lines).min(axis=1)
        believed = scene.numbers.believed(now, place)
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
            vehicle=self.stage.vehicle,
            stop_arc_m=stop,
            users=seen,
            ground=scene.ground,
            car_plan=scene.car_plan,
            heading=heading,
            climb_mps2=self.stage.climb_mps2,
            target_accel_mps2=rising,
            bend_accel_mps2=scene.bend_accel_mps2,
        )


def _steering_delay_s(scene: JobScene, stage: BatchSimulation) -> Array:
    delay_s = stage.vehicle.steering_delay_s.value
    return scene.numbers.applied("vehicle.steering_delay_s", delay_s)
