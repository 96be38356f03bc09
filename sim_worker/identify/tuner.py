"""Identification while driving: samples in, parameters in force out; by hand, pinned, rolled back.

Pure: it knows no clock but the samples' stamps, so that the same samples give the same parameters.
"""

from __future__ import annotations

import math
from typing import Any

import msgspec

from contracts.drive import GnssFix
from contracts.frames import LocalFrame
from contracts.tuning import Identification
from contracts.vehicle import VehicleParameters
from sim_worker.identify.acceptance import in_force, is_acceptable
from sim_worker.identify.parameters_in_force import ParametersInForce, std_of
from sim_worker.identify.window import identify
from sim_worker.motion_record import MotionRecorder

_PERIOD_S = 0.01
_LEAST_S = 20.0
_STEP_STDS = 4.0
"""Between two intervals' middles, over their common standard deviation: chance is one in 16,000."""


class Tuner(ParametersInForce):
    """Identifies every `every_s` of drive time from the last `window_s`, and holds what counts.

    `handle` takes samples in any order and returns an Identification when one is due; `take` makes
    its acceptable values count. A parameter that departs from what was identified before is a step:
    it is named in `step_noticed`, the driving before it is forgotten, and the new value counts as
    soon as the new driving alone tells it.
    """

    def __init__(
        self,
        *,
        vehicle: VehicleParameters,
        vehicle_id: str,
        frame: LocalFrame | None = None,
        window_s: float = 60.0,
        every_s: float = 10.0,
    ) -> None:
        """Without a `frame`, samples count from the first position on, around which it is laid."""
        super().__init__(vehicle=vehicle, vehicle_id=vehicle_id)
        self._window_ns, self._every_ns = round(window_s * 1e9), round(every_s * 1e9)
        self._recorder: MotionRecorder | None = None
        if frame is not None:
            self._recorder = self._new_recorder(frame)
        self._from_ns: int | None = None
        self._due_ns = 0

    def _new_recorder(self, frame: LocalFrame) -> MotionRecorder:
        return MotionRecorder(frame=frame, keep_s=self._window_ns * 1e-9 + 5.0)

    def handle(self, channel: str, message: Any) -> Identification | None:
        """Take one sample; return what the window tells where one is due, else None."""
        if self._recorder is None:
            if not isinstance(message, GnssFix):
                return None
            self._recorder = self._new_recorder(LocalFrame(message.position))
        self._recorder.handle(channel, message)
        newest_ns = self._recorder.newest_stamp_ns
        if newest_ns is None:
            return None
        if self._from_ns is None:
            self._from_ns = newest_ns
            self._due_ns = newest_ns + max(self._every_ns, round(_LEAST_S * 1e9))
        if newest_ns < self._due_ns:
            return None
        self._due_ns = newest_ns + self._every_ns
        self._from_ns = max(self._from_ns, newest_ns - self._window_ns)
        record = self._recorder.record(self._from_ns, newest_ns, period_s=_PERIOD_S)
        told = identify(record, self._given, vehicle_id=self._vehicle_id)
        told = msgspec.structs.replace(
            told,
            estimates=tuple(
                msgspec.structs.replace(found, prior=in_force(self.vehicle, found.name))
                for found in told.estimates
            ),
        )
        noticed = self._steps(told)
        if not noticed:
            return told
        # What came before the step is of another car.
        self._from_ns = newest_ns - self._every_ns
        self._due_ns = self._from_ns + round(_LEAST_S * 1e9)
        for name in noticed:
            self._taken.pop(name)
        return msgspec.structs.replace(
            told,
            estimates=tuple(
                msgspec.structs.replace(found, reason="it has just changed: more driving is needed")
                if found.name in noticed
                else found
                for found in told.estimates
            ),
            step_noticed="; ".join(noticed.values()),
        )

    def _steps(self, told: Identification) -> dict[str, str]:
        noticed = {}
        for found in told.estimates:
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
