"""Departures from commanded accelerations: a sequential test over blocks of driving.

Braking and pulling away last a second or two with a minute between them, so that a window of time
forgets the last one before the next begins. Kept here are the blocks in which something was asked
for, however long ago. Each new block asks whether those since some earlier one agree on a
departure: Page's test (1954) in its form for departures of unknown size (Lorden 1971), whose best
first block is also when the departure began. What such a test finds is fitted together with all
else that may be off, and named where nothing else explains as much.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Indices
from foretwin.contracts.gap import Culprit, Evidence
from foretwin.sim_worker.analysis.gap.findings import Finding
from foretwin.sim_worker.analysis.gap.fitting import JointFit, joint_fit
from foretwin.sim_worker.analysis.gap.push_blocks import BLOCK_S, PushBlocks

_TOGETHER = 2.0
"""Neighbouring blocks err alike: so many count as one."""
_KEPT, _LEAST, _SURE = 60, 3, 3.0
"""Blocks of one kind; the fewest, and the deviations beyond its limit, that accuse."""
_BEFORE, _HARD = 25, 0.7
_PLATEAU = 2.0
"""What a plateau must explain beyond a gain, for being one more number (Akaike 1974)."""
_ASKED_MPS2, _FAST_MPS = 0.25, 5.0


class _Kind(NamedTuple):
    push: str
    """Of the causes of one push one alone is right: a gain or a plateau."""
    limit: float
    """Departures within it are what parameters of the right car leave open."""
    usual: float
    unit: str


_LEFT_OPEN = {"drag": 0.1, "rolling": 0.1, "drive_gain": 0.1, "brake_gain": 0.1}
"""Standard deviations of what parameters of the right car leave open beside a cause."""
_CLEARLY = 6.63
"""Squared deviations that a cause must explain beyond all others: 1 in 100 does by chance."""
_COMMANDED = " of the commanded acceleration"
_BEYOND = " of what is commanded beyond {plateau:.1f} m/s²"
_KINDS = {
    "drive_gain": _Kind("drive", 0.25, 1.0, _COMMANDED),
    "brake_gain": _Kind("brake", 0.25, 1.0, _COMMANDED),
    "saturated_drive": _Kind("drive", 0.2, 1.0, _BEYOND),
    "saturated_brake": _Kind("brake", 0.2, 1.0, _BEYOND),
    "drag": _Kind("drag", 0.33, 0.0, " m/s² lost at 10 m/s"),
}


class _Part(NamedTuple):
    """What a cause scales in each block (K,), what it leaves as it is, and a plateau's height."""

    column: Array
    rest: Array
    plateau: float = float("nan")


def _parts(blocks: PushBlocks) -> dict[str, _Part]:
    """Return for each cause what its departure, model minus car, multiplies."""
    asked = blocks.asked_mps2
    fast = np.where(blocks.speed_mps > _FAST_MPS, blocks.speed_mps / 10.0, 0.0)
    parts = {"drag": _Part(-fast * fast, asked)}
    for name, sign in (("drive", 1.0), ("brake", -1.0)):
        push = sign * asked
        parts[f"{name}_gain"] = _Part(np.where(push > _ASKED_MPS2, asked, 0.0), 0.0 * asked)
        # Everything below the least that was asked for is no push: nothing is hard, nothing stops.
        hard = push >= max(_HARD * float(np.max(push)), _ASKED_MPS2)
        does = [np.sum(sign * one[hard]) for one in (blocks.car_mps2, blocks.model_mps2)]
        plateau = max(float(min(does)) / max(int(hard.sum()), 1), _ASKED_MPS2)
        beyond = sign * np.maximum(push - plateau, 0.0)
        parts[f"saturated_{name}"] = _Part(beyond, asked - beyond, plateau)
    return parts


class PushTest:
    """Takes blocks in time order and says when they agree on a departure."""

    def __init__(self) -> None:
        self._blocks: deque[tuple[float, ...]] = deque(maxlen=8 * _KEPT)
        self._latest_ns = 0.0

    def handle(self, blocks: PushBlocks) -> tuple[Finding, ...]:
        """Take the blocks that are new, in time order; return what all of them say."""
        came = False
        for row in zip(*blocks, strict=True):
            # Half a block of tolerance: stretches begin where the newest sample was.
            if row[0] > self._latest_ns + 0.5e9 * BLOCK_S and np.isfinite(row).all():
                self._latest_ns, came = row[0], True
                self._blocks.append(row)
        return self._judge() if came else ()

    def _judge(self) -> tuple[Finding, ...]:
        blocks = PushBlocks(*np.array(self._blocks, dtype=np.float64).T)
        parts = _parts(blocks)
        gap, weight = blocks.model_mps2 - blocks.car_mps2, blocks.std_mps2**-2
        found: list[tuple[str, Indices]] = []
        for cause, kind in _KINDS.items():
            column = parts[cause].column
            used = np.flatnonzero(column)[::-1][:_KEPT]
            if len(used) < _LEAST or used[0] != len(gap) - 1:
                continue
            square = np.cumsum((weight * column * column)[used])
            value = np.cumsum((weight * column * gap)[used]) / square
            std = np.sqrt(_TOGETHER / square)
            # A plateau within what a right car's gain leaves open is none.
            whole = column if cause == "drag" else blocks.asked_mps2
            left_open = kind.limit * np.cumsum((weight * column * whole)[used]) / square
            sure = (np.abs(value) - left_open) / std
            sure[: _LEAST - 1] = -np.inf
            count = int(np.argmax(sure))
            used, off, doubt = used[: count + 1], float(value[count]), float(std[count])
            if sure[count] > _SURE and not (
                cause.startswith("saturated") and _exceeds(blocks, parts[cause], used, off, doubt)
            ):
                found.append((cause, used))
        if not found:
            return ()
        return _explain(blocks, parts, found)


