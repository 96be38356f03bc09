"""Simulation against reality as rows of a table and as lines for the engineer."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

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


def agreement_lines(found: dict[str, Any] | None) -> list[str]:
    """Return what is said of simulation against reality."""
    if found is None:
        return []
    counts = found["overall"]
    lines = [
        f"  simulation against reality in {found['windows']} windows: agree on pass "
        f"{counts['agree_pass']}, on fail {counts['agree_fail']}; simulation too pessimistic "
        f"{counts['too_pessimistic']}, too optimistic {counts['too_optimistic']}; not observable "
        f"{counts['not_observable']}"
    ]
    for direction, flip in found["flips"].items():
        if flip["flipped"]:
            fails = " and ".join(flip["smallest_factor_fails"]) or "nothing"
            lines.append(
                f"  a gap {direction} flips {flip['flipped']}: the least at "
                f"{flip['smallest_factor']:g} times the measured one "
                f"({flip['smallest_factor_gap_m']:.2f} m at {flip['smallest_factor_at_s']:.1f} s, "
                f"{fails} fails then), half below {flip['median_gap_m']:.2f} m"
            )
    return lines


def _names(flags: npt.NDArray[np.bool_]) -> str:
    return " ".join(name for name, flag in zip(CRITERIA, flags, strict=True) if flag)
