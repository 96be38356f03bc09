"""The orchestrator's side of tuning: findings in, parameters out to all that simulate."""

from __future__ import annotations

from collections.abc import Collection

from foretwin.contracts.bus import Received, Reply
from foretwin.contracts.tuning import Identification, TuneReply, TuneRequest, UseVehicle
from foretwin.orchestrator.context import DriveContext
from foretwin.orchestrator.drive.intake import Intake
from foretwin.orchestrator.drive.processes import MIRROR, TUNING
from foretwin.orchestrator.instructions import Notice
from foretwin.orchestrator.rounds.runner import RoundRunner
from foretwin.orchestrator.rounds.siblings import SIBLING
from foretwin.orchestrator.tuning.findings import Findings
from foretwin.orchestrator.tuning.parameter_versions import (
    ParameterVersions,
    change_row,
    change_text,
)

FINDINGS = ("identification", "gap", "gap_alarm", "verdict")
"""Channels of the process `tuning`; in lock step its answers bring the same, in order."""
USE_TIMEOUT_S = 30.0
TUNE_TIMEOUT_S = 120.0


class TuningLink:
    """Carries findings to their desks and parameters to workers, mirror and tuning."""

    def __init__(
        self, context: DriveContext, *, intake: Intake, rounds: RoundRunner, alive: Collection[str]
    ) -> None:
        plan = context.plan
        self._context, self._config = context, plan.config
        self._intake, self._rounds, self._alive = intake, rounds, alive
        self.parameters = ParameterVersions(
            plan.vehicle, vehicle_id=plan.config.vehicle_id, ask=self._ask
        )
        self.findings = Findings(
            context.tables,
            tell=context.tell,
            start_stamp_ns=lambda: intake.start_stamp_ns,
            vehicle=lambda: self.parameters.in_force.vehicle,
            on_identification=self._identified,
        )
        self.weighing = False
        """Lock step: whether the process is at the samples of the step before."""
        self._weighed: TuneReply | None = None

    def join(self) -> None:
        """Hear what the process finds."""
        if not self._config.lock_step:
            self._context.subscribe(*FINDINGS)

    def heard(self, item: Received) -> None:
        """Take one finding as it comes."""
        self.findings.take(item.message())

    def reply(self, item: Reply) -> str:
        """Take an answer; returns the id of a process that has just got its parameters, or ""."""
        if item.channel == "tune":
            self.weighing = False
            self._weighed = item.message
            if item.message is None and TUNING in self._alive:
                self._context.tell(Notice("error", f"{TUNING}: {item.error}"))
            return ""
        process_id: str = item.tag
        if item.message is None and process_id in self._alive:
            text = f"{process_id} did not take the vehicle's parameters: {item.error}"
            self._context.tell(Notice("error", text))
        self.parameters.answered(process_id)
        return process_id

    def hand_over(self) -> None:
        """Let what was identified or set count from the next state on; between rounds alone."""
        if not self.parameters.waiting:
            return
        simulating = [name for name in sorted(self._alive) if self._simulates(name)]
        changes = self.parameters.hand_over(
            simulating, watcher=TUNING, stamp_ns=self._intake.next_stamp_ns
        )
        self._expect_no_watcher()
        if not changes:
            return
        version, vehicle = self.parameters.version, self.parameters.in_force.vehicle
        self._rounds.use_vehicle(vehicle, version)
        self._intake.use_vehicle(vehicle)
        for change in changes:
            self._context.tell(Notice("info", f"parameters {version}: {change_text(change)}"))
            self._context.publish("parameter", change)
        self._context.tables.add(
            "parameters", [change_row(one, version=version) for one in changes]
        )

    def process_up(self, process_id: str) -> bool:
        """Tell a process what counts; returns whether its answer must be waited for."""
        awaited = self._simulates(process_id) and self.parameters.tell(process_id)
        self._expect_no_watcher()
        return awaited

    def _expect_no_watcher(self) -> None:
        """Live, let no round wait for who only watches or gives way: it may be seconds late."""
        if not self._config.lock_step:
            self.parameters.answered(TUNING)
            self.parameters.answered(SIBLING)

    def process_down(self, process_id: str) -> None:
        """Wait no more for a process that is gone."""
        self.parameters.answered(process_id)
        if process_id == TUNING:
            self.weighing = False

    def weigh(self, published: dict[str, int]) -> None:
        """Lock step: let the process weigh all samples published and states sent so far."""
        if TUNING not in self._alive:
            return
        self.weighing = True
        question = TuneRequest(published=published, states=self._intake.states)
        self._context.request(TUNING, "tune", question, timeout_s=TUNE_TIMEOUT_S, tag=None)

    def take_weighed(self) -> None:
        """Lock step: take what the last answer has brought."""
        weighed, self._weighed = self._weighed, None
        if weighed is not None:
            self.findings.take_all(weighed)

    def record(self) -> dict[str, object]:
        """Return the `tuning` of run.json."""
        return {
            "mode": self._config.tuning_choice.mode,
            "version": self.parameters.version,
            "changes": self.parameters.rows(),
            "pinned": sorted(self.parameters.in_force.pinned),
            **self.findings.record(),
        }

    def _identified(self, found: Identification) -> None:
        if self._config.tuning_choice.mode == "apply":
            self.parameters.apply(found)

    def _simulates(self, process_id: str) -> bool:
        return process_id in (MIRROR, TUNING, SIBLING) or process_id.startswith("w")

    def _ask(self, process_id: str, message: UseVehicle) -> None:
        self._context.request(
            process_id, "use_vehicle", message, timeout_s=USE_TIMEOUT_S, tag=process_id
        )
