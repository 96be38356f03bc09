"""Who meets the stand-in: each is put where the plan says, by arithmetic, with what that is called.

Each function takes the drive and chance, and puts somebody there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import RoadUserKind
from foretwin.geometry.polyline import arc_lengths, left_of, points_at, tangents
from tests.sim_worker.analysis.occurred.staging import (
    LANE_M,
    Drive,
    Label,
    Random,
    record_span,
    smooth,
    way_line,
)

CAR_M = (4.5, 1.8)


class Actor(NamedTuple):
    """Somebody who is put at places (K, 2) at the drive's times; NaN where not there."""

    name: str
    kind: RoadUserKind
    size_m: tuple[float, float]
    xy_m: Array
    labels: tuple[Label, ...] = ()


def _arc_at(staged: Drive, time_s: Array) -> Array:
    """Where the car is at times, before and after the drive at its speed there."""
    arc = np.interp(time_s, staged.time_s, staged.arc_m)
    early, late = staged.time_s[0] - time_s, time_s - staged.time_s[-1]
    arc = np.where(early > 0.0, staged.arc_m[0] - early * staged.plan.speed_mps, arc)
    return np.where(late > 0.0, staged.arc_m[-1] + late * staged.speed_mps[-1], arc)


def on_line(line: Array, arc_m: Array, left_m: Array | float = 0.0) -> Array:
    """Points along a line that is led straight on at both ends."""
    length = float(arc_lengths(line)[-1])
    first, last = tangents(line)[0], tangents(line)[-1]
    held = np.clip(arc_m, 0.0, length)
    points = points_at(line, held)
    before, behind = np.minimum(arc_m, 0.0)[:, None], np.maximum(arc_m - length, 0.0)[:, None]
    points = points + before * first + behind * last
    index = np.clip((held * 2.0).astype(int), 0, len(line) - 1)
    return points + np.asarray(left_m).reshape(-1, 1) * left_of(tangents(line))[index]


def _cross_place(one: Array, other: Array) -> tuple[float, float]:
    """Return how far along both lines the place is where they are nearest; they cross there."""
    away = np.hypot(*(one[:, None] - other[None]).transpose(2, 0, 1))
    i, j = np.unravel_index(away.argmin(), away.shape)
    assert away[i, j] < 0.6, away[i, j]
    return float(arc_lengths(one)[i]), float(arc_lengths(other)[j])


def crosser(
    staged: Drive,
    random: Random,
    *,
    name: str,
    kind: str,
    from_deg: float,
    turn: str,
    speed: tuple[float, float],
    late_s: float | None = None,
) -> Actor:
    """Somebody in a car who crosses the car's way a moment before or after it is there."""
    line, _, _ = way_line(staged.plan.world, staged.plan.from_deg + from_deg, turn)
    own, its = _cross_place(staged.line, line)
    here_s = float(np.interp(own, staged.arc_m, staged.time_s))
    apart = random.uniform(1.3, 2.2) * random.choice([-1.0, 1.0]) if late_s is None else late_s
    if kind == "ego_turns_across_oncoming" and late_s is None:
        apart = abs(apart)
    at_s, mps = here_s + apart, random.uniform(*speed)
    xy = on_line(line, its + mps * (staged.time_s - at_s))
    labels = (Label(kind, name, min(here_s, at_s) - 3.0, max(here_s, at_s)),) if kind else ()
    return Actor(name, "car", CAR_M, xy, labels)


def on_foot(staged: Drive, random: Random, *, name: str, kind: RoadUserKind) -> Actor:
    """Somebody who crosses the road before or behind the junction, a moment apart from the car."""
    fits = [
        (staged.entry_m - 55.0, staged.entry_m - 25.0),
        (staged.exit_m + 20.0, staged.exit_m + 45.0),
    ]
    arc = random.uniform(*fits[int(random.integers(2))])
    here_s = float(np.interp(arc, staged.arc_m, staged.time_s))
    apart = random.uniform(1.4, 2.4) * random.choice([-1.0, 1.0])
    mps = random.uniform(1.2, 1.7) if kind == "pedestrian" else random.uniform(3.0, 5.0)
    sign = random.choice([-1.0, 1.0])
    aside = sign * mps * (staged.time_s - here_s - apart)
    reach = 8.0 if kind == "pedestrian" else 25.0
    xy = on_line(staged.line, np.full(len(aside), arc), np.clip(aside, -reach, reach))
    xy[np.abs(aside) > reach] = np.nan
    size = (0.5, 0.5) if kind == "pedestrian" else (1.9, 0.5)
    label = "pedestrian_crossing" if kind == "pedestrian" else "cyclist_crossing"
    at_s = here_s + apart
    return Actor(
        name, kind, size, xy, (Label(label, name, min(here_s, at_s) - 2.0, max(here_s, at_s)),)
    )


