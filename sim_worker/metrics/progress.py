"""Progress along the path, and whether the ego keeps to ground that may be driven on."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array, Flags
from foretwin.sim_worker.metrics.rollout import Measure, RolloutView

_LOOK_AGAIN_M = 10.0
"""The path is searched near the place known last, so no farther than this between looks."""
_CORNERS = ((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0))


def progress(view: RolloutView) -> Measure:
    """Metres along the path (S,) from the first to the last instant, negative backwards."""
    arc = view.keep(arc_along_path)
    return view.measure(arc[:, -1] - arc[:, 0])


def backwards(view: RolloutView) -> Measure:
    """Metres (S,) the ego falls back along the path behind where it once was."""
    arc = view.keep(arc_along_path)
    return view.measure((np.maximum.accumulate(arc, axis=1) - arc).max(axis=1))


def arc_along_path(view: RolloutView) -> Array:
    """Return arc lengths (S, L) along the path at the first, the last and some instants between.

    Raises ValueError where there is no path.
    """
    path = view.context.path
    if path is None:
        raise ValueError("progress needs a path")
    xy = view.states[..., :2]
    last = xy.shape[1] - 1
    moved = np.hypot(*np.moveaxis(np.diff(xy, axis=1), 2, 0)).max(initial=0.0)
    stride = max(int(_LOOK_AGAIN_M / max(float(moved), 1e-3)), 1)
    looks = [*range(0, last, stride), last]
    arcs = [path.locate(xy[:, 0]).arc_m]
    for look in looks[1:]:
        arcs.append(path.locate(xy[:, look], near_arc_m=arcs[-1]).arc_m)
    return np.stack(arcs, axis=1)


def off_road_share(view: RolloutView) -> Measure:
    """Share of the instants (S,) at which a corner of the ego is off the drivable ground.

    The ground is 0.3 m wider than drawn: nuPlan, drivable_area_compliance.
    """
    off = view.keep(off_road)
    share: Array = np.empty(len(off))
    np.mean(off, axis=1, out=share)
    return view.measure(share)


def on_road(view: RolloutView) -> Measure:
    """Whether all corners stay on drivable ground at all instants (S,): 1 or 0."""
    return view.measure((~np.asarray(view.keep(off_road).any(axis=1))).astype(np.float64))


def off_road(view: RolloutView) -> Flags:
    """Return at which instants (S, N) a corner of the ego is off the drivable ground.

    Raises ValueError where there is no World.
    """
    ground = view.context.ground
    if ground is None:
        raise ValueError("drivable area: no World given")
    cos, sin = view.heading
    x, y = view.centre_m[..., 0], view.centre_m[..., 1]
    ahead_x, ahead_y = view.half_length_m * cos, view.half_length_m * sin
    left_x, left_y = -view.half_width_m * sin, view.half_width_m * cos
    corners_x = np.stack([x + a * ahead_x + b * left_x for a, b in _CORNERS])
    corners_y = np.stack([y + a * ahead_y + b * left_y for a, b in _CORNERS])
    return np.asarray(~ground.contains(corners_x, corners_y).all(axis=0))
