"""What metrics ask of each road user at each instant, compiled: see `foretwin.geometry.compiled`.

Fifty thousand pairs take longer through dozens of numpy calls than through a loop that leaves each
as soon as nothing can come of it. Shapes are (S, N, R): futures, instants, road users.
"""

from __future__ import annotations

import math

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.geometry.compiled import REAL, WHOLE, given, kernel, types

_ALL, _ROWS, _LINE = given(3, "C"), given(2), given(1)
_SIZES, _HALF = types.UniTuple(given(3), 2), types.UniTuple(REAL, 2)
_THERE = types.Array(types.boolean, 3, "A", readonly=True)
_PICKED, _STEPS = (types.Array(WHOLE, 1, kind, readonly=True) for kind in "AC")
_OUT_ROWS = REAL[:, ::1]


@kernel(
    WHOLE, types.UniTuple(_ALL, 5), _SIZES, _ROWS, _ROWS, types.UniTuple(REAL, 5), WHOLE[::1],
    _OUT_ROWS,
)  # fmt: skip
def find_leaders(
    relative: tuple[Array, ...],
    other_half_m: tuple[Array, Array],
    curvature_pm: Array,
    towards: Array,
    limits: tuple[float, ...],
    pair: Indices,
    found: Array,
) -> int:
    """Return how many (K) are ahead on the ego's course, as `following.leaders` defines it.

    `relative` holds (S, N, R) each: ahead, left, cos, sin and speed; half sizes (S, 1, R);
    `curvature_pm` (S, N); `towards` (S, N) is 1 where the ego drives forwards, and -1 where it
    backs, which turns its axes round. The first K of `pair` are filled with their flat indices, and
    the first K columns of `found` (5, …) with gap, left, reach, and cosine and sine against the
    course.
    """
    ahead_m, left_m, cos, sin, speed_mps = relative
    centre_ahead, length, width, along_cos, stands_mps = limits
    half_length_m, half_width_m = other_half_m
    futures, instants, users = ahead_m.shape
    count = 0
    for future in range(futures):
        for instant in range(instants):
            kappa, way = curvature_pm[future, instant], towards[future, instant]
            front = way * centre_ahead + length
            for user in range(users):
                ahead, y = way * ahead_m[future, instant, user], way * left_m[future, instant, user]
                inward = 1.0 - kappa * y
                if not (ahead > 0.0 and inward > 0.0):
                    continue
                a, b = half_length_m[future, 0, user], half_width_m[future, 0, user]
                x = ahead + way * centre_ahead
                across = kappa * x
                radius = math.sqrt(across * across + inward * inward)
                left = (2.0 * y - kappa * (x * x + y * y)) / (1.0 + radius)
                if not abs(left) < width + a + b:
                    continue
                c, s = way * cos[future, instant, user], way * sin[future, instant, user]
                turned_cos = (c * inward + s * across) / radius
                turned_sin = (s * inward - c * across) / radius
                reach = width + a * abs(turned_sin) + b * abs(turned_cos)
                if not abs(left) < reach:
                    continue
                if (
                    turned_cos < along_cos
                    and not abs(speed_mps[future, instant, user]) < stands_mps
                ):
                    continue
                along = x if abs(kappa) < 1e-6 else math.atan2(across, inward) / kappa
                if not along > front:
                    continue
                gap = along - front - a * abs(turned_cos) - b * abs(turned_sin)
                pair[count] = (future * instants + instant) * users + user
                found[0, count], found[1, count], found[2, count] = max(gap, 0.0), left, reach
                found[3, count], found[4, count] = turned_cos, turned_sin
                count += 1
    return count


