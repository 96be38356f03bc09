"""How well a drive's forecasts of its own progress were calibrated: counted as they come true."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from foretwin.contracts.forecast import ForecastOutcome
from foretwin.contracts.running import RunningMeans

RANKS = 10
"""Bins of the rank histogram: each would hold as much as any other."""
LOW, HIGH = 0.1, 0.9
"""The band whose coverage is told should hold 80 %."""


@dataclass(slots=True)
class ForecastCount:
    """Means over all instants that came, by horizon, and how their shares spread."""

    by_horizon: dict[float, RunningMeans] = field(default_factory=dict)
    ranks: list[int] = field(default_factory=lambda: [0] * RANKS)

    def take(self, outcomes: Iterable[ForecastOutcome]) -> None:
        """Count what came of forecasts."""
        for one in outcomes:
            self._add(
                one.horizon_s,
                one.share,
                one.p90_m - one.p10_m,
                (one.crps_m, one.crps_futures_m, one.crps_table_m),
                abs(one.p50_m - one.travelled_m),
            )

    def take_rows(self, rows: Iterable[Mapping[str, Any]]) -> None:
        """Count the rows of a table of forecasts."""
        for row in rows:
            crps = row["crps_m"], row["crps_futures_m"], row["crps_table_m"]
            width_m = row["p90_m"] - row["p10_m"]
            off_m = abs(row["p50_m"] - row["travelled_m"])
            self._add(row["horizon_s"], row["share"], width_m, crps, off_m)

    def _add(
        self,
        horizon_s: float,
        share: float,
        width_m: float,
        crps_m: tuple[float, float, float],
        off_m: float,
    ) -> None:
        self.ranks[min(int(share * RANKS), RANKS - 1)] += 1
        covered = float(LOW <= share <= HIGH)
        self.by_horizon.setdefault(horizon_s, RunningMeans()).take(
            (covered, *crps_m, width_m, off_m)
        )

    @property
    def rows(self) -> RunningMeans:
        """All horizons together."""
        return sum((self.by_horizon[h] for h in sorted(self.by_horizon)), RunningMeans())

    def record(self) -> dict[str, Any] | None:
        """Return the `calibration` part of run.json, None where no forecast came true.

        Of moving cars, over all instants that came. `crps_uncalibrated` is that of the rounds'
        futures, all taken as equally likely, `crps_table` that of the table alone, before what came
        in this drive moved it; all in metres. `rank_histogram` are the parts of all outcomes that
        fell into each tenth of their forecasts.
        """
        rows = self.rows
        if not rows.count:
            return None
        return {
            **_figures(rows),
            "rank_histogram": [round(n / rows.count, 4) for n in self.ranks],
            "by_horizon_s": {f"{h:g}": _figures(of) for h, of in sorted(self.by_horizon.items())},
        }


def _figures(rows: RunningMeans) -> dict[str, Any]:
    covered, crps, futures, table, width_m, off_m = (round(mean, 4) for mean in rows.means)
    return {
        "p10_p90_coverage": covered,
        "p10_p90_width_m": width_m,
        "crps": crps,
        "crps_uncalibrated": futures,
        "crps_table": table,
        "median_error_m": off_m,
        "count": rows.count,
    }
