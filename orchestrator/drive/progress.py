"""The progress of a drive: one line on the terminal, and the same on the bus."""

from __future__ import annotations

import contextlib
import time
from typing import Literal

from rich.status import Status

from foretwin.contracts.keys import key
from foretwin.contracts.sensor_turns import passed_over_text, read_turns
from foretwin.contracts.simulation import Event, Progress, WorkerStatus
from foretwin.contracts.terminal import console, plain, say, visible, words
from foretwin.orchestrator.drive.conductor import Conductor
from foretwin.orchestrator.drive.mission import Mission
from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.rounds.arrival_band import ArrivalBand
from foretwin.orchestrator.routing.arrival import NextJunction

PERIOD_S = 0.25
PLAIN_PERIOD_S = 10.0
RATE_WINDOW_S = 5.0


class ProgressLine:
    """Shows where the drive is; on a terminal as a line that renews itself, else now and then."""

    def __init__(self, conductor: Conductor, mission: Mission) -> None:
        self._conductor = conductor
        self._mission = mission
        self._console = console(error=True)
        self._status: Status | None = None
        self._last_s = 0.0
        self._last_plain_s = time.monotonic()
        self._counts: list[tuple[float, int]] = []

    def __enter__(self) -> ProgressLine:
        if self._console.is_terminal:
            self._status = self._console.status(words("starting"), spinner="dots")
            self._status.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._status is not None:
            with contextlib.suppress(OSError):
                self._status.stop()

    def say(self, text: str) -> None:
        """Print a line that stays."""
        with contextlib.suppress(OSError):  # a terminal that is gone ends no drive
            self._console.print(visible(text), soft_wrap=True)

    def tell(self, event: Event) -> None:
        """Print what the engineer should know now: warnings and errors."""
        if event.level != "info":
            self.say(plain(f"{event.level}: {event.source}: {event.text}"))

    def update(self, now_s: float) -> None:
        """Renew the line and publish it, at most a few times a second."""
        if now_s - self._last_s < PERIOD_S:
            return
        self._last_s = now_s
        progress = self._progress(now_s)
        conductor = self._conductor
        conductor.context.publish("progress", progress)
        for status in worker_statuses(conductor, progress.stamp_ns):
            conductor.context.publish("worker_status", status)
        text = self._text(progress)
        if self._status is not None:
            with contextlib.suppress(OSError):
                self._status.update(words(text))
        elif now_s - self._last_plain_s >= PLAIN_PERIOD_S:
            self._last_plain_s = now_s
            say(text, error=True)

    def _progress(self, now_s: float) -> Progress:
        conductor, mission = self._conductor, self._mission
        self._counts.append((now_s, conductor.rounds.futures.count))
        self._counts = [c for c in self._counts if now_s - c[0] <= RATE_WINDOW_S]
        since_s, before = self._counts[0]
        rate = (
            (conductor.rounds.futures.count - before) / (now_s - since_s)
            if now_s > since_s
            else 0.0
        )
        ahead = mission.next_junction
        band = self._band(ahead)
        return Progress(
            stamp_ns=conductor.intake.now_stamp_ns,
            drive_time_s=mission.drive_time_s,
            mission_state=mission.state,
            next_intersection=ahead.name if ahead else None,
            arrival_in_s=ahead.in_s if ahead else None,
            arrival_early_s=band.early_s if band else None,
            arrival_late_s=band.late_s if band else None,
            junction_id=ahead.junction_id if ahead else None,
            junction_control=ahead.control if ahead else None,
            junction_m=ahead.distance_m if ahead else None,
            futures_per_s=rate,
            dropped=conductor.mailbox.dropped + conductor.tables.dropped,
            too_slow=conductor.rounds.pace.short_of,
            memory_mb=sum(conductor.context.memory.now_mb.values()) or None,
        )

    def _band(self, ahead: NextJunction | None) -> ArrivalBand | None:
        forecasts = self._conductor.rounds.progress
        if ahead is None or ahead.in_s is None or forecasts is None:
            return None
        usual_mps = self._mission.way.usual_speed_mps
        band = forecasts.arrival_band(ahead.distance_m, usual_mps=usual_mps)
        return None if band is None else band.around(ahead.in_s)

    @property
    def _open_to_all(self) -> str:
        """Said on every line where nobody has to show who it is."""
        config = self._conductor.plan.config
        return f"INSECURE {config.endpoint}  " if config.insecure else ""

    def _text(self, progress: Progress) -> str:
        conductor = self._conductor
        dispatch, far = conductor.rounds.dispatcher.dispatch, len(conductor.fleet.playing)
        sick = " ".join(name for name in dispatch.workers if name in dispatch.sickness.sick)
        ahead = "no junction ahead"
        if progress.next_intersection is not None:
            ahead = f"{progress.next_intersection} {progress.arrival_text}"
        passed_over = ""
        if conductor.plan.sensors:
            passed_over = passed_over_text(read_turns(conductor.plan.processes_dir))
        short = f"{progress.too_slow} (machine too slow for all)  " if progress.too_slow else ""
        return (
            f"{self._open_to_all}{progress.drive_time_s:7.1f} s  {progress.mission_state}  {ahead}"
            f"  {short}"
            f"{progress.futures_per_s:.0f} futures/s  "
            f"workers {len(dispatch.workers) - far}/{conductor.plan.config.workers}"
            f"{f' +{far} far' if far else ''}{f' ({sick} sick)' if sick else ''}  "
            f"missed {conductor.rounds.tally.missed}  "
            f"dropped {progress.dropped}"
            f"{f'  {passed_over}' if passed_over else ''}"
        )


def waiting_text(plan: DrivePlan) -> str:
    """Return what a drive with a live car waits for, and where that has to arrive."""
    vehicle_id, endpoint = plan.config.vehicle_id, plan.bus.endpoint
    if plan.ros2 is None:
        keys = key("gnss", vehicle=vehicle_id).removesuffix("gnss") + "…"
        return f"waiting for a live car: its telemetry as {keys} on {endpoint}"
    where = plan.ros2.mapping.endpoint or endpoint
    return f"waiting for a live car: the ROS 2 topics of {plan.ros2.name} on {where}"


def worker_statuses(conductor: Conductor, stamp_ns: int) -> list[WorkerStatus]:
    """Return how each worker of a drive is, those that are not there included."""
    dispatch, memory_mb = conductor.rounds.dispatcher.dispatch, conductor.context.memory.now_mb
    busy, sick = dispatch.busy, dispatch.sickness.sick
    up, far = set(dispatch.workers), {one.worker_id: one for one in conductor.fleet.playing}
    near = (f"w{index}" for index in range(conductor.plan.config.workers))
    statuses = []
    for worker_id in (*near, *sorted(far)):
        state: Literal["idle", "busy", "sick", "dead"] = "dead"
        if worker_id in up:
            state = "busy" if worker_id in busy else "idle"
            state = "sick" if worker_id in sick else state
        statuses.append(
            WorkerStatus(
                stamp_ns=stamp_ns,
                worker_id=worker_id,
                state=state,
                rtf=conductor.rounds.rtf.get(worker_id),
                memory_mb=memory_mb.get(worker_id),
                link_ms=far[worker_id].link_ms if worker_id in far else None,
                clock_offset_ms=far[worker_id].clock_offset_ms if worker_id in far else None,
            )
        )
    return statuses