@kernel(
    types.void,
    types.UniTuple(given(3), 3),
    types.UniTuple(_LINE, 2),
    types.UniTuple(_PICKED, 3),
    *(_THERE, _PICKED, _ROWS, _ROWS, _LINE, _LINE, _OUT_ROWS),
)
def stays_on_strips(
    poses: tuple[Array, ...],
    half_m: tuple[Array, ...],
    picked: tuple[Indices, ...],
    there: Flags,
    lasts: Indices,
    point_m: Array,
    way: Array,
    strip_half_m: Array,
    time_s: Array,
    found: Array,
) -> None:
    """Fill `found` (2, K): when boxes come onto and leave strips through points along `way` (K, 2).

    `poses` are x, y, yaw (S, N, R), `half_m` half lengths and widths (K,), `strip_half_m` (K,) half
    widths of strips. `picked` are future, user and step (K,) of box k: only the stay that includes
    the instant after that step counts; a box that is on the strip at the first instant came at that
    time, one that is at the last, `lasts` (S,), never leaves. NaN is when one came or left that is
    not `there` (S, N, R) then. Between instants, what a corner lies off the strip changes evenly.
    """
    x, y, yaw = poses
    half_length_m, half_width_m = half_m
    future, user, step = picked
    for k in range(len(step)):
        row, other = future[k], user[k]
        normal_x, normal_y = -way[k, 1], way[k, 0]
        found[0, k], found[1, k] = time_s[0], math.inf
        for end in range(2):
            # From within outwards: back in time to where the stay began, then on to its end.
            outward = 2 * end - 1
            within = at = step[k] + 1 - end
            inside_aside = inside_reach = 0.0
            while 0 <= at <= lasts[row]:
                if not there[row, at, other]:
                    found[end, k] = math.nan
                    break
                aside = (x[row, at, other] - point_m[k, 0]) * normal_x
                aside += (y[row, at, other] - point_m[k, 1]) * normal_y
                cos, sin = math.cos(yaw[row, at, other]), math.sin(yaw[row, at, other])
                reach = strip_half_m[k] + half_length_m[k] * abs(cos * normal_x + sin * normal_y)
                reach += half_width_m[k] * abs(cos * normal_y - sin * normal_x)
                if at != within and abs(aside) >= reach:
                    side = math.copysign(1.0, aside)
                    outside = side * aside - reach
                    fall = outside - (side * inside_aside - inside_reach)
                    share = outside / fall if fall > 0.0 else 0.0
                    begin, end_s = time_s[at], time_s[at - outward]
                    found[end, k] = begin + share * (end_s - begin)
                    break
                inside_aside, inside_reach = aside, reach
                at += outward


@kernel(
    WHOLE,
    types.UniTuple(_ROWS, 4),
    types.UniTuple(given(3), 3),
    *(_SIZES, _HALF, _STEPS, REAL, REAL, WHOLE[:, ::1]),
)
def find_overlaps(
    ego: tuple[Array, ...],
    others: tuple[Array, ...],
    other_half_m: tuple[Array, Array],
    half_m: tuple[float, float],
    later: Indices,
    step_s: float,
    moves_mps: float,
    found: Indices,
) -> int:
    """Return of how many pairs (K) of a future and a road user the boxes overlap at all.

    `ego` is x, y, yaw and speed (S, N) of its box, which goes straight on from each instant for
    `later` (L,) steps; who is slower than `moves_mps` is left out. `others` are x, y, yaw
    (S, N, R), where they come to be. The first K columns of `found` (4, S R) are future, instant,
    road user and steps of each pair's first overlap.
    """
    x, y, yaw, speed = ego
    other_x, other_y, other_yaw = others
    (length, width), (half_length_m, half_width_m) = half_m, other_half_m
    futures, instants, users = other_x.shape
    own_reach, count = math.hypot(length, width), 0
    for future in range(futures):
        for user in range(users):
            a, b = half_length_m[future, 0, user], half_width_m[future, 0, user]
            reach = own_reach + math.hypot(a, b)
            met = False
            for instant in range(instants - later[-1]):
                if met or abs(speed[future, instant]) < moves_mps:
                    continue
                for k in range(len(later)):
                    at = instant + later[k]
                    way = speed[future, instant] * (later[k] * step_s)
                    dx = other_x[future, at, user] - x[future, instant]
                    dy = other_y[future, at, user] - y[future, instant]
                    if abs(dx) + abs(dy) > 1.5 * (reach + abs(way)):
                        continue
                    c, s = math.cos(yaw[future, instant]), math.sin(yaw[future, instant])
                    ahead, left = c * dx + s * dy - way, c * dy - s * dx
                    if ahead * ahead + left * left > reach * reach:
                        continue
                    turned = other_yaw[future, at, user] - yaw[future, instant]
                    c, s = math.cos(turned), math.sin(turned)
                    along, across = abs(c), abs(s)
                    apart = max(
                        abs(ahead) - (along * a + across * b + length),
                        abs(left) - (across * a + along * b + width),
                        abs(c * ahead + s * left) - (along * length + across * width + a),
                        abs(c * left - s * ahead) - (across * length + along * width + b),
                    )
                    if apart <= 0.0:
                        found[0, count], found[1, count] = future, instant
                        found[2, count], found[3, count] = user, later[k]
                        count, met = count + 1, True
                        break
    return count