def lead(staged: Drive, random: Random, *, name: str, cut: str = "") -> Actor | None:
    """Somebody who is where the car will be a moment later; comes from beside, or goes there."""
    after_s = random.uniform(1.4, 2.1)
    time = staged.time_s
    arc = _arc_at(staged, time + after_s) + CAR_M[0]
    left = np.zeros(len(time))
    labels: list[Label] = []
    if cut:
        # Who leaves is followed for long before, who comes for long after.
        cut_m, most_s = (75.0, 4.5) if cut == "cut_in" else (46.0, 3.4)
        cut_s = float(np.interp(staged.entry_m - cut_m, arc, time))
        takes_s = random.uniform(2.8, most_s)
        side = 1.0 if _free_side(staged) == "left" else -1.0
        share = smooth((time - cut_s) / takes_s)
        left = side * LANE_M * ((1.0 - share) if cut == "cut_in" else share)
        labels.append(Label(cut, name, cut_s, cut_s + takes_s))
        if cut == "cut_out":
            left[time > cut_s + takes_s] = side * LANE_M
    xy = on_line(staged.line, arc, left)
    if cut == "cut_out":
        # Nobody beside the junction's own ways: it is gone where its lane ends.
        xy[arc > staged.entry_m - 3.0] = np.nan
    labels_along = along_labels(staged, name, arc, left, np.isfinite(xy[:, 0]))
    return None if labels_along is None else Actor(name, "car", CAR_M, xy, (*labels, *labels_along))


def _free_side(staged: Drive) -> str:
    """The side of the other lane, by the lanes' own places."""
    xy = staged.line[40]
    lanes = [lane for lane in staged.plan.world.lanes if lane.role == "approach"]
    near = min(lanes, key=lambda lane: np.hypot(*(lane.centerline - xy).T).min())
    return "left" if near.left_id else "right"


def standing(staged: Drive, random: Random, *, name: str) -> Actor | None:
    """Somebody who stands where the car has to stop, and goes on before it does."""
    stood = staged.time_s[(staged.speed_mps < 0.1) & (staged.time_s > 5.0)]
    stop_m = float(np.interp(stood[0], staged.time_s, staged.arc_m))
    goes_s = float(stood[-1]) - 1.0
    gone = np.maximum(staged.time_s - goes_s, 0.0)
    driven = np.where(gone < 5.0, 1.0 * gone * gone, 25.0 + 10.0 * (gone - 5.0))
    arc = stop_m + CAR_M[0] + random.uniform(2.0, 4.0) + driven
    xy = on_line(staged.line, arc)
    label = Label("stationary_ahead", name, float(stood[0]) - 5.0, float(stood[0]))
    more = along_labels(staged, name, arc, np.zeros(len(arc)), np.ones(len(arc), dtype=bool))
    return None if more is None else Actor(name, "car", CAR_M, xy, (label, *more))


def beside(staged: Drive, random: Random, *, name: str, near: bool) -> Actor:
    """Somebody parked, near the car's way or well off it."""
    arc = staged.entry_m - random.uniform(40.0, 80.0)
    clear = random.uniform(0.35, 0.8) if near else random.uniform(2.4, 4.0)
    xy = on_line(staged.line, np.full(len(staged.time_s), arc), -(clear + 1.81))
    here_s = float(np.interp(arc, staged.arc_m, staged.time_s))
    labels = (Label("parked_beside", name, here_s - 0.5, here_s + 0.5),) if near else ()
    return Actor(name, "car", CAR_M, xy, labels)


