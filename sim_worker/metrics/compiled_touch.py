"""When moving boxes come to touch, compiled: see `foretwin.geometry.compiled`.

Shapes are (S, N, R): futures, instants, road users. Everybody keeps its speed and its yaw rate.
"""

from __future__ import annotations

import math

from foretwin.contracts.arrays import Array
from foretwin.geometry.compiled import REAL, given, kernel, types

_ALL, _ROWS, _LINE = given(3, "C"), given(2), given(1)
_HALF, _PAIR = types.UniTuple(REAL, 2), types.UniTuple(REAL, 9)
NEVER_ZERO = 1e-300
"""Added to speeds before division: standing still becomes a very long time."""
STRAIGHT_RADPS = 1e-3
"""Who turns more slowly goes straight on: 5 cm beside it after 3 s at 10 m/s."""
TURNS_BY_RAD, TURNS_FOR_S = math.pi, 8.0
"""Nobody is taken to turn on for more than half a circle, or longer. Chosen."""
STRAIGHT_FOR_S = 3600.0
"""Who is met later is never met: speeds that are the same differ by rounding, and one that stands
is not quite 0. Chosen."""
_LEAST_STEP_S = 0.02
"""Touches in a bend that are shorter than this may be overlooked."""
_CLOSE_M, _CLOSE_S, _MOST_STEPS = 1e-9, 1e-10, 60


@kernel(types.UniTuple(REAL, 4), REAL, REAL)
def _arc(rate_radps: float, t_s: float) -> tuple[float, float, float, float]:
    """Return cosine and sine of a turn, and how far it leads along and aside at 1 m/s."""
    turned = rate_radps * t_s
    if abs(turned) < 1e-6:
        return 1.0, turned, t_s, 0.5 * turned * t_s
    cos, sin = math.cos(turned), math.sin(turned)
    return cos, sin, sin / rate_radps, (1.0 - cos) / rate_radps


@kernel(types.UniTuple(REAL, 6), _PAIR, REAL)
def _relative_at(pair: tuple[float, ...], t_s: float) -> tuple[float, ...]:
    """Return what `Relative` holds of a pair `t_s` later, in the axes of the first box then.

    The pair is ahead, left, cos, sin, the first's speed ahead and to the left, its yaw rate, the
    other's speed and yaw rate: motion of constant twist, integrated exactly.
    """
    ahead, left, cos, sin, speed, slide, rate, other_speed, other_rate = pair
    own_cos, own_sin, along, aside = _arc(rate, t_s)
    c, s, other_along, other_aside = _arc(other_rate, t_s)
    gone, beside = other_speed * other_along, other_speed * other_aside
    dx = ahead + cos * gone - sin * beside - (speed * along - slide * aside)
    dy = left + sin * gone + cos * beside - (speed * aside + slide * along)
    yaw_cos, yaw_sin = cos * c - sin * s, sin * c + cos * s
    then_cos, then_sin = (
        yaw_cos * own_cos + yaw_sin * own_sin,
        yaw_sin * own_cos - yaw_cos * own_sin,
    )
    return (
        own_cos * dx + own_sin * dy,
        own_cos * dy - own_sin * dx,
        then_cos,
        then_sin,
        other_speed * then_cos - speed,
        other_speed * then_sin - slide,
    )


@kernel(REAL, types.UniTuple(REAL, 6), _HALF, _HALF)
def _apart(
    at: tuple[float, ...], half_m: tuple[float, ...], other_half_m: tuple[float, ...]
) -> float:
    """Return by how much the separating axes keep two boxes apart; 0 or less where they touch."""
    x, y, cos, sin, _, _ = at
    (length, width), (other_length, other_width) = half_m, other_half_m
    along, across = abs(cos), abs(sin)
    return max(
        abs(x) - (along * other_length + across * other_width + length),
        abs(y) - (across * other_length + along * other_width + width),
        abs(cos * x + sin * y) - (along * length + across * width + other_length),
        abs(cos * y - sin * x) - (across * length + along * width + other_width),
    )