def _explain(
    blocks: PushBlocks, parts: dict[str, _Part], found: Sequence[tuple[str, Indices]]
) -> tuple[Finding, ...]:
    """Return the causes without which the rest leaves clearly more of the gap, surest first."""
    # Blocks before the departure count too. Drag does not set in: it is there in all of them.
    since = max(0, min(int(used[-1]) for _, used in found) - _BEFORE)
    recent = slice(since, None)
    asked, car, model = blocks.asked_mps2, blocks.car_mps2, blocks.model_mps2
    variance = _TOGETHER * blocks.std_mps2[recent] ** 2
    gap = (model - car)[recent]
    columns = {name: parts[name].column[recent] for name in _LEFT_OPEN if name in parts}
    columns["rolling"] = -np.ones(len(gap))
    free = {}
    for cause, used in found:
        free[cause] = parts[cause].column.copy()
        free[cause][: 0 if cause == "drag" else int(used[-1])] = 0.0

    def fit(causes: Sequence[str], of: Array) -> JointFit:
        left_open = [name for name in _LEFT_OPEN if name not in causes]
        both = [free[cause][recent] for cause in causes] + [columns[name] for name in left_open]
        prior = [np.inf] * len(causes) + [_LEFT_OPEN[name] for name in left_open]
        stacked = np.stack(both, axis=1)
        return joint_fit(of, stacked, variance=variance, prior_std=np.array(prior))

    def cost(causes: Sequence[str]) -> float:
        return fit(causes, gap).left + _PLATEAU * sum("saturated" in cause for cause in causes)

    named: list[str] = []
    others = [cause for cause, _ in found]
    while others:
        best = min(others, key=lambda cause: cost([*named, cause]))
        if cost(named) - cost([*named, best]) < _CLEARLY:
            break
        named.append(best)
        others = [one for one in others if _KINDS[one].push != _KINDS[best].push]
    worse = {one: cost([other for other in named if other != one]) - cost(named) for one in named}
    named = sorted((one for one in named if worse[one] >= _CLEARLY), key=lambda one: -worse[one])
    if not named or cost(named) > 0.7 * float(np.sum(gap**2 / variance)):
        return ()
    whole, of_car = fit(named, gap), fit(named, (car - asked)[recent])
    begun_ns = {cause: int(blocks.stamp_ns[used[-1]]) for cause, used in found}
    return tuple(
        _finding(
            cause,
            parts[cause].plateau,
            by_car=_KINDS[cause].usual + float(of_car.sizes[index]),
            off=float(whole.sizes[index]),
            std=float(whole.std[index]),
            began_ns=begun_ns[cause] - round(BLOCK_S * 1e9),
        )
        for index, cause in enumerate(named)
    )


def _exceeds(blocks: PushBlocks, part: _Part, used: Indices, off: float, doubt: float) -> bool:
    """Return whether car or model does more than is asked: its push has come to no end."""
    column = part.column[used]
    weighted = blocks.std_mps2[used] ** -2 * column
    done = float(np.sum(weighted * (blocks.car_mps2[used] - part.rest[used])))
    by_car = done / float(np.sum(weighted * column))
    return max(by_car, by_car + off) > 1.0 + _KINDS["saturated_drive"].limit + 3.0 * doubt


def _finding(
    cause: str, plateau: float, *, by_car: float, off: float, std: float, began_ns: int
) -> Finding:
    """Say which of the two departs: achieved over commanded is 1 for a car that follows."""
    kind, by_model = _KINDS[cause], by_car + off
    off_car, off_model = abs(by_car - kind.usual), abs(by_model - kind.usual)
    culprit: Culprit = "vehicle" if off_car > off_model else "model"
    accused = "car" if culprit == "vehicle" else "model"
    if min(off_car, off_model) > kind.limit + 3.0 * std:
        culprit = "both"
        accused = "car" if off_car < off_model else "model"  # as sure as of the lesser
    unit = kind.unit.format(plateau=plateau)
    said = f"the car does {by_car:.2f} and the model {by_model:.2f}{unit}"
    departs = {"vehicle": "the car departs", "model": "the model departs", "both": "both depart"}
    evidence = tuple(
        Evidence(
            name=f"{whose}_{cause}",
            value=does,
            expected=kind.usual,
            std=std,
            text=f"the {whose}: {does:.2f}{unit}",
        )
        for whose, does in (("car", by_car), ("model", by_model))
    )
    text = f"{said}: {departs[culprit]} from the command"
    by = f"{accused}_{cause}"
    return Finding(culprit, cause, text, evidence, began_ns, decided_by=by)
