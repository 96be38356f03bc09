"""Human and ADS side by side during a drive: what is said, published and kept of it."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import msgspec

from foretwin.contracts.drive import PlannedTrajectory, VehicleState, VehicleStatus
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.running import MOST_LISTED, FirstOf
from foretwin.contracts.side_by_side import Disagreement, DisagreementKind, DrivenSegment
from foretwin.orchestrator.context import DriveContext
from foretwin.orchestrator.drive.intake import Intake
from foretwin.orchestrator.drive.mission import Mission
from foretwin.orchestrator.instructions import Notice
from foretwin.sim_worker.analysis.side_by_side.segment import DrivePlace
from foretwin.sim_worker.analysis.side_by_side.watch import SegmentsStanding, SideBySide

WORDS: dict[DisagreementKind, str] = {
    "ads_turns_elsewhere": "the ADS would have turned elsewhere",
    "ads_in_another_lane": "the ADS would have taken another lane",
    "ads_beside": "the ADS would have kept beside the driven line",
    "ads_stops": "the ADS would have stopped, the human went on",
    "human_stops": "the human stopped, the ADS would have gone on",
    "ads_faster": "the ADS would have been faster",
    "ads_slower": "the ADS would have been slower",
}


class BesideStanding(NamedTuple):
    """What a drive has found so far, for one that goes on with it."""

    segments: SegmentsStanding
    found: FirstOf[Disagreement]
    ended: FirstOf[DrivenSegment]


class SideBySideHandler:
    """Feeds the comparison with what came in, and hands on what it finds."""

    def __init__(self, context: DriveContext, intake: Intake, mission: Mission) -> None:
        self._context, self._intake, self._mission = context, intake, mission
        plan = context.plan
        self._watch = SideBySide(
            plan.drive_frame, vehicle_id=plan.config.vehicle_id, place=self._place
        )
        self._plan: PlannedTrajectory | None = None
        self._status: VehicleStatus | None = None
        self._found: FirstOf[Disagreement] = FirstOf(MOST_LISTED)
        self._ended: FirstOf[DrivenSegment] = FirstOf(MOST_LISTED)

    @property
    def standing(self) -> BesideStanding:
        """Where the comparison stands."""
        return BesideStanding(self._watch.standing, self._found, self._ended)

    def go_on(self, standing: BesideStanding) -> None:
        """Begin where another one stood."""
        self._watch.go_on(standing.segments)
        self._found, self._ended = standing.found, standing.ended

    def take(self, state: VehicleState | None) -> None:
        """Take what the intake newly holds, and the state where there is a new one."""
        status, plan = self._intake.status, self._intake.plan
        if status is not None and status is not self._status:
            self._status = status
            self._watch.take_status(status)
        if plan is not None and plan is not self._plan:
            self._plan = plan
            self._watch.take_plan(plan)
        if state is not None:
            self._keep(self._watch.take_state(state))

    def finish(self) -> None:
        """End what lasts at the drive's end."""
        self._keep(self._watch.finish())

    def record(self) -> dict[str, Any] | None:
        """Return the `side_by_side` part of run.json, None where the car sent no plans."""
        segments = [*self._ended, *self._watch.open_segments]
        if not any(segment.plans or segment.too_short for segment in segments):
            return None
        return {
            "segments": [msgspec.to_builtins(segment) for segment in segments],
            "disagreements": [
                {"drive_time_s": self._drive_s(one.stamp_ns), **disagreement_row(one)}
                for one in self._found
            ],
        }

    @property
    def left_out(self) -> dict[str, int]:
        """How many are in the tables and not in the record."""
        return {"segments": self._ended.left_out, "disagreements": self._found.left_out}

    def _place(self) -> DrivePlace:
        latest = self._intake.latest
        position = GeoPoint(math.nan, math.nan) if latest is None else latest.state.position
        return DrivePlace(position, self._mission.junction_id, self._mission.route_m)

    def _drive_s(self, stamp_ns: int) -> float:
        return round((stamp_ns - self._intake.start_stamp_ns) / 1e9, 2)

    def _keep(self, found: list[Disagreement]) -> None:
        for one in found:
            self._context.publish("disagreement", one)
            if not one.over:
                name = one.junction_id and self._mission.visits.name_of(one.junction_id)
                self._context.tell(Notice("warning", disagreement_text(one, name)))
                continue
            self._found.append(one)
            self._context.tables.add("disagreements", [disagreement_row(one)])
        if ended := self._watch.take_ended():
            self._ended.extend(ended)
            self._context.tables.add("driven_segments", [msgspec.to_builtins(s) for s in ended])


def disagreement_text(one: Disagreement, junction: str | None) -> str:
    """Return a disagreement in one line, with its place, at or before a junction of that name."""
    where = f"{one.position.lat_deg:.6f}, {one.position.lon_deg:.6f}"
    if junction is not None:
        where += f", at or before {junction}"
    if one.route_m is not None:
        where += f", {one.route_m:.0f} m along the route"
    apart = (
        f"{abs(one.lateral_m):.1f} m to the {'left' if one.lateral_m > 0.0 else 'right'}"
        if one.aspect == "way" and one.lateral_m is not None
        else f"{one.speed_mps:+z.1f} m/s, {one.along_m:+z.1f} m"
    )
    return f"{WORDS[one.kind]} ({apart}) from {where}"


def disagreement_row(one: Disagreement) -> dict[str, Any]:
    """Return a disagreement as its table has it."""
    row: dict[str, Any] = msgspec.to_builtins(one)
    position = one.position
    del row["position"], row["over"]
    place = {"lat_deg": position.lat_deg, "lon_deg": position.lon_deg}
    return row | place | {"duration_s": (one.end_stamp_ns - one.stamp_ns) / 1e9}
