"""Cases of a scenario: every combination of its listed values, with the ranges drawn."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np
from scipy.special import ndtr, ndtri

from foretwin.contracts.arrays import Array
from foretwin.contracts.scenario import Distribution, Scenario
from foretwin.sim_worker.scenarios.reading import NamedNumber, numbers

Values = dict[str, float]
"""Every number of one case, named `ego.speed_mps`, `<actor>.gap_m`, `faults.brake_gain`."""
_TOGETHER = 4096
"""So many cases are drawn at a time; a power of 2, as the sequence wants."""


def draw_cases(scenario: Scenario, *, seed: int | None = None) -> tuple[Values, ...]:
    """Return a scenario's cases: each combination of listed values with `samples` draws.

    Ranges are drawn by a scrambled Sobol sequence (Owen 1998), which fills them evenly; the
    same seed, the scenario's own unless given, gives the same cases.
    """
    return tuple(drawn_cases(scenario, seed=seed))


def case_count(scenario: Scenario) -> int:
    """Return how many cases a scenario has."""
    return math.prod(map(len, _listed(scenario).values())) * _samples(scenario)


def drawn_cases(scenario: Scenario, *, seed: int | None = None) -> Iterator[Values]:
    """Yield the cases of `draw_cases`, in memory that does not grow with them."""
    found, listed = tuple(numbers(scenario)), _listed(scenario)
    fixed = {n.name: float(n.value) for n in found if not isinstance(n.value, Distribution)}
    draws = _draws(_ranged(scenario), case_count(scenario), scenario.seed if seed is None else seed)
    for values in itertools.product(*listed.values()):
        chosen = fixed | dict(zip(listed, values, strict=True))
        for drawn in itertools.islice(draws, _samples(scenario)):
            case = chosen | drawn
            yield {n.name: case[n.name] for n in found}


def _listed(scenario: Scenario) -> dict[str, tuple[float, ...]]:
    return {
        n.name: tuple(map(float, n.value.values))
        for n in numbers(scenario)
        if isinstance(n.value, Distribution) and n.value.values
    }


def _ranged(scenario: Scenario) -> list[NamedNumber]:
    return [
        n for n in numbers(scenario) if isinstance(n.value, Distribution) and not n.value.values
    ]


def _samples(scenario: Scenario) -> int:
    return scenario.samples if _ranged(scenario) else 1


def _draws(ranged: list[NamedNumber], count: int, seed: int) -> Iterator[Values]:
    """Yield numbers within their spans, by name, so many times."""
    if not ranged:
        yield from itertools.repeat({}, count)
        return
    # It takes most of a second to import, and those who only cast cases never draw.
    from scipy.stats import qmc

    names = [n.name for n in ranged]
    sobol = qmc.Sobol(d=len(ranged), scramble=True, rng=np.random.default_rng(seed))
    together = min(_TOGETHER, 1 << max(0, (count - 1).bit_length()))
    for first in range(0, count, together):
        even = sobol.random(together)[: count - first]
        columns = [_within(n.value, even[:, i]) for i, n in enumerate(ranged)]  # type: ignore[arg-type]
        for drawn in np.stack(columns, axis=-1).tolist():
            yield dict(zip(names, drawn, strict=True))


def _within(span: Distribution, even: Array) -> Array:
    """Map numbers that fill 0 to 1 evenly onto a span, by its inverse distribution."""
    low = -np.inf if span.min is None else span.min
    high = np.inf if span.max is None else span.max
    if span.mean is None or span.std is None:
        return np.asarray(low + (high - low) * even)
    first, last = ndtr((low - span.mean) / span.std), ndtr((high - span.mean) / span.std)
    inside = np.clip(first + (last - first) * even, 1e-12, 1.0 - 1e-12)
    return np.asarray(np.clip(span.mean + span.std * ndtri(inside), low, high))
