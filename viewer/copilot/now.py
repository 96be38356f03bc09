"""What is known of a drive now: takes messages of the bus and makes frames of the display."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from foretwin.contracts.arrays import Array, Array32
from foretwin.contracts.drive import RoadUsers, VehicleState
from foretwin.contracts.frames import LocalFrame, local_from_geo, local_from_geo_yaw
from foretwin.contracts.frames import target_from_source_m as moved_m
from foretwin.contracts.simulation import (
    ActiveWorld,
    MirrorSample,
    PlaneState,
    Progress,
    RoundView,
    WorldNotice,
)
from foretwin.contracts.terminal import plain
from foretwin.contracts.too_old import USERS_FOR_NS
from foretwin.contracts.towards_vehicle import Injection
from foretwin.contracts.world import World
from foretwin.viewer.copilot import words
from foretwin.viewer.copilot.alerts import Alerts
from foretwin.viewer.copilot.frame import AheadFrame, AlertFrame, DangerFrame, PageFrame, SeenFrame
from foretwin.viewer.copilot.lights_now import LightsNow
from foretwin.viewer.copilot.right_of_way import RightOfWay, of_junction, right_of_way
from foretwin.viewer.copilot.round_now import OLD_ROUND_S, RoundNow
from foretwin.viewer.danger import ROUND_FOR_S, Danger, instant_of

MOST_SEEN = 60
_OTHERS_SHOWN = 10


class DriveNow:
    """What is known of one drive; times are of one rising clock, in seconds.

    `find_start` is called once, with the first state's stamp, and returns that of the drive's
    start. `load_world` returns the World of an id, or raises OSError or ValueError.
    """

    def __init__(
        self,
        *,
        drive_frame: LocalFrame,
        find_start: Callable[[int], int],
        load_world: Callable[[str], World],
        now_s: float,
    ) -> None:
        self._frame, self._load_world = drive_frame, load_world
        self._find_start, self._start_ns = find_start, 0
        self.alerts = Alerts(now_s)
        self.marks = 0
        self._state: VehicleState | None = None
        self._mirror: MirrorSample | None = None
        self._progress: Progress | None = None
        self._round = RoundNow()
        self._seen: RoadUsers | None = None
        self._lights = LightsNow()
        self._injection: tuple[Injection | None, float] = None, 0.0
        self._active: str | None = None
        self._worlds: dict[str, str] = {}
        """World ids by junction."""
        self._loaded: dict[str, World | None] = {}
        self._way: tuple[str, RightOfWay] | None = None
        """What the junction of this id asks."""
        self._takes: dict[str, Callable[[Any, float], object]] = {
            "state": self._take_state,
            "progress": self._take_progress,
            "round": self._take_round,
            "mirror": lambda one, _: setattr(self, "_mirror", one),
            "objects": lambda one, _: setattr(self, "_seen", one),
            "signals": lambda one, _: self._lights.take_heard(one),
            "lights": lambda one, _: self._lights.take_shown(one),
            "active_world": self._take_active,
            "world": self._take_world,
            "worker_status": lambda one, _: self.alerts.worker(one),
            "gap_alarm": lambda one, _: self.alerts.gap(one),
            "verdict": lambda one, _: self.alerts.verdict(one),
            "injection": self._take_injection,
            "event": self.alerts.event,
            "run_end": lambda one, _: self.alerts.end("the run has ended"),
        }

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels whose messages are taken."""
        return tuple(self._takes)

    def take(self, channel: str, message: Any, now_s: float) -> None:
        """Take one message."""
        self._takes[channel](message, now_s)

    def _take_state(self, state: VehicleState, now_s: float) -> None:
        if self._state is None:
            self._start_ns = self._find_start(state.stamp_ns)
        self._state = state
        self._round.state(state, now_s)
        self.alerts.state(state, now_s)

    def _take_progress(self, progress: Progress, now_s: float) -> None:
        self._progress = progress
        self.alerts.progress(progress, now_s)

    def _take_injection(self, told: Injection, now_s: float) -> None:
        self._injection = told, now_s
        self.alerts.injection(told)

    def _take_active(self, active: ActiveWorld, now_s: float) -> None:
        self._active = active.world_id
        if active.world_id is None:
            self._round.forget()

    def _take_world(self, notice: WorldNotice, now_s: float) -> None:
        self._worlds[notice.intersection_id] = notice.world_id

    def _take_round(self, view: RoundView, now_s: float) -> None:
        self.alerts.round(view, now_s)
        if view.late or not len(view.names):
            return
        self._worlds[view.intersection_id] = view.world_id
        self._round.take(view, now_s)
        world = self._world(view.world_id)
        if world is not None:
            line_m = np.asarray(view.xy_m[view.nominal_index], dtype=np.float64)
            path_m = moved_m(world.frame, self._frame, line_m)
            way = right_of_way(world, view.intersection_id, path_m)
            if way is not None:
                self._way = view.intersection_id, way

    def _world(self, world_id: str) -> World | None:
        """Return a World, None where its file cannot be read; of old ones nothing is kept."""
        if world_id not in self._loaded:
            while len(self._loaded) >= 4:
                del self._loaded[next(iter(self._loaded))]
            try:
                self._loaded[world_id] = self._load_world(world_id)
            except (OSError, ValueError):
                self._loaded[world_id] = None
        return self._loaded[world_id]

    def world(self, world_id: str) -> World | None:
        """Return a World that has been told of, None for any other."""
        told = world_id == self._active or world_id in self._worlds.values()
        return self._world(world_id) if told else None

    def frame(self, now_s: float, *, linked: bool = True) -> PageFrame:
        """Return what the display shows now."""
        age_s = self._round.age_s(now_s)
        view, danger = self._round.view, self._round.danger
        standing = words.standing_of(self._mirror, self.alerts.accused)
        ahead = self._ahead()
        return PageFrame(
            drive_s=0.0 if self._state is None else self._drive_s(self._state.stamp_ns),
            level=self._round.level,
            sentence=words.sentence(
                self._progress,
                "" if ahead is None else " ".join(filter(None, (ahead.control, ahead.colour))),
                danger,
                standing,
                known=view is not None,
                elapsed_s=age_s or 0.0,
            ),
            speed_kmh=None if self._state is None else round(self._state.speed_mps * 3.6, 1),
            pose=self._pose(),
            twin_pose=None if self._mirror is None else _posed(self._mirror.twin),
            ahead=ahead,
            danger=None if view is None or danger is None else _danger(view, danger, age_s or 0.0),
            more=max(0, len(self._round.dangers) - 1),
            twin=standing.text,
            twin_detail=standing.detail,
            twin_well=standing.well,
            alerts=[
                AlertFrame(kind=one.kind, text=one.text, grave=one.grave)
                for one in self.alerts.now(now_s, linked=linked)
            ],
            world_id=self._shown_world,
            nominal=[] if view is None else _points(view.xy_m[view.nominal_index]),
            others=[]
            if view is None
            else [_points(view.xy_m[one.future]) for one in self._round.dangers[1:_OTHERS_SHOWN]],
            seen=self._seen_now(),
            lights=self._lights_now(),
            roles=self._roles(),
            marks=self.marks,
            round_age_s=age_s,
            pace="" if self._progress is None else plain(self._progress.too_slow),
            virtual=words.virtual_objects(self._injection[0], age_s=now_s - self._injection[1]),
            round_old=age_s is not None and age_s > OLD_ROUND_S,
            round_for_s=None if age_s is None else ROUND_FOR_S - age_s,
        )

    @property
    def _shown_world(self) -> str | None:
        """The World of the junction ahead, or, where there is none yet, the one that counts."""
        progress = self._progress
        if progress is not None and progress.junction_id is not None:
            found = self._worlds.get(progress.junction_id)
            if found is not None and self._active in (None, found):
                return found
        return self._active

    def _drive_s(self, stamp_ns: int) -> float:
        return max(0.0, (stamp_ns - self._start_ns) / 1e9)

    def _ahead(self) -> AheadFrame | None:
        progress = self._progress
        if progress is None or progress.next_intersection is None:
            return None
        way = of_junction(progress.junction_control)
        if self._way is not None and self._way[0] == progress.junction_id:
            way = self._way[1]
        light = None if way.group_id is None else self._lights_now().get(way.group_id)
        return AheadFrame(
            name=plain(progress.next_intersection),
            arrival=words.arrival(progress),
            span=words.arrival_span(progress),
            in_s=progress.arrival_in_s,
            away_m=progress.junction_m,
            sign=way.sign,
            control=way.text,
            colour=light or "",
            light=self._lights.of(way.group_id),
        )

    def _pose(self) -> list[float] | None:
        state = self._state
        if state is None:
            return None
        lat, lon = state.position.lat_deg, state.position.lon_deg
        x, y = local_from_geo(self._frame, lat, lon).tolist()
        yaw = float(local_from_geo_yaw(self._frame, state.yaw_rad, lat, lon))
        return [round(x, 2), round(y, 2), round(yaw, 4), round(state.speed_mps, 2)]

    def _seen_now(self) -> list[SeenFrame]:
        seen, state = self._seen, self._state
        if seen is None or state is None or state.stamp_ns - seen.stamp_ns > USERS_FOR_NS:
            return []
        users = seen.users[:MOST_SEEN]
        if not users:
            return []
        lat = np.array([one.position.lat_deg for one in users])
        lon = np.array([one.position.lon_deg for one in users])
        places = local_from_geo(self._frame, lat, lon)
        yaws = local_from_geo_yaw(self._frame, np.array([one.yaw_rad for one in users]), lat, lon)
        return [
            SeenFrame(
                kind=one.kind,
                at=place.round(1).tolist(),
                yaw=round(float(yaw), 3),
                size=[round(one.length_m, 1), round(one.width_m, 1)],
            )
            for one, place, yaw in zip(users, places, np.asarray(yaws), strict=True)
        ]

    def _lights_now(self) -> dict[str, str]:
        return {} if self._state is None else self._lights.colours(self._state.stamp_ns)

    def _roles(self) -> dict[str, str]:
        if self._mirror is None:
            return {}
        own = "ego" if self._state is None else self._state.vehicle_id
        roles: dict[str, str] = {own: self._mirror.role}
        return roles | {plain(one.vehicle_id): one.role for one in self._mirror.others}


def _posed(one: PlaneState) -> list[float]:
    return [round(one.x_m, 2), round(one.y_m, 2), round(one.yaw_rad, 4), round(one.speed_mps, 2)]


def _points(line_m: Array | Array32) -> list[list[float]]:
    return np.asarray(line_m, dtype=np.float64).round(1).tolist()  # type: ignore[no-any-return]


def _danger(view: RoundView, danger: Danger, age_s: float) -> DangerFrame:
    met = {one.future: number for number, one in enumerate(view.met)}
    number = met.get(danger.future)
    until = instant_of(view, danger.in_s)
    return DangerFrame(
        what=danger.what,
        odds=danger.odds,
        in_s=round(max(0.0, danger.in_s - age_s), 1),
        hits=danger.hits,
        path=_points(view.xy_m[danger.future, : until + 1]),
        other=[] if number is None else _points(view.user_xy_m[number, : until + 1]),
    )
