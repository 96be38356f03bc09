"""Simulation against reality as rows of a table and as lines for the engineer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from foretwin.orchestrator.record.whereabouts import instant
from foretwin.sim_worker.analysis.agreement.criteria import CRITERIA
from foretwin.sim_worker.analysis.agreement.tally import Judged


def judged_row(one: Judged, *, start_stamp_ns: int) -> dict[str, Any]:
    """Return the row of one judged window."""
    window, both = one.window, one.verdicts
    row: dict[str, Any] = {
        "round_id": window.round_id,
        "stamp_ns": window.stamp_ns,
        "drive_time_s": (window.stamp_ns - start_stamp_ns) / 1e9,
        "intersection_id": window.junction_id,
        "outcome": one.outcome,
        "simulated": both.simulated_word,
        "driven": both.driven_word,
        "observable": _names(both.observable),
        "simulated_fails": _names(both.simulated.fails),
        "driven_fails": _names(both.driven.fails),
        "not_observable": _names(both.asked & ~both.observable),
        "gap_along_m": one.gap_along_m,
        "gap_across_m": one.gap_across_m,
    }
    for flip in one.flips:
        row[f"flip_{flip.direction}_factor"] = flip.factor
        row[f"flip_{flip.direction}_m"] = flip.gap_m
        row[f"flip_{flip.direction}_fails"] = " ".join(flip.fails)
    return row


def agreement_lines(
    found: dict[str, Any] | None, intersections: Sequence[dict[str, Any]] = ()
) -> list[str]:
    """Return what is said of simulation against reality, with the places of run.json.

    Of the gaps that would turn a verdict the least is told; run.json has those of all directions.
    """
    if found is None:
        return []
    counts = found["overall"]
    alike = counts["agree_pass"] + counts["agree_fail"]
    judged = found["windows"] - counts["not_observable"]
    line = (
        f"  simulated and driven, {found['windows']} windows: {judged} can be judged, of which "
        f"{alike} agree ({counts['agree_pass']} pass, {counts['agree_fail']} fail)"
    )
    apart = [
        f"in {counts[key]} the simulation was too {key.removeprefix('too_')}"
        for key in ("too_pessimistic", "too_optimistic")
        if counts[key]
    ]
    turned = [(flip, name) for name, flip in found["flips"].items() if flip["flipped"]]
    lines = ["; ".join([line, *apart])]
    if turned:
        lines.append(
            _turned(*min(turned, key=lambda one: one[0]["smallest_factor"]), intersections)
        )
    return lines


_ALONG = {
    "along": "along the road",
    "across": "across the road",
    "both": "along and across together",
}


def _turned(flip: dict[str, Any], direction: str, intersections: Sequence[dict[str, Any]]) -> str:
    """Say how large a gap would have turned a verdict, where and when that was least."""
    fails, factor = " and ".join(flip["smallest_factor_fails"]), flip["smallest_factor"]
    becomes = f"a fail by {fails.replace('_', ' ')}" if fails else "a pass"
    when = instant(flip["smallest_factor_at_s"], intersections)
    gap_m, measured_m = flip["smallest_factor_gap_m"], flip["smallest_factor_measured_m"]
    where = _ALONG[direction]
    if factor < 1.0:  # the whole of it need not turn the verdict: the way between is another one
        return (
            f"  least room {when}: with {gap_m:.2f} of the {measured_m:.2f} m of gap that were "
            f"measured {where} the verdict would be {becomes}"
        )
    return (
        f"  least room {when}: with a gap of {gap_m:.2f} m {where} the verdict would "
        f"be {becomes}; {measured_m:.2f} m were measured"
    )


def _names(flags: npt.NDArray[np.bool_]) -> str:
    return " ".join(name for name, flag in zip(CRITERIA, flags, strict=True) if flag)