@kernel(REAL, _PAIR, _HALF, _HALF, REAL)
def until_turning_touch(
    pair: tuple[float, ...],
    half_m: tuple[float, ...],
    other_half_m: tuple[float, ...],
    within_s: float,
) -> float:
    """Return seconds until two boxes touch, infinite where they do not `within_s`.

    By conservative advancement (Mirtich 1996, Impulse-based Dynamic Simulation of Rigid Body
    Systems, section 2.3): go on by the time in which they cannot have met, by their relative speed
    and the most that it can change. Within the last step the touch is found by the Illinois method
    (Dowell and Jarratt 1971, A modified regula falsi method for computing the root of an equation).
    """
    _, _, _, _, speed, slide, rate, other_speed, other_rate = pair
    own_m, other_m = math.hypot(half_m[0], half_m[1]), math.hypot(other_half_m[0], other_half_m[1])
    reach = own_m + other_m
    spin = abs(rate) * own_m + abs(other_rate) * other_m
    bend = abs(rate) * math.sqrt(speed * speed + slide * slide) + abs(other_rate * other_speed)
    whirl = bend + rate * rate * own_m + other_rate * other_rate * other_m
    ahead, left, cos, sin = pair[0], pair[1], pair[2], pair[3]
    now = (ahead, left, cos, sin, other_speed * cos - speed, other_speed * sin - slide)
    before = t = gap = 0.0
    while t <= within_s:
        at = _relative_at(pair, t) if t > 0.0 else now
        away = math.sqrt(at[0] * at[0] + at[1] * at[1])
        if away > reach:
            gap, change = away - reach, bend
            closing = -(at[0] * at[4] + at[1] * at[5]) / away
        else:
            gap, change = _apart(at, half_m, other_half_m), whirl
            if gap <= 0.0:
                break
            closing = math.sqrt(at[4] * at[4] + at[5] * at[5]) + spin
        root = math.sqrt(closing * closing + 2.0 * change * gap)
        if closing > 0.0:
            step = 2.0 * gap / (closing + root)
        else:
            step = (root - closing) / (change + NEVER_ZERO)
        before, t = t, t + max(step, _LEAST_STEP_S)
    if t > within_s:
        return math.inf
    if t == 0.0:
        return t
    inside, outside = gap, _apart(_relative_at(pair, before), half_m, other_half_m)
    side = 0
    for _ in range(_MOST_STEPS):
        if t - before < _CLOSE_S:
            break
        middle = before + (t - before) * outside / (outside - inside)
        between = _apart(_relative_at(pair, middle), half_m, other_half_m)
        if abs(between) < _CLOSE_M:
            return middle
        if between > 0.0:
            before, outside = middle, between
            inside *= 0.5 if side > 0 else 1.0
            side = 1
        else:
            t, inside = middle, between
            outside *= 0.5 if side < 0 else 1.0
            side = -1
    return t


