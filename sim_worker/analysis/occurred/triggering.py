"""What the drive itself shows of conditions that can trigger a failure of perception or position.

ISO 21448 calls them triggering conditions. Only those that are to be seen in a recording are here;
that none is found says nothing of the others.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np

from foretwin.contracts.arrays import Stamps
from foretwin.contracts.drive import VehicleState
from foretwin.sim_worker.analysis.occurred.scene import STEP_S, DrivenMotion

POOR_POSITION_M = 1.0
"""Chosen: a lane is left unnoticed where positions are this uncertain (standard deviation)."""
_LEAST_NS = 500_000_000
LOST_S = 1.0
"""Chosen: so long without a message of detections, where they came before and after."""


class TriggeringCondition(msgspec.Struct, frozen=True, kw_only=True):
    """A stretch of the drive with one condition: poor_position, stale_telemetry, no_state or
    lost_detections."""

    kind: str
    begin_ns: int
    end_ns: int
    detail: str = ""


def triggering_conditions(
    states: Sequence[VehicleState], ego: DrivenMotion, told_ns: Stamps
) -> tuple[TriggeringCondition, ...]:
    """Return what states in the order of their stamps, and stamps at which the car told of road
    users, show by themselves."""
    found = [
        *_stretches(
            "poor_position",
            states,
            [
                f"position uncertain by {POOR_POSITION_M:g} m and more"
                if s.position_std_m is not None and s.position_std_m >= POOR_POSITION_M
                else ""
                for s in states
            ],
        ),
        *_stretches("stale_telemetry", states, [", ".join(sorted(s.stale)) for s in states]),
    ]
    gone = np.isnan(ego.xy_m[:, 0])
    edges = np.flatnonzero(np.diff(np.concatenate([[False], gone, [False]]).astype(np.int8)))
    for first, after in edges.reshape(-1, 2).tolist():
        begin, end = int(ego.stamp_ns[first]), int(ego.stamp_ns[after - 1])
        seconds = (after - first) * STEP_S
        found.append(
            TriggeringCondition(
                kind="no_state", begin_ns=begin, end_ns=end, detail=f"nothing for {seconds:.1f} s"
            )
        )
    passed = np.diff(told_ns)
    for row in np.flatnonzero(passed > round(LOST_S * 1e9)).tolist():
        detail = f"no detections told for {passed[row] * 1e-9:.1f} s"
        found.append(
            TriggeringCondition(
                kind="lost_detections",
                begin_ns=int(told_ns[row]),
                end_ns=int(told_ns[row + 1]),
                detail=detail,
            )
        )
    return tuple(sorted(found, key=lambda one: (one.begin_ns, one.kind)))


def _stretches(
    kind: str, states: Sequence[VehicleState], said: Sequence[str]
) -> list[TriggeringCondition]:
    """Return stretches in which the same is said, none that is only a moment."""
    found: list[TriggeringCondition] = []
    begin = 0
    for row in range(1, len(states) + 1):
        if row < len(states) and said[row] == said[begin]:
            continue
        last = states[row - 1].stamp_ns
        if said[begin] and last - states[begin].stamp_ns >= _LEAST_NS:
            found.append(
                TriggeringCondition(
                    kind=kind, begin_ns=states[begin].stamp_ns, end_ns=last, detail=said[begin]
                )
            )
        begin = row
    return found
