"""`foretwin compare`: two real drives of one road: how far people differ where nothing is wrong."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import LocalFrame, geo_from_local, local_from_geo
from foretwin.contracts.new_folder import named_in_errors, new_files, trouble_with_folder
from foretwin.contracts.terminal import say
from foretwin.orchestrator.commands.compare_text import difference_lines
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.record.run_state import check_finished
from foretwin.sim_worker.analysis.two_drives.common_stretches import LEAST_M, common_ways
from foretwin.sim_worker.analysis.two_drives.differences import (
    QUANTILES,
    UNITS,
    AfterDifference,
    DriveDifference,
    Spread,
    StretchDifference,
    difference_of_drives,
)
from foretwin.sim_worker.analysis.two_drives.drive_line import DriveLine, drive_line
from foretwin.telemetry.estimator.estimator import StateEstimator
from foretwin.telemetry.logs.log import Log
from foretwin.telemetry.logs.opening import open_log

_MOVES_MPS, _ONE_PLACE_M = 1.0, 0.05
"""Two cars that move never are this near each other at one time. Chosen."""
_PLACE_M = 10.0
"""Between two places that JSON lists."""
_MOST_ASKED = 500
"""Places of a drive that are asked how near they come to the other."""


class ComparedDrives(NamedTuple):
    """Two recorded drives, the frame that they were compared in, and how they differ."""

    first: Path
    second: Path
    frame: LocalFrame
    difference: DriveDifference
    unplaced: tuple[Path, ...]
    """Drives that do not say where on the car their positions are of."""
    one_drive: bool = False
    """Whether both are recordings of one drive, which tells nothing of how far people differ."""


def compare_logs(
    first: Path,
    second: Path,
    *,
    declaration: Path | None = None,
    other_declaration: Path | None = None,
) -> ComparedDrives:
    """Compare two recorded drives, or one with itself where it came again.

    Raises UserError where one has no way with a known heading, and where they have none in common.
    """
    same = first.resolve() == second.resolve()
    states, placed = estimated_states(first, declaration)
    others, others_placed = (states, True) if same else estimated_states(second, other_declaration)
    frame = LocalFrame(states[0].position)
    a = _line(first, states, frame)
    b = a if same else _line(second, others, frame)
    found = difference_of_drives(a, b, same_drive=same)
    if found is None:
        raise UserError(_nothing_common(first, second, a, b, same=same))
    known = ((first, placed), (second, others_placed))
    unplaced = tuple(one for one, at in known if not at)
    one_drive = not same and _are_one_drive(states, others, frame)
    if one_drive:
        say(
            f"{first} and {second} are recordings of one drive, at one time at one place: "
            "they say nothing of how far people differ",
            error=True,
        )
    return ComparedDrives(first, second, frame, found, unplaced, one_drive)


def compare(
    first: Path,
    second: Path,
    *,
    out: Path | None,
    declaration: Path | None = None,
    other_declaration: Path | None = None,
) -> CommandResult:
    """Return how two recorded drives differ; with `out` also draw it there."""
    if out is not None and (trouble := trouble_with_folder(out)) is not None:
        raise UserError(f"--out {out}: {trouble}")
    for recording in (first, second):
        check_finished(recording if recording.is_dir() else recording.parent)
    found = compare_logs(
        first, second, declaration=declaration, other_declaration=other_declaration
    )
    drawn: Path | None = None
    if out is not None:
        from foretwin.orchestrator.commands.compare_plot import write_plot

        with named_in_errors(f"--out {out}"), new_files(out):
            drawn = write_plot(found.difference, out)
    lines = [*difference_lines(found.difference, str(first), str(second))]
    if found.unplaced and first.resolve() != second.resolve():
        unsaid = "where on the car positions are of is not said, which adds up to a metre"
        lines.append(f"to the left: {unsaid}")
    if drawn is not None:
        lines.append(f"wrote {drawn}")
    return CommandResult(as_object(found), "\n".join(lines))


def as_object(found: ComparedDrives) -> dict[str, Any]:
    """Return a comparison as JSON has it; what cannot be told is null."""
    one = found.difference
    return {
        "first": {"log": str(found.first), "length_m": one.a_m, "common_m": one.common_a_m},
        "second": {"log": str(found.second), "length_m": one.b_m, "common_m": one.common_b_m},
        "position_std_m": list(one.std_m),
        "unplaced": [str(path) for path in found.unplaced],
        "one_drive": found.one_drive,
        "opposite_m": one.opposite_m,
        "differences": {name: _spread(spread) for name, spread in one.spreads.items()},
        "after": [_after(row) for row in one.after],
        "stretches": [_stretch(stretch, found.frame) for stretch in one.stretches],
    }


def scale_object(found: ComparedDrives) -> dict[str, Any]:
    """Return what a gap is measured against: the other drive, and how far both are apart."""
    return {
        "log": str(found.second),
        "common_m": found.difference.common_a_m,
        "after": [_after(row) for row in found.difference.after],
    }


def estimated_states(recording: Path, declaration: Path | None) -> tuple[list[VehicleState], bool]:
    """Return a drive's estimated states, and whether it says where its positions are of."""
    log: Log = open_log(recording, declaration=declaration)
    estimator = StateEstimator(log.info)
    found = (estimator.handle(channel, message) for channel, message in log.samples())
    states = [state for state in found if state is not None]
    if not states:
        raise UserError(f"{recording}: no position in the drive, so there is no way to compare")
    return states, log.info.body_from_antenna_m is not None