@kernel(
    types.void,
    types.UniTuple(_ALL, 7),
    given(3),
    types.UniTuple(given(3), 2),
    _HALF,
    types.UniTuple(_ROWS, 3),
    _LINE,
    REAL[:, ::1],
)
def least_until_touch(
    relative: tuple[Array, ...],
    other_yaw: Array,
    other_half_m: tuple[Array, Array],
    half_m: tuple[float, float],
    twist: tuple[Array, Array, Array],
    time_s: Array,
    least_s: Array,
) -> None:
    """Lower `least_s` (S, N) to the seconds until any is touched.

    `relative` holds (S, N, R) each, as `Relative`; `other_yaw` (S, N, R) is NaN where nobody is;
    half sizes (S, 1, R) are the road users'; `twist` (S, N) are the ego's speeds ahead and to the
    left at the middle of its box and its yaw rate. Straight on it is by the formulas of `meeting`.
    """
    ahead_m, left_m, cos, sin, ahead_mps, left_mps, speed_mps = relative
    futures, instants, users = ahead_m.shape
    (length, width), (half_length_m, half_width_m) = half_m, other_half_m
    own_reach = math.hypot(length, width)
    for future in range(futures):
        for user in range(users):
            other_length = half_length_m[future, 0, user]
            other_width = half_width_m[future, 0, user]
            reach = math.hypot(other_length, other_width) + own_reach
            square = reach * reach
            for instant in range(instants):
                x, y = ahead_m[future, instant, user], left_m[future, instant, user]
                away = x * x + y * y
                if away > 1e11:
                    continue
                c, s = cos[future, instant, user], sin[future, instant, user]
                rate = twist[2][future, instant]
                other_rate = 0.0
                before, after = max(instant - 1, 0), min(instant + 1, instants - 1)
                if math.isnan(other_yaw[future, before, user]):
                    before = instant
                if math.isnan(other_yaw[future, after, user]):
                    after = instant
                if before < after:
                    turned = other_yaw[future, after, user] - other_yaw[future, before, user]
                    turned -= math.tau * math.floor(turned / math.tau + 0.5)
                    other_rate = turned / (time_s[after] - time_s[before])
                fastest = max(abs(rate), abs(other_rate))
                if fastest > STRAIGHT_RADPS:
                    speed, slide = twist[0][future, instant], twist[1][future, instant]
                    other_speed = speed_mps[future, instant, user]
                    within = min(least_s[future, instant], TURNS_FOR_S, TURNS_BY_RAD / fastest)
                    vx, vy = other_speed * c - speed, other_speed * s - slide
                    # By how much nobody can come nearer than straight on: most end here.
                    bend = abs(rate) * math.sqrt(speed * speed + slide * slide) + abs(
                        other_rate * other_speed
                    )
                    near = reach + 0.5 * bend * within * within
                    nearest = -(x * vx + y * vy) / (vx * vx + vy * vy + NEVER_ZERO)
                    nearest = min(max(nearest, 0.0), within)
                    beside_x, beside_y = x + nearest * vx, y + nearest * vy
                    if beside_x * beside_x + beside_y * beside_y > near * near:
                        continue
                    until = until_turning_touch(
                        (x, y, c, s, speed, slide, rate, other_speed, other_rate),
                        (length, width),
                        (other_length, other_width),
                        within,
                    )
                    least_s[future, instant] = min(until, least_s[future, instant])
                    continue
                vx, vy = ahead_mps[future, instant, user], left_mps[future, instant, user]
                # Circles around the boxes touch now or, with these velocities, later.
                past = x * vy - y * vx
                closing = x * vx + y * vy < 0.0 and past * past <= (vx * vx + vy * vy) * square
                if not closing and not away <= square:
                    continue
                along, across = abs(c), abs(s)
                first, last = -math.inf, math.inf
                for distance, rate_mps, both in (
                    (x, vx, along * other_length + across * other_width + length),
                    (y, vy, across * other_length + along * other_width + width),
                    (
                        c * x + s * y,
                        c * vx + s * vy,
                        along * length + across * width + other_length,
                    ),
                    (c * y - s * x, c * vy - s * vx, across * length + along * width + other_width),
                ):
                    per_speed = 1.0 / (rate_mps + NEVER_ZERO)
                    half = abs(per_speed) * both
                    first = max(first, -(per_speed * distance) - half)
                    last = min(last, half - per_speed * distance)
                until = max(first, 0.0)
                if until <= min(last, STRAIGHT_FOR_S) and until < least_s[future, instant]:
                    least_s[future, instant] = until


@kernel(types.void, types.UniTuple(_ALL, 6), types.UniTuple(given(3), 2), REAL, REAL, REAL[::1])
def least_worst_case(
    relative: tuple[Array, ...],
    other_half_m: tuple[Array, Array],
    own_reach_m: float,
    accel_mps2: float,
    least_s: Array,
) -> None:
    """Lower `least_s` (S,) to the least time in which two discs that grow by `accel_mps2` t² / 2
    together touch, at any instant; see `worst_case.worst_time_to_collision`.

    Newton's method from the left: the distance of the middles is convex in time, so that its
    tangent, less the growth, never passes the first touch.
    """
    ahead_m, left_m, _, _, ahead_mps, left_mps = relative
    futures, instants, users = ahead_m.shape
    for future in range(futures):
        for user in range(users):
            reach = own_reach_m + math.hypot(
                other_half_m[0][future, 0, user], other_half_m[1][future, 0, user]
            )
            for instant in range(instants):
                x, y = ahead_m[future, instant, user], left_m[future, instant, user]
                vx, vy = ahead_mps[future, instant, user], left_mps[future, instant, user]
                until, least = 0.0, least_s[future]
                if least < math.inf:
                    px, py = x + vx * least, y + vy * least
                    away = math.sqrt(px * px + py * py)
                    if away > reach + 0.5 * accel_mps2 * least * least:
                        continue
                for _ in range(_MOST_STEPS):
                    px, py = x + vx * until, y + vy * until
                    away = math.sqrt(px * px + py * py)
                    gap = away - reach - 0.5 * accel_mps2 * until * until
                    if gap <= _CLOSE_M or until > least:
                        break
                    falls = accel_mps2 * until - (px * vx + py * vy) / away
                    root = math.sqrt(falls * falls + 2.0 * accel_mps2 * gap)
                    until += (
                        2.0 * gap / (falls + root) if falls > 0.0 else (root - falls) / accel_mps2
                    )
                least_s[future] = min(until, least)
