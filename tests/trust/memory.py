"""What earlier drives of a road tell of how fast it will be driven.

    python -m tests.trust.memory

prints for each pair of an earlier and a later drive of the same roads how far the law of going on
is off along the way that was then driven, in metres over all instants up to 1, 2, 4 and 8 s: with
the earlier drive's speeds, and without. Rounds count in which the earlier drive has been anywhere
that the next 8 s lead to. No map is used: the limit is 50 km/h throughout.
"""

from __future__ import annotations

import sys
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import geo_from_local
from foretwin.contracts.futures import PATH_BEHIND_M, SPEED_AHEAD_STEP_S, PathAhead
from foretwin.contracts.tracks import DrivenTrack
from foretwin.orchestrator.forecast.examples import causal_states
from foretwin.orchestrator.routing.arrival import DrivingPace
from foretwin.orchestrator.routing.cruise import CruiseSpeed
from foretwin.orchestrator.routing.driven_speeds import DrivenSpeeds
from foretwin.orchestrator.routing.speed_ahead import speeds_ahead, way_speeds
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.trust.drives import RealDrive, all_drives
from tests.trust.truth import Truth, truth_of

UP_TO_S = (1.0, 2.0, 4.0, 8.0)
HORIZON_S = 8.0
EVERY_S = 1.0
LIMIT_MPS = 50.0 / 3.6
_FRESH_S = 2.0
"""The first moments of a drive, in which no acceleration is known."""
_LONGEST_GAP_S = 1.0
_STEPS = round(HORIZON_S / SPEED_AHEAD_STEP_S)


class Moment(NamedTuple):
    """What was known of the car's motion at one instant of the later drive."""

    stamp_ns: int
    speed_mps: float
    acceleration_mps2: float
    share: float


class Pair(NamedTuple):
    """Two drives of the same roads; the earlier one's first part where it is the same drive."""

    later: str
    earlier: str


PAIRS = (Pair("boreas", "boreas-september"), Pair("chemnitz", "chemnitz"))
"""The loop of Boreas in August, remembered from four weeks later; the second half of Chemnitz,
where it leads over roads of the first."""


def track_of(truth: Truth, until_ns: int) -> DrivenTrack:
    """Return where a drive went until an instant, about every metre."""
    track = truth.track
    way_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(track.xy_m, axis=0).T))])
    keep = np.unique(np.searchsorted(way_m, np.arange(0.0, way_m[-1], 1.0)))
    keep = keep[track.stamp_ns[keep] <= until_ns]
    lat, lon = geo_from_local(truth.frame, track.xy_m[keep]).T
    return DrivenTrack(
        id="0" * 12, name="earlier", added_utc="2030-01-01T00:00:00Z",
        stamp_ns=track.stamp_ns[keep], lat_deg=lat, lon_deg=lon, speed_mps=track.speed_mps[keep],
    )  # fmt: skip


def moments(drive: RealDrive, from_ns: int) -> list[Moment]:
    """Return moments of a drive from an instant on, as its estimator knew them then."""
    cruise, pace, found, due_ns = CruiseSpeed(), DrivingPace(), list[Moment](), 0
    for state in causal_states(drive.log(), load_vehicle()):
        cruise.update(state.stamp_ns, state.speed_mps)
        pace.update(state.stamp_ns, state.speed_mps, LIMIT_MPS)
        due_ns = due_ns or state.stamp_ns + round(_FRESH_S * 1e9)
        if state.stamp_ns >= max(due_ns, from_ns):
            due_ns = state.stamp_ns + round(EVERY_S * 1e9)
            accel = cruise.acceleration_mps2
            found.append(Moment(state.stamp_ns, max(state.speed_mps, 0.0), accel, pace.share))
    return found


