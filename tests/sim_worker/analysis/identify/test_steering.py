"""The steering map: a bend errs in its own way, and its interval must say so."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from foretwin.contracts.tuning import SteeringMapBin
from foretwin.sim_worker.analysis.identify.steering import steering_map

PERIOD_S = 0.01
RATIO = 15.0
BEND, STRAIGHT = round(4.0 / PERIOD_S), round(10.0 / PERIOD_S)


def told(bends: int, *, seed: int = 0, one_turn: bool = False) -> tuple[SteeringMapBin, ...]:
    """Return the map of bends of 4 s at 6 m/s, each 3 % off in its own way.

    With `one_turn` they follow each other without a straight between.
    """
    random, apart = np.random.default_rng(seed), 0 if one_turn else STRAIGHT
    count = bends * (BEND + apart) + STRAIGHT
    wheel, tyre = np.zeros(count), np.zeros(count)
    for bend in range(bends):
        part = slice(bend * (BEND + apart), bend * (BEND + apart) + BEND)
        wheel[part] = 1.5 * np.sin(np.linspace(0.0, np.pi, BEND)) + 0.2
        off = 1.0 + 0.03 * random.normal()
        tyre[part] = wheel[part] / RATIO * off + 0.0003 * random.normal(size=BEND)
    signals: Any = SimpleNamespace(
        used=np.flatnonzero(wheel),
        speed_mps=np.full(count, 6.0),
        late_wheel_rad=lambda values: wheel,
        steered_rad=lambda values: tyre,
    )
    fit: Any = SimpleNamespace(signals=signals, fit=SimpleNamespace(values=np.zeros(8)))
    record: Any = SimpleNamespace(time_s=np.arange(count) * PERIOD_S)
    return steering_map(record, fit)


def test_the_interval_holds_the_ratio_although_each_bend_is_off() -> None:
    found = [entry for seed in range(60) for entry in told(6, seed=seed)]
    assert len(found) == 60
    assert 54 <= sum(entry.low <= RATIO <= entry.high for entry in found) <= 60
    halves = [0.5 * (entry.high - entry.low) for entry in found]
    assert np.median(halves) == pytest.approx(0.37, abs=0.05)


def test_fewer_than_three_bends_tell_no_ratio() -> None:
    assert told(2) == ()
    assert len(told(3)) == 1
    assert told(6, one_turn=True) == ()