def _are_one_drive(
    states: Sequence[VehicleState], others: Sequence[VehicleState], frame: LocalFrame
) -> bool:
    """Whether both were at the same places at the same time while they moved."""
    stamps_ns, other_ns = (np.array([s.stamp_ns for s in some]) for some in (states, others))
    at_once = (other_ns >= stamps_ns[0]) & (other_ns <= stamps_ns[-1])
    at_once &= np.array([s.speed_mps for s in others]) > _MOVES_MPS
    if not at_once.any():
        return False
    here, there = (
        local_from_geo(
            frame,
            np.array([s.position.lat_deg for s in some]),
            np.array([s.position.lon_deg for s in some]),
        )
        for some in (states, others)
    )
    when_s, now_s = ((ns - stamps_ns[0]) * 1e-9 for ns in (stamps_ns, other_ns[at_once]))
    beside = np.column_stack([np.interp(now_s, when_s, axis) for axis in here.T])
    return bool(np.median(np.hypot(*(beside - there[at_once]).T)) < _ONE_PLACE_M)


def _line(recording: Path, states: list[VehicleState], frame: LocalFrame) -> DriveLine:
    line = drive_line(states, frame)
    if line is None:
        raise UserError(f"{recording}: the car does not move with a known heading")
    return line


def _nothing_common(first: Path, second: Path, a: DriveLine, b: DriveLine, *, same: bool) -> str:
    if same:
        return f"{first}: drives no {LEAST_M:g} m of its way a second time"
    both = f"{first} and {second} have no {LEAST_M:g} m of road in common"
    if common_ways(a, b).opposite_b.any():
        return f"{both}, but one was driven the other way round"
    some = b.xy_m[:: max(len(b.xy_m) // _MOST_ASKED, 1)]
    apart_m = min(float(np.hypot(*(a.xy_m - point).T).min()) for point in some)
    return f"{both}: they come within {apart_m:.0f} m of each other"


def _spread(one: Spread) -> dict[str, Any]:
    if not one.places:
        return {"places": 0}
    quantiles = {
        f"p{q * 100:.0f}": round(v, 3) for q, v in zip(QUANTILES, one.quantiles, strict=True)
    }
    told = {"rms": round(one.rms, 3), "size_p95": round(one.size_p95, 3)}
    return {"places": one.places, **quantiles, **told}


def _after(row: AfterDifference) -> dict[str, Any]:
    sides = {"along_m": row.along, "across_m": row.across, "speed_mps": row.speed}
    spreads = {name: _spread(one) for name, one in sides.items()}
    return {"horizon_s": row.horizon_s, "left_out": row.left_out, **spreads}


def _stretch(one: StretchDifference, frame: LocalFrame) -> dict[str, Any]:
    rows = np.unique(np.searchsorted(one.a_m, np.arange(one.a_m[0], one.a_m[-1], _PLACE_M)))
    lat_lon = geo_from_local(frame, one.xy_m[rows])
    columns = {"first_m": one.a_m, "second_m": one.b_m, "first_s": one.a_s, "second_s": one.b_s}
    columns |= {name: one.values[name] for name in UNITS}
    places = [
        {
            "lat_deg": round(float(lat), 7),
            "lon_deg": round(float(lon), 7),
            **{name: _number(values[row]) for name, values in columns.items()},
        }
        for row, (lat, lon) in zip(rows.tolist(), lat_lon[:, :2].tolist(), strict=True)
    ]
    return {
        "length_m": round(one.stretch.length_m, 1),
        "first_took_s": round(float(one.a_s[-1] - one.a_s[0]), 2),
        "second_took_s": round(float(one.b_s[-1] - one.b_s[0]), 2),
        "places": places,
    }


def _number(value: float) -> float | None:
    return round(float(value), 3) if np.isfinite(value) else None
