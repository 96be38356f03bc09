"""Progress along the path, and whether the ego keeps to ground that may be driven on."""

from __future__ import annotations

from typing import NamedTuple

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
    """Share of the instants (S,) at which a corner of the ego is off the drivable ground, of those
    at which all lie within the World.

    The ground is 0.3 m wider than drawn: nuPlan, drivable_area_compliance.
    """
    stays = view.keep(staying)
    known = np.count_nonzero(stays.known, axis=1)
    share = np.count_nonzero(stays.off, axis=1) / np.maximum(known, 1)
    return view.measure(share, known > 0)


def on_road(view: RolloutView) -> Measure:
    """Whether all corners stay on drivable ground at all instants (S,) within the World: 1 or 0."""
    known = np.asarray(view.keep(staying).known.any(axis=1))
    return view.measure(keeps_to_road(view), known)


def keeps_to_road(view: RolloutView) -> Array:
    """Return 0 for futures (S,) that leave the drivable ground, else 1: beyond the World's edge
    nothing is known to be left."""
    return np.asarray(1.0 - view.keep(staying).off.any(axis=1))


class Staying(NamedTuple):
    """At which instants (S, N) all corners of the ego lie within the World, and at which of these
    one is off the drivable ground."""

    known: Flags
    off: Flags


def staying(view: RolloutView) -> Staying:
    """Return where futures stay; raises ValueError where there is no World."""
    ground = view.context.ground
    if ground is None:
        raise ValueError("drivable area: no World given")
    cos, sin = view.heading
    x, y = view.centre_m[..., 0], view.centre_m[..., 1]
    ahead_x, ahead_y = view.half_length_m * cos, view.half_length_m * sin
    left_x, left_y = -view.half_width_m * sin, view.half_width_m * cos
    corners_x = np.stack([x + a * ahead_x + b * left_x for a, b in _CORNERS])
    corners_y = np.stack([y + a * ahead_y + b * left_y for a, b in _CORNERS])
    known = np.asarray(ground.extent.holds(np.stack([corners_x, corners_y], axis=-1)).all(axis=0))
    return Staying(known, known & ~np.asarray(ground.contains(corners_x, corners_y).all(axis=0)))
