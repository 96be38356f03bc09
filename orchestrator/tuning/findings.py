"""What the driving says of the vehicle: kept in tables, told in words, counted for the record."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import msgspec

from foretwin.contracts.gap import ALARM_HORIZON_S, GapAlarm, GapSample, Verdict
from foretwin.contracts.running import MOST_LISTED, FirstOf, RunningMeans
from foretwin.contracts.tuning import Identification, ParameterEstimate, TuneReply
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator.instructions import Notice
from foretwin.orchestrator.record.results import GAP, ResultTables
from foretwin.orchestrator.tuning.parameter_versions import departs
from foretwin.orchestrator.tuning.words import alarm_text, found_text, verdict_text
from foretwin.sim_worker.analysis.identify.acceptance import in_force, is_acceptable, is_left_open
from foretwin.sim_worker.futures.columns import row_of

_SQUARES = ("along_m", "across_m", "yaw_rad", "speed_mps")


class FindingsStanding(NamedTuple):
    """What the driving has said so far, for one that goes on with the drive."""

    latest: dict[str, ParameterEstimate]
    reported: dict[str, float]
    gaps: dict[str, RunningMeans]
    estimated: dict[str, RunningMeans]
    alarms: int
    beyond: int
    verdicts: FirstOf[Verdict]


@dataclass(slots=True)
class Findings:
    """Takes what the process `tuning` says, in the order in which it says it."""

    tables: ResultTables
    tell: Callable[[Notice], None]
    start_stamp_ns: Callable[[], int]
    vehicle: Callable[[], VehicleParameters]
    on_identification: Callable[[Identification], None]
    _latest: dict[str, ParameterEstimate] = field(default_factory=dict)
    _reported: dict[str, float] = field(default_factory=dict)
    _gaps: dict[str, RunningMeans] = field(default_factory=lambda: defaultdict(RunningMeans))
    _estimated: dict[str, RunningMeans] = field(default_factory=lambda: defaultdict(RunningMeans))
    """Those of runs by commands that were estimated from the motion, by manoeuvre too."""
    _alarms: int = 0
    _beyond: int = 0
    _verdicts: FirstOf[Verdict] = field(default_factory=lambda: FirstOf(MOST_LISTED))

    @property
    def standing(self) -> FindingsStanding:
        """What was said until now."""
        return FindingsStanding(
            latest=self._latest,
            reported=self._reported,
            gaps=dict(self._gaps),
            estimated=dict(self._estimated),
            alarms=self._alarms,
            beyond=self._beyond,
            verdicts=self._verdicts,
        )

    def go_on(self, standing: FindingsStanding) -> None:
        """Begin with what was said before."""
        self._latest, self._reported = standing.latest, standing.reported
        self._gaps.update(standing.gaps)
        self._estimated.update(standing.estimated)
        self._alarms, self._beyond = standing.alarms, standing.beyond
        self._verdicts = standing.verdicts

    def take(self, found: Identification | GapSample | GapAlarm | Verdict) -> None:
        """Keep and tell one finding."""
        match found:
            case Identification():
                self._identification(found)
            case GapSample():
                self.tables.add("gaps", [row_of(found, GAP)])
                # The horizon of the alarms is told; the tables hold all.
                if abs(found.horizon_s - ALARM_HORIZON_S) < 1e-9:
                    self._beyond += found.independent and found.beyond_limits
                    gaps = self._gaps if found.independent else self._estimated
                    gaps[found.manoeuvre].take(
                        tuple(getattr(found, name) ** 2 for name in _SQUARES)
                    )
            case GapAlarm():
                self._alarms += found.over
                self.tell(Notice("warning" if found.over else "info", alarm_text(found)))
            case Verdict():
                self._verdicts.append(found)
                row = row_of(found)
                row["evidence"] = "; ".join(
                    f"{one.name} {one.value:.4g} ± {one.std:.2g}, expected {one.expected:.4g}"
                    for one in found.evidence
                )
                self.tables.add("verdicts", [row])
                self.tell(Notice("warning", verdict_text(found)))

    def take_all(self, reply: TuneReply) -> None:
        """Keep and tell what one lock step has brought."""
        for kind in (reply.identifications, reply.gaps, reply.alarms, reply.verdicts):
            for found in kind:
                self.take(found)

    def _identification(self, told: Identification) -> None:
        span = row_of(told, "stamp_ns from_stamp_ns")
        rows = [span | row_of(found) | {"taken": is_acceptable(found)} for found in told.estimates]
        self.tables.add("identifications", rows)
        self._latest |= {found.name: found for found in told.estimates}
        if told.step_noticed:
            self.tell(Notice("warning", f"the vehicle has changed: {told.step_noticed}"))
        self.on_identification(told)
        for found in told.estimates:
            counts = in_force(self.vehicle(), found.name)
            if departs(found, counts) and self._reported.get(found.name) != counts:
                self._reported[found.name] = counts
                self.tell(Notice("info", found_text(found, counts)))

    def record(self) -> dict[str, Any]:
        """Return the `gap`, `verdicts` and `parameters` of run.json.

        Runs by estimated commands count where there are no others: where a command arrived late or
        was lost, they say nothing of the rest, and stand in `without_commands` alone.
        """
        without = sum(rows.count for rows in self._estimated.values())
        gaps = self._gaps or self._estimated
        return {
            "gap": {
                "horizon_s": ALARM_HORIZON_S,
                "independent": bool(self._gaps) or not without,
                "samples": sum(rows.count for rows in gaps.values()),
                "without_commands": without,
                "alarms": self._alarms,
                "beyond_limits": self._beyond,
                "rms": {
                    "all": _rms(sum(gaps.values(), RunningMeans())),
                    **{name: _rms(rows) for name, rows in sorted(gaps.items())},
                },
            },
            "verdicts": [
                {
                    "drive_time_s": round((one.stamp_ns - self.start_stamp_ns()) / 1e9, 2),
                    **{k: v for k, v in msgspec.to_builtins(one).items() if k != "vehicle_id"},
                }
                for one in self._verdicts
            ],
            "parameters": [self._parameter(one) for one in self._latest.values()],
        }

    @property
    def left_out(self) -> int:
        """How many verdicts are in the table and not in the record."""
        return self._verdicts.left_out

    def _parameter(self, one: ParameterEstimate) -> dict[str, Any]:
        vehicle = self.vehicle()
        in_use = in_force(vehicle, one.name)
        return {
            "name": one.name,
            "in_use": in_use,
            "identified": one.value,
            **row_of(one, "low high"),
            "departs": departs(one, in_use),
            "left_open": one.value is not None and is_left_open(vehicle, one.name, one.value),
            "reason": one.reason,
        }


def _rms(squares: RunningMeans) -> dict[str, float] | None:
    if not squares.count:
        return None
    named = zip(_SQUARES, squares.means, strict=True)
    return {name: round(math.sqrt(mean), 4) for name, mean in named}
