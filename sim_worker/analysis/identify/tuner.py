"""Identification while driving: samples in, parameters in force out; by hand, pinned, rolled back.

Pure: it knows no clock but the samples' stamps, so that the same samples give the same parameters.
"""

from __future__ import annotations

import math
from typing import Any

import msgspec

from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.tuning import (
    UNDERSTEER_GRADIENT,
    Identification,
    ParameterChange,
    ParameterOrigin,
)
from foretwin.contracts.vehicle import Parameter, VehicleParameters
from foretwin.geometry.slopes import Slopes
from foretwin.sim_worker.analysis.identify.acceptance import (
    STEERING,
    STIFFNESS,
    is_acceptable,
    std_of,
    with_priors,
)
from foretwin.sim_worker.analysis.identify.parameters_in_force import ParametersInForce
from foretwin.sim_worker.analysis.identify.steering_signals import Theta, steering_signals
from foretwin.sim_worker.analysis.identify.step import BendsBefore, Step, bends_before, find_step
from foretwin.sim_worker.analysis.identify.window import examine
from foretwin.sim_worker.analysis.motion_record import MotionRecorder

_PERIOD_S = 0.01
_WINDOW_NS, _EVERY_NS = 60_000_000_000, 10_000_000_000
_LEAST_S = 20.0
_STEP_STDS = 4.0
"""Between two intervals' middles, over their common standard deviation: chance is one in 16,000."""
_CHECK_NS, _LOOK_BACK_NS = 2_000_000_000, 30_000_000_000
"""How often, and how far back, bends are compared with those before."""


