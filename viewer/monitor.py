"""Messages to rows: one dispatch over all channels the viewer listens to."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from foretwin.contracts.arrays import Array
from foretwin.contracts.codec import read_message
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.roads_shown import RoadsShown
from foretwin.contracts.simulation import ActiveWorld, Event, WorldNotice
from foretwin.contracts.world import ATTRIBUTION, World
from foretwin.viewer import log_drive, log_roles, log_scenarios, log_tuning
from foretwin.viewer.colours import DETECTED, VIRTUAL
from foretwin.viewer.legend import legend_rows
from foretwin.viewer.log_camera_image import CameraImageLog
from foretwin.viewer.log_drive import DriveLog
from foretwin.viewer.log_lights import LightsLog
from foretwin.viewer.log_lot import rows_of_injection
from foretwin.viewer.log_point_cloud import PointCloudLog
from foretwin.viewer.log_radar_list import rows_of_radar_list
from foretwin.viewer.log_road_users import DETECTED_PATH, VIRTUAL_PATH, RoadUsersLog
from foretwin.viewer.log_roads import rows_of_roads
from foretwin.viewer.log_run import RunLog, rows_of_event
from foretwin.viewer.log_tuning import TuningLog
from foretwin.viewer.log_world import rows_of_world, world_centre
from foretwin.viewer.rows import Row

_log = logging.getLogger(__name__)


def read_world(worlds_dir: Path, world_id: str) -> World:
    """Return the World of that id; OSError or SchemaMismatch where its file cannot be read."""
    if Path(world_id).name != world_id:
        raise FileNotFoundError(f"{world_id!r} is no name of a World")
    return read_message(worlds_dir / f"{world_id}.world", World)


class Monitor:
    """Turns each message into rows, in drive time since the drive's start.

    `find_start` is called once, with the first stamp that is not 0, and returns the stamp of the
    drive's start: it may be known only once the vehicle speaks. What is stamped earlier, such as
    the run's preparations, is shown at drive time 0. `load_world` returns the World of
    an id; `lot` are the rows of a car's lot. A message that cannot be shown becomes an event in
    the recording, never an exception.
    """

    def __init__(
        self,
        *,
        drive_frame: LocalFrame,
        find_start: Callable[[int], int],
        title: str,
        attribution: str = ATTRIBUTION,
        load_world: Callable[[str], World],
        roads: RoadsShown | None = None,
        lot: Sequence[Row] = (),
        clock: Callable[[], str] | None = None,
        mono_s: Callable[[], float] | None = None,
    ) -> None:
        self._frame = drive_frame
        self._find_start = find_start
        self.start_ns: int | None = None
        """The stamp of the drive's start, once it is known."""
        self._load_world, self._roads, self._lot = load_world, roads, lot
        self._drive = DriveLog(drive_frame)
        self._detected = RoadUsersLog(drive_frame, DETECTED_PATH, DETECTED)
        self._round = log_scenarios.RoundLog(mono_s)
        self._lights = LightsLog(drive_frame)
        self._run = RunLog(title, attribution, clock)
        self._tuning = TuningLog()
        self._centres: dict[str, Array] = {}
        self._now_ns = 0
        self._handlers: dict[str, Callable[[Any, int], list[Row]]] = {
            "state": self._state,
            "gnss": self._drive.gnss,
            "plan": self._drive.plan,
            "end": lambda end, ns: self._say("info", f"vehicle: {end.reason}", ns),
            "round": self._round.rows,
            "comparison": log_scenarios.rows_of_comparison,
            "sibling": log_scenarios.rows_of_sibling,
            "plan_comparison": log_scenarios.rows_of_plan_comparison,
            "disagreement": lambda one, ns: log_scenarios.rows_of_disagreement(
                one, ns, self._frame
            ),
            "mirror": self._drive.mirror,
            "virtual_traffic": RoadUsersLog(drive_frame, VIRTUAL_PATH, VIRTUAL).rows,
            "objects": self._detected.rows,
            "injection": rows_of_injection,
            "point_cloud": PointCloudLog().rows,
            "lights": self._lights.rows,
            "radar_list": rows_of_radar_list,
            "camera_image": CameraImageLog().rows,
            "active_world": self._active_world,
            "world": self._world,
            "worker_status": self._run.worker,
            "progress": self._run.progress,
            "event": rows_of_event,
            "gap": self._tuning.gap,
            "verdict": self._tuning.verdict,
            "identification": self._tuning.identification,
            "parameter": self._tuning.parameter,
        }

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels whose messages can be shown."""
        return tuple(self._handlers)

    def opening(self) -> list[Row]:
        """Return the rows that come before every message."""
        return [
            *log_drive.static_rows(),
            *log_roles.static_rows(),
            *log_scenarios.static_rows(),
            *log_tuning.static_rows(),
            *legend_rows(),
            *(() if self._roads is None else rows_of_roads(self._roads)),
            *self._lot,
            *self._tuning.opening(),
            *self._run.static_rows(),
            self._run.first_status(),
        ]

    def handle(self, channel: str, message: Any) -> list[Row]:
        """Return the rows of one message."""
        stamp_ns = getattr(message, "stamp_ns", None)
        # A WorldNotice carries no stamp: it counts from the latest instant seen.
        drive_ns = self._now_ns if stamp_ns is None else self._drive_ns(stamp_ns)
        if channel in ("state", "mirror"):
            self._now_ns = max(self._now_ns, drive_ns)
        try:
            return self._handlers[channel](message, drive_ns)
        except Exception as problem:  # one odd message must not end the recording
            _log.exception("message on %s cannot be shown", channel)
            return self._say("error", f"{channel} at {drive_ns / 1e9:.2f} s: {problem}", drive_ns)

    def _drive_ns(self, stamp_ns: int) -> int:
        if self.start_ns is None:
            if stamp_ns == 0:
                return 0
            self.start_ns = self._find_start(stamp_ns)
        return max(0, stamp_ns - self.start_ns)

    def note(self, level: str, text: str) -> list[Row]:
        """Return an event of the viewer itself at the latest drive time."""
        return self._say(level, text, self._now_ns)

    def _say(self, level: Any, text: str, drive_ns: int) -> list[Row]:
        event = Event(stamp_ns=drive_ns, level=level, source="viewer", text=text)
        return rows_of_event(event, drive_ns)

    def _state(self, state: VehicleState, drive_ns: int) -> list[Row]:
        rows = self._drive.state(state, drive_ns)
        return [*rows, *self._detected.old(drive_ns), *self._round.old(drive_ns)]

    def _world(self, notice: WorldNotice, drive_ns: int) -> list[Row]:
        return self._show_world(notice.world_id, drive_ns)

    def _show_world(self, world_id: str, drive_ns: int) -> list[Row]:
        if world_id in self._centres:
            return []
        try:
            world = self._load_world(world_id)
        except (OSError, ValueError) as problem:
            return self._say("error", f"World {world_id} is not shown: {problem}", drive_ns)
        self._lights.know(world)
        self._centres[world_id] = world_centre(world, drive_frame=self._frame)
        return rows_of_world(world, drive_frame=self._frame, drive_ns=drive_ns)

    def _active_world(self, active: ActiveWorld, drive_ns: int) -> list[Row]:
        if active.world_id is None:
            self._drive.look_at(None)
            return self._round.none(drive_ns)
        rows = self._show_world(active.world_id, drive_ns)
        self._drive.look_at(self._centres.get(active.world_id))
        return rows
