"""Which of the two is wrong: the pairs of signals judged stretch by stretch, until one is sure."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np

from foretwin.contracts.drive import GnssFix, VehicleInfo
from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.gap import Verdict
from foretwin.contracts.simulation import HORIZONS_S
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.slopes import Slopes
from foretwin.sim_worker.analysis.gap.acceleration_consistency import PushTest
from foretwin.sim_worker.analysis.gap.consistency import Consistency, began_ns, consistency_of
from foretwin.sim_worker.analysis.gap.findings import (
    Finding,
    confirmed,
    findings_of,
    speed_sensor,
)
from foretwin.sim_worker.analysis.gap.free_run import FreeRunner, RunMemory
from foretwin.sim_worker.analysis.gap.pairs import SignalPairs, pairs_of
from foretwin.sim_worker.analysis.gap.sensors_by_positions import are_precise
from foretwin.sim_worker.analysis.motion_record import MotionRecord, MotionRecorder

WINDOW_S, RECENT_S, EVERY_S = 6.0, 3.0, 0.2
KEPT_S = HORIZONS_S[-1] + 2.0
"""Of samples: enough for the longest run of the gap and what the steering was told before it."""
_EVERY_NS = round(EVERY_S * 1e9)
_LATEST_S = 0.1
"""Samples of slower channels may still be on their way."""
_AT_ONCE = 4
"""So many runs are new in each stretch."""
_IN_A_ROW = 2
_SPEED_NOISE_MPS = 0.4
"""Such positions tell speeds over 0.6 s to 0.35 m/s: what is farther off is not the same speed."""
_AGREES_AGAIN = 30
"""Stretches in a row, 6 s, after which a speed that was wrong counts again: one that is stuck is
right whenever the car happens to drive as fast. Chosen."""
_FORGOTTEN_S = 10.0
"""A finding that has not come back for so long is over, and a new one is reported anew."""


class FaultDetector:
    """Takes a vehicle's samples and says, where it is sure, which departs: the car or its model.

    Pure: time is that of the samples. A verdict takes two findings in a row, 0.2 s apart, that
    accuse the same, and is given once as long as it holds.
    """

    def __init__(
        self,
        info: VehicleInfo,
        vehicle: VehicleParameters,
        *,
        frame: LocalFrame,
        roads: Slopes | None = None,
    ) -> None:
        """`roads` in `frame` are those of the map, where it is known not to be flat."""
        self._roads = roads
        lever = info.body_from_antenna_m
        self._vehicle_id = info.vehicle_id
        self._ahead_m = 0.0 if lever is None else lever[0]
        self.recorder = MotionRecorder(frame=frame, keep_s=KEPT_S, depth=4000)
        """The samples that are kept."""
        self._runner = FreeRunner(vehicle, batch=_AT_ONCE, roads=self._roads)
        self._runs = RunMemory()
        self._first_ns: int | None = None
        self._done = 0
        self._push = PushTest()
        self._speed_agrees: bool | None = None
        """Whether the measured speed is that of the positions, as last known; None before."""
        self._agreed = 0
        """In so many stretches in a row."""
        self._pending: tuple[str, str, int, int] | None = None
        self._fixes: deque[GnssFix] = deque(maxlen=40)
        self._reported: dict[tuple[str, str], int] = {}
        self.undecided: str = ""
        """What departs without saying whether it is the car or the model, empty where nothing."""
        self.latest: Consistency | None = None
        """The consistency of the latest stretch, for display."""

    def use_vehicle(self, vehicle: VehicleParameters) -> None:
        """Judge a model of other parameters from now on; what was about to be said is forgotten."""
        self._runner = FreeRunner(vehicle, batch=_AT_ONCE, roads=self._roads)
        self._runs = RunMemory()
        self._push = PushTest()
        self._pending = None

    def handle(self, channel: str, message: Any) -> Verdict | None:
        """Take one sample; return a verdict where one is due."""
        stamp_ns = getattr(message, "stamp_ns", None)
        if stamp_ns is None:
            return None
        newest = self.recorder.newest_stamp_ns
        if newest is not None and stamp_ns < newest - 2_000_000_000:
            return None  # the clock ran back: what is kept would no longer be one motion
        if isinstance(message, GnssFix):
            if self._fixes and message.position == self._fixes[-1].position:
                return None  # said again: whatever the stamp, it is of before
            self._fixes.append(message)
        self.recorder.handle(channel, message)
        newest = self.recorder.newest_stamp_ns
        if newest is None:
            return None
        self._first_ns = newest if self._first_ns is None else self._first_ns
        due = (newest - round(_LATEST_S * 1e9) - self._first_ns) // _EVERY_NS
        if due <= self._done:
            return None
        self._done = due
        to_ns = self._first_ns + due * _EVERY_NS
        from_ns = max(self._first_ns, to_ns - round(WINDOW_S * 1e9))
        if to_ns - from_ns < 1.5e9:
            return None
        record = without_manual_commands(self.recorder.record(from_ns, to_ns))
        precise = are_precise(self._fixes)
        pairs = pairs_of(
            record,
            self._runner,
            antenna_ahead_m=self._ahead_m,
            precise_positions=precise,
            memory=self._runs,
        )
        self.latest = consistency_of(pairs)
        self._hold_speed_against_positions(self.latest)
        pushed = self._push.handle(pairs.pushes)
        if self._speed_agrees is False or (precise and self._speed_agrees is None):
            pushed = ()  # all accelerations are those of the measured speed
        found = _found_in(pairs, self.latest)
        if found is None:
            # A departure that has just begun is a small part of the whole stretch.
            recent = pairs.latest(RECENT_S)
            if not recent.broken:
                found = _found_in(recent, consistency_of(recent))
        if self._speed_agrees is False and found is not None and found.cause != "speed_sensor":
            found = None
        return self._weigh(pushed if found is None else (found,), to_ns)

    def _hold_speed_against_positions(self, seen: Consistency) -> None:
        if seen.speed_by_gnss is None:
            return
        if speed_sensor(seen.speed_by_gnss) is not None:
            self._speed_agrees, self._agreed = False, 0
        elif confirmed(seen.speed_by_gnss) and seen.speed_by_gnss.residual < _SPEED_NOISE_MPS:
            self._agreed += 1
            if self._speed_agrees is None or self._agreed >= _AGREES_AGAIN:
                self._speed_agrees = True
        else:
            self._agreed = 0

    def _weigh(self, findings: Sequence[Finding], to_ns: int) -> Verdict | None:
        for key, seen_ns in list(self._reported.items()):
            if to_ns - seen_ns > _FORGOTTEN_S * 1e9:
                del self._reported[key]
        if not findings:
            self._pending = None
        by_key = {(str(one.culprit), one.cause): one for one in findings}
        self._reported |= {key: to_ns for key in by_key if key in self._reported}
        unreported = [key for key in by_key if key not in self._reported]
        if not unreported:
            return None
        key, found = unreported[0], by_key[unreported[0]]
        before = self._pending
        if before is None or before[0] != found.culprit:
            self._pending = (*key, 1, found.since_ns)
        else:
            self._pending = (*key, before[2] + 1, before[3])
        if self._pending[2] < _IN_A_ROW:
            return None
        since_ns = self._pending[3]
        self._reported[key] = to_ns
        if found.culprit == "undecided":
            self.undecided = found.text
            return None
        return Verdict(
            vehicle_id=self._vehicle_id,
            stamp_ns=to_ns,
            since_stamp_ns=since_ns,
            culprit=found.culprit,
            cause=found.cause,
            text=found.text,
            evidence=found.evidence,
            confidence=_confidence(found),
        )


def _found_in(pairs: SignalPairs, seen: Consistency) -> Finding | None:
    found = findings_of(seen)
    if found is None:
        return None
    return found._replace(since_ns=began_ns(pairs, seen, found.evidence[0].name))


def _confidence(found: Finding) -> float:
    """Return how sure it is that what accuses departs: its normal deviations, to 0.99."""
    one = found.deciding
    away = abs(one.value - one.expected) / max(one.std, 1e-6)
    return float(np.clip(math.erf(away / math.sqrt(8.0)), 0.5, 0.99))


def without_manual_commands(record: MotionRecord) -> MotionRecord:
    """Return the record without commands where a human drives: they are not carried out then."""
    if not record.manual.any():
        return record
    names = ("command_accel_mps2", "command_wheel_rad", "command_tire_rad")
    return record._replace(
        **{name: np.where(record.manual, np.nan, getattr(record, name)) for name in names}
    )