def errors_m(truth: Truth, seen: list[Moment], earlier: DrivenSpeeds) -> dict[str, Array]:
    """Return how far (R, K) the law is off along the way, without memory and with it."""
    track = truth.track
    since_s = (track.stamp_ns - track.stamp_ns[0]) * 1e-9
    way_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(track.xy_m, axis=0).T))])
    moved = np.concatenate([[True], np.diff(way_m) > 1e-3])
    gaps_s = since_s[np.flatnonzero(np.diff(since_s) > _LONGEST_GAP_S)]
    ahead_s = SPEED_AHEAD_STEP_S * np.arange(1, _STEPS + 1)
    found: dict[str, list[Array]] = {"without": [], "with": []}
    for one in seen:
        at_s = (one.stamp_ns - track.stamp_ns[0]) * 1e-9
        gap = np.any((gaps_s > at_s - _LONGEST_GAP_S) & (gaps_s < at_s + HORIZON_S))
        if at_s + HORIZON_S > since_s[-1] or gap:
            continue
        here_m = float(np.interp(at_s, since_s, way_m))
        reach_m = HORIZON_S * (one.speed_mps + 8.0)
        places_m = np.arange(here_m - PATH_BEHIND_M, min(here_m + reach_m, way_m[-1]))
        xy = np.column_stack(
            [np.interp(places_m, way_m[moved], track.xy_m[moved, k]) for k in (0, 1)]
        )
        if len(np.unique(xy, axis=0)) < 3:
            continue
        path = PathAhead(xy_m=xy, speed_limit_mps=np.full(len(xy), LIMIT_MPS))
        car_xy_m = np.array([np.interp(at_s, since_s, track.xy_m[:, k]) for k in (0, 1)])
        driven = earlier.along(xy, stamp_ns=one.stamp_ns, car_xy_m=car_xy_m)
        true_m = np.interp(at_s + ahead_s, since_s, way_m) - here_m
        met = (places_m >= here_m) & (places_m <= here_m + true_m[-1])
        if not np.isfinite(driven[met]).any():
            continue
        for name, known in (("without", None), ("with", driven)):
            speeds = speeds_ahead(
                way_speeds(path, known, speed_mps=one.speed_mps),
                speed_mps=one.speed_mps,
                acceleration_mps2=one.acceleration_mps2,
                usual_share=one.share,
                horizon_s=HORIZON_S,
            )
            gone_m = np.cumsum(SPEED_AHEAD_STEP_S * (speeds[1:] + speeds[:-1]) / 2.0)
            found[name].append(np.abs(gone_m - true_m))
    return {name: np.array(rows) for name, rows in found.items()}


def mean_up_to(errors: Array) -> list[float]:
    """Return the mean over rounds and instants up to each of `UP_TO_S`."""
    return [float(errors[:, : round(until / SPEED_AHEAD_STEP_S)].mean()) for until in UP_TO_S]


def measured(pair: Pair, drives: dict[str, RealDrive]) -> dict[str, Array]:
    """Return the errors of a pair of drives."""
    truth = truth_of(drives[pair.later])
    stamps = truth.track.stamp_ns
    half_ns = int(stamps[0] + stamps[-1]) // 2
    same = pair.later == pair.earlier
    remembered = truth if same else truth_of(drives[pair.earlier])
    until_ns = half_ns if same else int(remembered.track.stamp_ns[-1])
    earlier = DrivenSpeeds((track_of(remembered, until_ns),), truth.frame)
    return errors_m(truth, moments(drives[pair.later], half_ns if same else 0), earlier)


def main() -> int:
    """Print the table."""
    drives = {drive.name: drive for drive in all_drives()}
    print("| drive, remembered | rounds | | 1 s | 2 s | 4 s | 8 s |\n|" + " --- |" * 7)
    for pair in PAIRS:
        if {pair.later, pair.earlier} <= drives.keys():
            errors = measured(pair, drives)
            for name, rows in errors.items():
                cells = " | ".join(f"{mean:.3f}" for mean in mean_up_to(rows))
                print(f"| {pair.later}, {pair.earlier} | {len(rows)} | {name} | {cells} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
