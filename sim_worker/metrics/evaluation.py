"""The functions that compute the metrics of the table, and the call for those asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from types import MappingProxyType

from foretwin.sim_worker.metrics.rollout import Context, Measure, Rollout, RolloutView
from foretwin.sim_worker.metrics.table import METRICS, Need


def _function(computed_by: str) -> Callable[[RolloutView], Measure]:
    module, _, name = computed_by.partition(".")
    found: Callable[[RolloutView], Measure] = getattr(
        import_module(f"{__package__}.{module}"), name
    )
    return found


COMPUTED: Mapping[str, Callable[[RolloutView], Measure]] = MappingProxyType(
    {name: _function(metric.computed_by) for name, metric in METRICS.items()}
)
"""How each metric of the table is computed."""


def computable(context: Context) -> tuple[str, ...]:
    """Return the names of all metrics that `context` suffices for, in the table's order."""
    return tuple(name for name in METRICS if not _missing(name, context))


def evaluate(
    rollout: Rollout, names: Sequence[str] | None = None, *, context: Context | None = None
) -> dict[str, Measure]:
    """Return the named metrics of a rollout, by default all that `context` suffices for.

    Values are NaN where the mask is false: for futures that are not valid, and where a metric says
    so. Raises ValueError for an unknown name, for a metric whose needs `context` lacks, and for
    arrays whose shapes do not fit.
    """
    given = context or Context()
    chosen = computable(given) if names is None else tuple(names)
    unknown = [name for name in chosen if name not in METRICS]
    if unknown:
        raise ValueError(f"unknown metric {', '.join(unknown)}; known: {', '.join(METRICS)}")
    for name in chosen:
        if missing := _missing(name, given):
            raise ValueError(f"metric {name} needs {', '.join(missing)}, which is not given")
    view = RolloutView(rollout, given)
    return {name: COMPUTED[name](view) for name in chosen}


def _missing(name: str, context: Context) -> tuple[Need, ...]:
    return tuple(need for need in METRICS[name].needs if getattr(context, need) is None)
