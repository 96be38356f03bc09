"""S cars on one stage, each in an episode of its own: begun, looked at and moved on in step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.errors import UserError
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker import driver_model as driver
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.batch.collision_detection import touched
from foretwin.sim_worker.futures.aims import Aims
from foretwin.sim_worker.futures.play import Play
from foretwin.sim_worker.futures.scene import JobScene
from foretwin.sim_worker.gym.episodes import Episodes
from foretwin.sim_worker.metrics.ground import DrivableGround
from foretwin.sim_worker.planner_interface import PlannerOutput, PlannerView
from foretwin.sim_worker.planners.giving_way import wait_arcs
from foretwin.world_gen.rules.signal_state import cycle_s

OFF_PATH_M = 6.0
"""A car so far beside the path has left it."""
_BEGINS_WITHIN_M = 5.0


class Sighting(NamedTuple):
    """What S cars see: the planners' view, and two things that follow from it.

    `wait_arc_m` (S,) is where the front has to wait for others by gap acceptance, infinite where it
    may go; `to_end_m` (S,) the way left to the end of the episode's path.
    """

    view: PlannerView
    wait_arc_m: Array
    to_end_m: Array


class StepFacts(NamedTuple):
    """What happened to S cars in one step, each (S,): a reward is a function of these.

    `progress_m` along the path, `speed_mps` after the step and `speed_gain_mps` in it,
    `target_speed_mps`, `accel_mps2`, `lateral_accel_mps2` and `jerk_mps3`. `aimed_speed_mps` is the
    target, or what the bend there lets a brisk driver have, and `aimed_gain_mps` by how much that
    rose in the step. `distance_share` is how much there was, up to 1, of the distance that a driver
    keeps to who is in the way. `collided` with a road user, building or island; `off_road` with the
    middle of the car, or far beside the path; `arrived` at the path's end; `ran_red` over a stop
    line, `did_not_wait` where others have priority and need the ground; `failed` where the physics
    diverged.
    """

    dt_s: float
    progress_m: Array
    speed_mps: Array
    speed_gain_mps: Array
    target_speed_mps: Array
    accel_mps2: Array
    lateral_accel_mps2: Array
    jerk_mps3: Array
    aimed_speed_mps: Array
    aimed_gain_mps: Array
    distance_share: Array
    collided: Flags
    off_road: Flags
    arrived: Flags
    ran_red: Flags
    did_not_wait: Flags
    failed: Flags

    @property
    def terminated(self) -> Flags:
        """(S,) bool: whether the episode is over."""
        return self.collided | self.off_road | self.arrived | self.failed


class EpisodeRows:
    """S cars, each in one of the episodes; the same episode and actions give the same bits in any
    row, alone or among others."""

    def __init__(
        self,
        episodes: Episodes,
        vehicle: VehicleParameters,
        *,
        count: int,
        control_hz: float,
        threads: int = 1,
    ) -> None:
        """Compile the World; raises UserError where no episode can be played on it."""
        world = episodes.world
        self.stage = BatchSimulation(
            world, vehicle, nsim=count, control_hz=control_hz, threads=threads
        )
        self.episodes, self.count = episodes, count
        tick_s = self.stage.control_dt_s
        self._pool = episodes.scenes.scene(episodes.job, vehicle, tick_s=tick_s)
        self.playable = _playable(self._pool)
        self._ground = DrivableGround(world) if world.road_surface else None
        self.light_cycle_s = 0.0
        """How long the longest cycle of the lights is; 0 where none run by a plan."""
        if episodes.job.lights_by_plan and self._pool.rules.groups:
            plans = [*(j.plan for j in world.junctions), *world.crossing_plans]
            cycles = [cycle_s(plan) for plan in plans if plan is not None]
            self.light_cycle_s = max(cycles, default=0.0)
        self._play: Play | None = None
        self.ticks = np.zeros(count, dtype=np.intp)
        """(S,) control ticks since each episode began."""
        self._lights_s = np.zeros(count)
        self._cases = np.zeros(count, dtype=np.intp)

    @property
    def time_s(self) -> Array:
        """(S,) since each episode began."""
        return np.asarray(self.ticks * self.stage.control_dt_s, dtype=np.float64)

    @property
    def scene(self) -> JobScene:
        """The scene as it is now."""
        assert self._play is not None, "nothing has begun"
        return self._play.scene

    def begin(
        self, rows: Indices, cases: Indices, lights_s: Array, *, looked: bool = False
    ) -> None:
        """Let `rows` (K,) begin the futures `cases` (K,) of the job; at first, all have to.

        `lights_s` (K,) is how much later by the lights' plans each is. See `Play.restart` about
        `looked`.
        """
        self._cases[rows], self._lights_s[rows], self.ticks[rows] = cases, lights_s, 0
        scene = scene_of(self._pool, self._cases)
        if self._play is None or len(rows) == self.count:
            self._play = Play(scene, self.stage)
        else:
            self._play.restart(rows, scene, looked=looked)

    def look(self) -> Sighting:
        """Return what all see now."""
        play = self._play
        assert play is not None, "nothing has begun"
        view = play.look_by_row(self.ticks, self._lights_s + self.time_s, self._sound_states())
        self._seen = Sighting(view, wait_arcs(view), self.episodes.end_arc_m - view.arc_m)
        return self._seen

    def step(self, commands: PlannerOutput) -> StepFacts:
        """Move on by one control tick after a look, and say what happened; then look again."""
        play, seen, dt_s = self._play, self._seen, self.stage.control_dt_s
        assert play is not None, "nothing has begun"
        before, users = self._sound_states(), self._users()
        with np.errstate(over="ignore", invalid="ignore"):
            play.act(self.time_s[:, None], commands)
        self.ticks += 1
        failed = self.stage.diverged()
        after = self._sound_states()
        place = play.scene.path.locate(after[:, :2], near_arc_m=seen.view.arc_m)
        front = np.column_stack([seen.view.arc_m, place.arc_m]) + play.front_m
        accel = after[:, 7]
        aimed = _aimed_mps(seen.view, np.column_stack([seen.view.arc_m, place.arc_m]))
        return StepFacts(
            dt_s=dt_s,
            progress_m=place.arc_m - seen.view.arc_m,
            speed_mps=after[:, 3].copy(),
            speed_gain_mps=after[:, 3] - before[:, 3],
            target_speed_mps=np.array(seen.view.target_speed_mps),
            accel_mps2=accel.copy(),
            lateral_accel_mps2=after[:, 3] * after[:, 5],
            jerk_mps3=(accel - before[:, 7]) / dt_s,
            aimed_speed_mps=aimed[:, 1],
            aimed_gain_mps=aimed[:, 1] - aimed[:, 0],
            distance_share=_distance_share(seen.view, before[:, 3]),
            collided=self._collided(before, after, users),
            off_road=self._off_road(after, place.offset_m),
            arrived=np.asarray(place.arc_m >= self.episodes.end_arc_m),
            ran_red=_crossed(seen.view.stop_arc_m, front),
            did_not_wait=_crossed(seen.wait_arc_m, front),
            failed=failed,
        )

    def _sound_states(self) -> Array:
        """Return states (S, 8) now; those that diverged are shown where they began."""
        states = self.stage.states
        failed = self.stage.diverged()
        if failed.any():
            return np.where(failed[:, None], self.scene.starts, states)
        return states.copy()

    def _users(self) -> Array:
        traffic = self.scene.traffic
        return np.zeros((self.count, 0, 3)) if traffic is None else traffic.poses

    def _collided(self, before: Array, after: Array, users: Array) -> Flags:
        found = np.zeros(self.count, dtype=bool)
        if self.stage.looked:
            found |= self.stage.static_contact
        if self.scene.traffic is not None:
            crowd = self.scene.traffic.crowd
            found |= touched(
                self.stage.vehicle,
                np.stack([before, after], axis=1),
                np.stack([users, self._users()], axis=1),
                np.stack([crowd.length_m, crowd.width_m], axis=-1),
                tick_s=self.stage.control_dt_s,
            )
        return found

    def _off_road(self, states: Array, offset_m: Array) -> Flags:
        off = np.abs(offset_m) > OFF_PATH_M
        if self._ground is not None:
            assert self._play is not None
            yaw, ahead = states[:, 2], self._play.centre_m
            x, y = states[:, 0] + ahead * np.cos(yaw), states[:, 1] + ahead * np.sin(yaw)
            off |= ~self._ground.contains(x, y)
        return np.asarray(off)


def scene_of(pool: JobScene, cases: Indices) -> JobScene:
    """Return the scene of (S,) futures of another one, each as it begins there."""
    traffic = sight = None
    if pool.traffic is not None and pool.sight is not None:
        traffic = pool.traffic.begun(cases)
        sight = pool.sight.begun(cases, traffic)
    return pool._replace(
        starts=pool.starts[cases],
        start_arc_m=pool.start_arc_m[cases],
        aims=Aims._make(None if column is None else column[..., cases] for column in pool.aims),
        planners=tuple(pool.planners[k] for k in cases),
        numbers=pool.numbers.of(cases),
        traffic=traffic,
        sight=sight,
        left_out=(),
    )


def _playable(pool: JobScene) -> Indices:
    """Return which futures can be played as episodes, forwards; UserError where none can."""
    place = pool.path.locate(pool.starts[:, :2], near_arc_m=pool.start_arc_m)
    beside = np.abs(place.offset_m) > _BEGINS_WITHIN_M
    found = [
        k
        for k, reason in enumerate(pool.left_out)
        if not (reason or beside[k] or pool.backwards[k])
    ]
    if not found:
        why = next(filter(None, pool.left_out), "")
        why = why or f"they begin {np.abs(place.offset_m).min():.1f} m beside the path"
        raise UserError(f"none of {len(pool.left_out)} episodes can be played: {why}")
    return np.array(found, dtype=np.intp)


def _aimed_mps(view: PlannerView, arc_m: Array) -> Array:
    """Return (S, N) the target speed, or what a brisk driver has in the bends at places (S, N)."""
    bend = view.path.speed_profile(
        lateral_accel_mps2=driver.HEEDLESS_BRISKNESS * driver.LATERAL_ACCEL_MPS2,
        decel_mps2=driver.HEEDLESS_BRISKNESS * driver.COMFORT_DECEL_MPS2,
    )
    return np.minimum(view.target_speed_mps[:, None], view.path.at_nodes(bend, arc_m))


def _distance_share(view: PlannerView, speed_mps: Array) -> Array:
    """Return (S,) the gap ahead as a share, up to 1, of what a driver wants at that speed."""
    wanted = driver.STANDSTILL_GAP_M + driver.dynamic_gap_m(
        speed_mps,
        view.lead_speed_mps,
        driver.BRISK_TIME_GAP_S,
        driver.MAX_ACCEL_MPS2,
        driver.COMFORT_DECEL_MPS2,
    )
    return np.clip(view.lead_gap_m / wanted, 0.0, 1.0)


def _crossed(line_arc_m: Array | None, front_arc_m: Array) -> Flags:
    """(S,) bool: whether fronts (S, 2), before and after, passed lines (S,)."""
    if line_arc_m is None:
        return np.zeros(len(front_arc_m), dtype=bool)
    before, after = front_arc_m.T
    return np.asarray((before < line_arc_m) & (after >= line_arc_m))
