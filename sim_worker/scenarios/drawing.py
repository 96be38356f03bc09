"""Cases of a scenario: every combination of its listed values, with the ranges drawn."""

from __future__ import annotations

import itertools

import numpy as np
from scipy.special import ndtr, ndtri

from foretwin.contracts.arrays import Array
from foretwin.contracts.scenario import Distribution, Scenario
from foretwin.sim_worker.scenarios.reading import NamedNumber, numbers

Values = dict[str, float]
"""Every number of one case, named `ego.speed_mps`, `<actor>.gap_m`, `faults.brake_gain`."""


def draw_cases(scenario: Scenario, *, seed: int | None = None) -> tuple[Values, ...]:
    """Return a scenario's cases: each combination of listed values with `samples` draws.

    Ranges are drawn by a scrambled Sobol sequence (Owen 1998), which fills them evenly; the
    same seed, the scenario's own unless given, gives the same cases.
    """
    found = tuple(numbers(scenario))
    fixed = {n.name: float(n.value) for n in found if not isinstance(n.value, Distribution)}
    listed = {
        n.name: map(float, n.value.values)
        for n in found
        if isinstance(n.value, Distribution) and n.value.values
    }
    ranged = [n for n in found if isinstance(n.value, Distribution) and not n.value.values]
    chosen = [
        dict(zip(listed, values, strict=True)) for values in itertools.product(*listed.values())
    ]
    samples = scenario.samples if ranged else 1
    draws = _draws(ranged, len(chosen) * samples, scenario.seed if seed is None else seed)
    cases = []
    for index, drawn in enumerate(draws.tolist()):
        names = (n.name for n in ranged)
        case = fixed | chosen[index // samples] | dict(zip(names, drawn, strict=True))
        cases.append({n.name: case[n.name] for n in found})
    return tuple(cases)


def _draws(ranged: list[NamedNumber], count: int, seed: int) -> Array:
    """Return (count, len(ranged)) numbers within their spans."""
    if not ranged:
        return np.zeros((count, 0))
    # It takes most of a second to import, and those who only cast cases never draw.
    from scipy.stats import qmc

    sobol = qmc.Sobol(d=len(ranged), scramble=True, rng=np.random.default_rng(seed))
    even = sobol.random_base2(max(0, (count - 1).bit_length()))[:count]
    columns = [_within(n.value, even[:, i]) for i, n in enumerate(ranged)]  # type: ignore[arg-type]
    return np.stack(columns, axis=-1)


def _within(span: Distribution, even: Array) -> Array:
    """Map numbers that fill 0 to 1 evenly onto a span, by its inverse distribution."""
    low = -np.inf if span.min is None else span.min
    high = np.inf if span.max is None else span.max
    if span.mean is None or span.std is None:
        return np.asarray(low + (high - low) * even)
    first, last = ndtr((low - span.mean) / span.std), ndtr((high - span.mean) / span.std)
    inside = np.clip(first + (last - first) * even, 1e-12, 1.0 - 1e-12)
    return np.asarray(np.clip(span.mean + span.std * ndtri(inside), low, high))
