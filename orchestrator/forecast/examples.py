"""What can be learnt from a recorded drive: at each instant, what was known, and how far it went.

What is known comes from the estimator, causally, as in a drive. Ahead lies the way that was then
driven, as if a route had been given: a map's bends without the map.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.forecast import PROGRESS_TIMES_S
from foretwin.contracts.frames import LocalFrame, local_from_geo
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.orchestrator.forecast.features import AheadFacts, bends_ahead, feature_row
from foretwin.orchestrator.forecast.motion_history import MotionHistory
from foretwin.telemetry.estimator.estimator import estimator_of
from foretwin.telemetry.logs.log import Log

EVERY_S = 0.5
"""Between two examples, as rounds come."""
AFTER_S = 2.0
"""Nothing is learnt from a stretch's first moments, when little is known."""
SMOOTH_M = 9
"""Over so much of the way its positions are averaged: receivers jump by decimetres."""
LEAST_WAY_M = 30.0


class Examples(NamedTuple):
    """N examples of one drive.

    `stamp_ns` (N,), `features` (N, F) with the way ahead and `blind` (N, F) without, `speed_mps`
    (N,) and its standard deviation (N,), 0 where unknown, `distance_m` (N, T) at
    `PROGRESS_TIMES_S`.
    """

    stamp_ns: Array
    features: Array
    blind: Array
    speed_mps: Array
    speed_std_mps: Array
    distance_m: Array


def causal_states(log: Log, vehicle: VehicleParameters) -> Iterable[VehicleState]:
    """Yield the states of a recorded drive, each from what had been measured by then."""
    estimator = estimator_of(log.info, vehicle)
    for channel, message in log.samples():
        state = estimator.handle(channel, message)
        if state is not None:
            yield state


class _Known(NamedTuple):
    """What was known at one instant, and where on its stretch of way that was."""

    stamp_ns: int
    blind: Array
    speed_std_mps: float
    history_m: float
    stretch: int


def examples_of(states: Iterable[VehicleState]) -> Examples:
    """Return the examples of one drive, in its order; none where it is too short."""
    history, known = MotionHistory(), list[_Known]()
    track: dict[int, list[tuple[int, float, float, float]]] = {}
    frame: LocalFrame | None = None
    began_ns = due_ns = 0
    for state in states:
        if frame is None:
            frame = LocalFrame(state.position)
        history.take(state.stamp_ns, state.speed_mps)
        now = history.now
        assert now is not None
        if now.stamp_ns != state.stamp_ns:
            continue
        if now.stretch not in track:
            track[now.stretch] = []
            began_ns = due_ns = state.stamp_ns
        x, y = local_from_geo(frame, state.position.lat_deg, state.position.lon_deg).tolist()
        track[now.stretch].append((state.stamp_ns, now.travelled_m, x, y))
        if state.stamp_ns >= due_ns and state.stamp_ns - began_ns >= AFTER_S * 1e9:
            due_ns = state.stamp_ns + round(EVERY_S * 1e9)
            row = feature_row(
                history,
                accel_mps2=state.accel_mps2,
                yaw_rate_radps=state.yaw_rate_radps,
                ahead=AheadFacts(),
            )
            std_mps = state.speed_std_mps or 0.0
            known.append(_Known(state.stamp_ns, row, std_mps, now.travelled_m, now.stretch))
    return _labelled(known, {stretch: np.array(rows) for stretch, rows in track.items()})


def _labelled(known: list[_Known], tracks: dict[int, Array]) -> Examples:
    times_s = np.array(PROGRESS_TIMES_S)
    stamps, seeing, blind, stds, distances = [], [], [], [], []
    ways = {stretch: _way(track) for stretch, track in tracks.items()}
    for one in known:
        track, way = tracks[one.stretch], ways[one.stretch]
        until = one.stamp_ns + times_s * 1e9
        if until[-1] > track[-1, 0]:
            continue
        stamps.append(one.stamp_ns)
        blind.append(one.blind)
        stds.append(one.speed_std_mps)
        seeing.append(one.blind if way is None else _with_bends(one.blind, way, one.history_m))
        distances.append(np.interp(until, track[:, 0], track[:, 1]) - one.history_m)
    width = len(known[0].blind) if known else 0
    return Examples(
        stamp_ns=np.array(stamps, dtype=np.int64),
        features=np.array(seeing).reshape(-1, width),
        blind=np.array(blind).reshape(-1, width),
        speed_mps=np.array([row[1] for row in blind]),
        speed_std_mps=np.array(stds),
        distance_m=np.array(distances).reshape(-1, len(times_s)),
    )


def _way(track: Array) -> FrenetPath | None:
    """Return the way that was driven, its arc length about the distance travelled."""
    moved = np.concatenate([[True], np.diff(track[:, 1]) > 1e-3])
    at_m, x, y = track[moved, 1], track[moved, 2], track[moved, 3]
    if at_m[-1] < LEAST_WAY_M:
        return None
    nodes = np.arange(0.0, at_m[-1], 1.0)
    xy = np.column_stack([np.interp(nodes, at_m, x), np.interp(nodes, at_m, y)])
    half = SMOOTH_M // 2
    padded = np.pad(xy, ((half, half), (0, 0)), mode="edge")
    kernel = np.full(SMOOTH_M, 1.0 / SMOOTH_M)
    smooth = np.column_stack([np.convolve(padded[:, k], kernel, mode="valid") for k in (0, 1)])
    return FrenetPath(smooth)


def _with_bends(row: Array, way: FrenetPath, at_m: float) -> Array:
    """Return a row with the bends of the way then driven; its limits are not known."""
    share = min(max(at_m, 0.0), way.length_m)
    facts = bends_ahead(way, share)
    found = row.copy()
    found[_BENDS] = (*facts.bend_mps, facts.ease_mps)
    return found


def _bend_places() -> slice:
    from foretwin.orchestrator.forecast.features import BENDS_WITHIN_M, FEATURES

    first = FEATURES.index(f"bend_{BENDS_WITHIN_M[0]:g}m_mps")
    return slice(first, first + len(BENDS_WITHIN_M) + 1)


_BENDS = _bend_places()
