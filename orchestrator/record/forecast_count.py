"""How well a drive's forecasts of its own progress were calibrated: counted as they come true."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from foretwin.contracts.forecast import ForecastOutcome
from foretwin.contracts.running import RunningMeans
from foretwin.sim_worker.futures.columns import row_of

RANKS = 10
"""Bins of the rank histogram: each would hold as much as any other."""
LOW, HIGH = 0.1, 0.9
"""The band whose coverage is told should hold 80 %."""


@dataclass(slots=True)
class ForecastCount:
    """Means over all instants that came, by horizon, and how their shares spread."""

    by_horizon: dict[float, RunningMeans] = field(default_factory=dict)
    futures: dict[float, RunningMeans] = field(default_factory=dict)
    """Of rounds with a valid future alone: how these, equally likely, fared."""
    ranks: list[int] = field(default_factory=lambda: [0] * RANKS)

    def take(self, outcomes: Iterable[ForecastOutcome]) -> None:
        """Count what came of forecasts."""
        self.take_rows(map(row_of, outcomes))

    def take_rows(self, rows: Iterable[Mapping[str, Any]]) -> None:
        """Count the rows of a table of forecasts."""
        for row in rows:
            horizon_s, share = row["horizon_s"], row["share"]
            self.ranks[min(int(share * RANKS), RANKS - 1)] += 1
            covered = float(LOW <= share <= HIGH)
            width_m = row["p90_m"] - row["p10_m"]
            off_m = abs(row["p50_m"] - row["travelled_m"])
            told = covered, row["crps_m"], row["crps_table_m"], width_m, off_m
            self.by_horizon.setdefault(horizon_s, RunningMeans()).take(told)
            futures = self.futures.setdefault(horizon_s, RunningMeans())
            if (crps_m := row["crps_futures_m"]) is not None:
                futures.take((crps_m,))

    @property
    def rows(self) -> RunningMeans:
        """All horizons together."""
        return _all(self.by_horizon)

    def record(self) -> dict[str, Any] | None:
        """Return the `calibration` part of run.json, None where no forecast came true.

        Of moving cars, over all instants that came. `crps_uncalibrated` is that of the rounds'
        futures, all taken as equally likely, over the `count_uncalibrated` of them that have a
        valid one; `crps_table` that of the table alone, before what came in this drive moved it;
        all in metres. `rank_histogram` are the parts of all outcomes that fell into each tenth of
        their forecasts.
        """
        rows, futures = self.rows, _all(self.futures)
        if not rows.count:
            return None
        return {
            **_figures(rows, futures),
            "rank_histogram": [round(n / rows.count, 4) for n in self.ranks],
            "by_horizon_s": {
                f"{h:g}": _figures(of, self.futures[h]) for h, of in sorted(self.by_horizon.items())
            },
        }


def _all(by_horizon: Mapping[float, RunningMeans]) -> RunningMeans:
    return sum((by_horizon[h] for h in sorted(by_horizon)), RunningMeans())


def _figures(rows: RunningMeans, futures: RunningMeans) -> dict[str, Any]:
    covered, crps, table, width_m, off_m = (round(mean, 4) for mean in rows.means)
    uncalibrated = [round(mean, 4) for mean in futures.means]
    return {
        "p10_p90_coverage": covered,
        "p10_p90_width_m": width_m,
        "crps": crps,
        "crps_uncalibrated": uncalibrated[0] if uncalibrated else None,
        "crps_table": table,
        "median_error_m": off_m,
        "count": rows.count,
        "count_uncalibrated": futures.count,
    }