class Tuner(ParametersInForce):
    """Identifies every 10 s of drive time from the last 60, and holds what counts.

    `handle` takes samples in any order and returns an Identification when one is due; `take` makes
    its acceptable values count. A parameter that departs from what was identified before is a step,
    looked for in bends every 2 s: it is named in `step_noticed`, the driving before it is
    forgotten, and the new value counts as soon as the new driving alone tells it.
    """

    def __init__(
        self,
        *,
        vehicle: VehicleParameters,
        vehicle_id: str,
        frame: LocalFrame,
        roads: Slopes | None = None,
    ) -> None:
        """`roads` in `frame` tell grades where measured altitude does not."""
        self._roads = roads
        super().__init__(vehicle=vehicle, vehicle_id=vehicle_id)
        self._recorder = MotionRecorder(frame=frame, keep_s=_WINDOW_NS * 1e-9 + 5.0)
        self._from_ns: int | None = None
        self._due_ns = self._check_ns = self._begun_ns = 0
        self._doubted = False
        self._bends: BendsBefore | None = None
        self._known: BendsBefore | None = None

    def handle(self, channel: str, message: Any) -> Identification | None:
        """Take one sample; return what the window tells where one is due, else None."""
        self._recorder.handle(channel, message)
        newest_ns = self._recorder.newest_stamp_ns
        if newest_ns is None:
            return None
        if self._from_ns is None:
            self._from_ns = newest_ns
            self._due_ns = newest_ns + max(_EVERY_NS, round(_LEAST_S * 1e9))
        if newest_ns >= self._check_ns:
            self._check_ns = newest_ns + _CHECK_NS
            step = self._find_step(newest_ns)
            if step is not None and step.sure:
                return self._forgotten(step, newest_ns)
            # A bend that may be of another car must not be averaged with those before.
            self._doubted = step is not None
        if newest_ns < self._due_ns or self._doubted:
            return None
        self._due_ns = newest_ns + _EVERY_NS
        self._from_ns = max(self._from_ns, newest_ns - _WINDOW_NS)
        result = self._examined(newest_ns)
        noticed = self._steps(result)
        if not noticed:
            return result
        # What came before the step is of another car.
        return self._anew(result, noticed, since_ns=newest_ns - _EVERY_NS)

    def _examined(self, newest_ns: int) -> Identification:
        record = self._recorder.record(self._from_ns, newest_ns, period_s=_PERIOD_S)
        result, steering = examine(
            record, self._given, vehicle_id=self._vehicle_id, roads=self._roads
        )
        self._bends = None if steering is None else bends_before(steering)
        return with_priors(result, self.vehicle)

    def _find_step(self, newest_ns: int) -> Step | None:
        if self._known is None or self._from_ns is None:
            return None
        self._begun_ns = max(self._from_ns, newest_ns - _LOOK_BACK_NS)
        record = self._recorder.record(self._begun_ns, newest_ns, period_s=_PERIOD_S)
        if len(record.stamp_ns) < 2:
            return None
        try:
            return find_step(steering_signals(record, self._given), self._known)
        except ValueError:
            return None

    def _forgotten(self, step: Step, newest_ns: int) -> Identification:
        """Return what the driving after a step tells, and go on with that alone."""
        self._from_ns = min(self._begun_ns + round(step.after_s * 1e9), newest_ns - round(1.1e9))
        return self._anew(self._examined(newest_ns), _in_words(step), since_ns=self._from_ns)

    def _anew(
        self, result: Identification, noticed: dict[str, str], *, since_ns: int
    ) -> Identification:
        self._from_ns = since_ns
        self._due_ns = since_ns + round(_LEAST_S * 1e9)
        names = set(noticed)
        if names & set(STEERING):
            # One of them cannot be told without the others.
            names |= set(STEERING)
            self._known, self._doubted = None, False
        for name in names:
            self._taken.pop(name, None)
        return msgspec.structs.replace(
            result,
            estimates=tuple(
                msgspec.structs.replace(found, reason="it has just changed: more driving is needed")
                if found.name in names
                else found
                for found in result.estimates
            ),
            step_noticed="; ".join(noticed.values()),
        )

    def _steps(self, result: Identification) -> dict[str, str]:
        noticed = {}
        for found in result.estimates:
            before = self._taken.get(found.name)
            if before is None or not is_acceptable(found) or self._is_pinned(found.name):
                continue
            assert found.value is not None
            assert before.value is not None
            apart = abs(found.value - before.value)
            if apart > _STEP_STDS * math.hypot(std_of(found), std_of(before)):
                noticed[found.name] = (
                    f"{found.name} went from {before.value:.4g} to {found.value:.4g} or beyond"
                )
        return noticed

    def take(self, result: Identification) -> tuple[ParameterChange, ...]:
        """Let what `result` says count; later bends are compared with those that it is of."""
        changes = super().take(result)
        bends, known = self._bends, self._known
        steered = any(change.name in STEERING or change.name == STIFFNESS for change in changes)
        if steered and bends is not None and (known is None or not bends.knows_less(known)):
            self._known = bends
        return changes

    def _replace(
        self, name: str, parameter: Parameter, origin: ParameterOrigin, stamp_ns: int
    ) -> ParameterChange:
        change = super()._replace(name, parameter, origin, stamp_ns)
        # Bends were told by a car of other given parameters.
        self._known = None
        return change


_NAMES = {
    Theta.INVERSE_RATIO: "steering_ratio",
    Theta.OFFSET: "steering_offset_rad",
    Theta.UNDERSTEER: UNDERSTEER_GRADIENT,
}


def _in_words(step: Step) -> dict[str, str]:
    """Return by name what a step changed, in words."""
    before, after = step.before, step.after
    if step.parameter not in _NAMES:
        return {
            UNDERSTEER_GRADIENT: "the tyres' stiffness: the tyre angle that turning needs went "
            f"from {before:.4g} to about {after:.4g} rad per rad/s²"
        }
    if step.parameter == Theta.INVERSE_RATIO:
        before, after = 1 / before, 1 / after
    name = _NAMES[step.parameter]
    return {name: f"{name} went from {before:.4g} to about {after:.4g}"}
