"""Each conflict ahead once more, with a reference driver in the car's place."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from foretwin.sim_worker.analysis.occurred.along_way import Encounter
from foretwin.sim_worker.analysis.occurred.driven_way import DrivenWay
from foretwin.sim_worker.analysis.occurred.driver_models import (
    WANDERS_M,
    Ahead,
    careful_driver,
    fuzzy_driver,
)
from foretwin.sim_worker.analysis.occurred.scene import STEP_S

COVERED = ("cut_in", "lead_decelerates", "stationary_ahead")
"""What the regulation's models are for; of who crosses or turns it says nothing."""
_LONGEST_S = 8.0
_EVEN_ROWS = 11


class Prevented(NamedTuple):
    """Whether each reference driver would have prevented a collision, and what was left to it."""

    careful: bool
    careful_least_gap_m: float
    fuzzy: bool
    fuzzy_least_gap_m: float


def prevented(way: DrivenWay, met: Encounter) -> Prevented | None:
    """Return what reference drivers make of an encounter; None for one that they do not cover.

    They come with the car's speed as it begins and keep to its course; the other does what it did,
    and goes on as it last was.
    """
    if met.kind not in COVERED:
        return None
    course = met.course
    first = int(np.clip(met.first, course.first, course.first + len(course.xy_m) - 2))
    on, own = way.see(course), slice(first - course.first, None)
    rows = round(_LONGEST_S / STEP_S)
    rear = on.arc_m[own][:rows] - course.size_m[0] / 2.0
    speed = np.clip(np.gradient(rear, STEP_S), 0.0, None) if len(rear) > 1 else np.zeros(len(rear))
    speed = uniform_filter1d(speed, min(_EVEN_ROWS, len(speed)), mode="nearest")
    left = on.left_m[own][:rows]
    beside = np.abs(left) - way.half_m[1] - course.size_m[1] / 2.0
    comes = -uniform_filter1d(np.gradient(np.abs(left), STEP_S), min(_EVEN_ROWS, len(left)))
    more = rows - len(rear)
    if more > 0:
        rear = np.concatenate([rear, rear[-1] + speed[-1] * STEP_S * np.arange(1, more + 1)])
        speed, beside = (np.pad(values, (0, more), mode="edge") for values in (speed, beside))
        comes = np.pad(comes, (0, more))
    ahead = Ahead(rear, speed, beside, comes, 2.0 * way.half_m[0] + course.size_m[0])
    front = float(way.arc_m[first]) + way.half_m[0]
    ego_mps = max(float(way.ego.speed_mps[first]), 0.0)
    moved = np.abs(left - left[0]) > WANDERS_M
    perceived = int(np.argmax(moved)) if met.kind == "cut_in" and moved.any() else 0
    careful = careful_driver(ahead, front_m=front, speed_mps=ego_mps, perceived_row=perceived)
    fuzzy = fuzzy_driver(ahead, front_m=front, speed_mps=ego_mps)
    return Prevented(
        not careful.collided, careful.least_gap_m, not fuzzy.collided, fuzzy.least_gap_m
    )