def neighbour(staged: Drive, random: Random, *, name: str, kind: str) -> Actor:
    """Somebody in the other lane, who passes the car, is passed, or keeps beside and ahead."""
    side = LANE_M if _free_side(staged) == "left" else -LANE_M
    at_s = float(np.interp(staged.entry_m - 60.0, staged.arc_m, staged.time_s))
    faster = {"overtakes_ego": 1.0, "ego_overtakes": -1.0, "": 0.0}[kind]
    gain = faster * random.uniform(3.0, 4.5)
    ahead = 12.0 if not kind else 0.0
    arc = np.interp(at_s, staged.time_s, staged.arc_m) + ahead
    arc = arc + (staged.plan.speed_mps + gain) * (staged.time_s - at_s)
    xy = on_line(staged.line, arc, side)
    xy[arc > staged.entry_m - 3.0] = np.nan
    labels = (Label(kind, name, at_s - 1.0, at_s + 1.0),) if kind else ()
    return Actor(name, "car", CAR_M, xy, labels)


def walker(staged: Drive, random: Random, *, name: str) -> Actor:
    """Somebody who walks along the pavement."""
    arc = staged.entry_m - random.uniform(30.0, 80.0) + 1.4 * staged.time_s
    left = -random.uniform(6.0, 8.0)
    xy = on_line(staged.line, arc, left)
    xy[arc > staged.entry_m - 8.0] = np.nan
    return Actor(name, "pedestrian", (0.5, 0.5), xy)


def follower(staged: Drive, random: Random, *, name: str) -> Actor:
    """Somebody who drives behind the car."""
    arc = _arc_at(staged, staged.time_s - random.uniform(1.6, 2.5)) - CAR_M[0]
    return Actor(name, "car", CAR_M, on_line(staged.line, arc))


def along_labels(
    staged: Drive, name: str, arc: Array, left: Array, there: Array
) -> list[Label] | None:
    """Label who is ahead in the car's lane by the plan's own numbers; None where it is a matter of
    opinion, and has to be staged otherwise: followed for 2 to 4.5 s, or braked by 1.6 to 3.6 m/s.
    """
    time = staged.time_s
    gap = arc - staged.arc_m - CAR_M[0]
    own = np.maximum(staged.speed_mps, 0.01)
    speed = np.gradient(arc, time)
    counts = _recorded(staged) & there
    close = counts & (np.abs(left) < 1.2) & (gap > 0.0) & (gap / own <= 2.9)
    close &= (own > 2.0) & (speed > 1.0)
    labels = []
    for first, last in _stretches(close, hole=10):
        long_s = time[last] - time[first]
        if 2.0 <= long_s <= 4.5:
            return None
        if long_s > 4.5:
            labels.append(Label("following", name, float(time[first]), float(time[last])))
    even = np.convolve(np.pad(speed, 3, mode="edge"), np.ones(7) / 7.0, mode="valid")
    slows = (-np.gradient(even, time) > 0.7) & counts
    for first, last in _stretches(slows, hole=4):
        lost = even[first] - even[last]
        matters = (np.abs(left[first]) < 1.2) & (gap[first] > 0.0)
        if not matters or staged.speed_mps[first] < 3.0:
            if lost > 1.6 and gap[first] > 0.0 and np.abs(left[first : last + 1]).min() < 2.5:
                return None
            continue
        if 1.6 <= lost <= 3.6:
            return None
        if lost > 3.6:
            labels.append(Label("lead_decelerates", name, float(time[first]), float(time[last])))
    return labels


def _recorded(staged: Drive) -> Array:
    begin, end = record_span(staged)
    return (staged.time_s >= begin) & (staged.time_s <= end)


def _stretches(flags: Array, *, hole: int) -> list[tuple[int, int]]:
    rows = np.flatnonzero(flags)
    if not len(rows):
        return []
    cuts = np.flatnonzero(np.diff(rows) > hole + 1)
    firsts = [0, *(cuts + 1).tolist()]
    lasts = [*cuts.tolist(), len(rows) - 1]
    return [(int(rows[a]), int(rows[b])) for a, b in zip(firsts, lasts, strict=True)]
