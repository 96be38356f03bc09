"""What of a run is wrong, in words, the gravest first; a state machine without bus and clock."""

from __future__ import annotations

from typing import Literal, NamedTuple, get_args

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.gap import Culprit, GapAlarm, Verdict
from foretwin.contracts.simulation import Event, Progress, RoundView, WorkerStatus
from foretwin.contracts.terminal import plain
from foretwin.contracts.too_old import LATE_ROUNDS, OF_ROUNDS, STALE_S
from foretwin.contracts.towards_vehicle import Injection

Kind = Literal[
    "ended",
    "link",
    "process",
    "telemetry",
    "injection",
    "verdict",
    "gap",
    "rounds",
    "off_map",
    "worker",
    "event",
]
GRAVE: tuple[Kind, ...] = ("ended", "link", "process", "telemetry")
"""Where one of these is the cause, nothing else on the display can be believed."""
_ORDER: tuple[Kind, ...] = get_args(Kind)
"""The gravest first."""

NO_ROUND_S = 4.0
"""So long may no round come where a junction is ahead: the slowest pace is one in two seconds."""
EVENT_SHOWN_S = 12.0
ACCUSES: tuple[Culprit, ...] = ("vehicle", "model", "both")


class Alert(NamedTuple):
    """Something that is wrong with the run, and its cause."""

    kind: Kind
    text: str

    @property
    def grave(self) -> bool:
        """Whether nothing else on the display can be believed."""
        return self.kind in GRAVE


class Alerts:
    """Takes what is heard of a run; `now` says what is wrong. Times are of one rising clock."""

    def __init__(self, began_s: float) -> None:
        self._heard_s = began_s
        """When the newest state came, or the display began to wait for one."""
        self._state: VehicleState | None = None
        self._progress: Progress | None = None
        self._late: list[bool] = []
        self._round_s: float | None = None
        self._latency_ms = 0.0
        self._gone: dict[str, None] = {}
        self._gaps: dict[str, GapAlarm] = {}
        self._verdict: Verdict | None = None
        self._workers: dict[str, WorkerStatus] = {}
        self._injection: Injection | None = None
        self._event: tuple[float, Event] | None = None
        self._ended = ""

    def state(self, state: VehicleState, now_s: float) -> None:
        """Take a state of the car."""
        self._state, self._heard_s = state, now_s

    def progress(self, progress: Progress, now_s: float) -> None:
        """Take where the drive is; rounds are waited for from when a junction is ahead."""
        before, self._progress = self._progress, progress
        if before is None or (before.junction_id is None) != (progress.junction_id is None):
            self._round_s = now_s

    def round(self, view: RoundView, now_s: float) -> None:
        """Take a round."""
        self._late = [*self._late[1 - OF_ROUNDS :], view.late]
        self._round_s, self._latency_ms = now_s, view.latency_ms

    def alive(self, process_id: str, *, up: bool) -> None:
        """Take that a process of the run appeared or vanished."""
        if up:
            self._gone.pop(process_id, None)
        else:
            self._gone[process_id] = None

    def gap(self, alarm: GapAlarm) -> None:
        """Take a gap beyond its limit, or back within it."""
        if alarm.over:
            self._gaps[alarm.quantity] = alarm
        else:
            self._gaps.pop(alarm.quantity, None)

    def verdict(self, verdict: Verdict) -> None:
        """Take a verdict; the last one stands."""
        self._verdict = verdict

    def worker(self, status: WorkerStatus) -> None:
        """Take how a worker is."""
        self._workers[status.worker_id] = status

    def injection(self, told: Injection) -> None:
        """Take whether the car on its lot is shown what is virtual."""
        self._injection = told

    def event(self, event: Event, now_s: float) -> None:
        """Take something worth telling; what is information alone is no alert."""
        if event.level != "info":
            self._event = now_s, event

    def end(self, why: str) -> None:
        """The run is over: nothing that is shown is current any more."""
        self._ended = self._ended or why

    @property
    def accused(self) -> Verdict | None:
        """The verdict that stands, where it accuses somebody."""
        found = self._verdict
        return found if found is not None and found.culprit in ACCUSES else None

    def now(self, now_s: float, *, linked: bool = True) -> list[Alert]:
        """Return what is wrong, the gravest first; `linked` says whether the bus is there."""
        if self._ended:
            return [Alert("ended", self._ended)]
        found: list[Alert] = []
        if not linked:
            found.append(Alert("link", "no link to the drive"))
        if self._gone:
            names = ", ".join(plain(one) for one in self._gone)
            found.append(Alert("process", f"process gone: {names}"))
        found += self._telemetry(now_s)
        if self._injection is not None and self._injection.gate == "shut":
            why = self._injection.reason
            found.append(Alert("injection", f"virtual objects are off for good: {why}"))
        if (verdict := self.accused) is not None:
            found.append(Alert("verdict", f"verdict: {plain(verdict.text)}"))
        if self._gaps:
            found.append(
                Alert("gap", f"gap beyond limit: {', '.join(map(_gap, self._gaps.values()))}")
            )
        found += self._rounds(now_s)
        if self._progress is not None and self._progress.mission_state == "off_map":
            found.append(Alert("off_map", "off the map: no rounds"))
        out = [one for one in self._workers.values() if one.state in ("sick", "dead")]
        # Of one that is gone it is told already.
        out = [one for one in out if one.worker_id not in self._gone]
        if out:
            told = ", ".join(f"{plain(one.worker_id)} is {one.state}" for one in out)
            found.append(Alert("worker", f"worker: {told}"))
        if self._event is not None and now_s - self._event[0] <= EVENT_SHOWN_S:
            found.append(Alert("event", plain(self._event[1].text)))
        return sorted(found, key=lambda one: _ORDER.index(one.kind))

    def _telemetry(self, now_s: float) -> list[Alert]:
        age_s = now_s - self._heard_s
        if age_s > STALE_S:
            what = "no telemetry yet" if self._state is None else "telemetry stale"
            return [Alert("telemetry", f"{what}: {age_s:.0f} s")]
        if self._state is not None and self._state.stale:
            channels = ", ".join(plain(one) for one in self._state.stale)
            return [Alert("telemetry", f"telemetry overdue: {channels}")]
        return []

    def _rounds(self, now_s: float) -> list[Alert]:
        if sum(self._late) >= LATE_ROUNDS and self._late[-1]:
            return [Alert("rounds", f"rounds late: the last took {self._latency_ms:.0f} ms")]
        progress = self._progress
        if progress is None or progress.junction_id is None or self._round_s is None:
            return []
        age_s = now_s - self._round_s
        if progress.mission_state == "following" and age_s > NO_ROUND_S:
            return [Alert("rounds", f"no futures for {age_s:.0f} s")]
        return []


def _gap(alarm: GapAlarm) -> str:
    name, _, unit = alarm.quantity.rpartition("_")
    unit = {"mps": "m/s"}.get(unit, unit)
    return f"{name} {abs(alarm.value):.2g} of {alarm.limit:.2g} {unit}, {alarm.manoeuvre}"
