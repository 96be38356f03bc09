"""Limits on the gap: an alarm when it is exceeded, another when it is well back within."""

from __future__ import annotations

from collections.abc import Mapping

from foretwin.contracts.gap import ALARM_HORIZON_S, ALARM_LIMITS_PER_S, GapAlarm, GapSample

_BACK = 0.7
_OVER_IN_A_ROW, _BACK_IN_A_ROW = 2, 3


class GapLimits:
    """Watches each quantity at one horizon with hysteresis.

    Two samples in a row beyond the limit raise the alarm, three within 70 % of it end it: a gap
    that plays about its limit is told once.
    """

    def __init__(
        self,
        *,
        horizon_s: float = ALARM_HORIZON_S,
        limits_per_s: Mapping[str, float] = ALARM_LIMITS_PER_S,
    ) -> None:
        """Raises ValueError for a limit that is not above zero."""
        for name, limit in limits_per_s.items():
            if not limit > 0.0:
                raise ValueError(f"limit of {name} is {limit}; it must be above zero")
        self._horizon_s = horizon_s
        self._limits = {name: limit * horizon_s for name, limit in limits_per_s.items()}
        self._streak = dict.fromkeys(self._limits, 0)
        self._over = dict.fromkeys(self._limits, False)

    def handle(self, sample: GapSample) -> list[GapAlarm]:
        """Take one sample; other horizons and gaps of estimated commands say nothing here."""
        if abs(sample.horizon_s - self._horizon_s) > 1e-9 or not sample.independent:
            return []
        alarms = []
        for name, limit in self._limits.items():
            value = getattr(sample, name)
            over = self._over[name]
            against = abs(value) < _BACK * limit if over else abs(value) > limit
            self._streak[name] = self._streak[name] + 1 if against else 0
            if self._streak[name] < (_BACK_IN_A_ROW if over else _OVER_IN_A_ROW):
                continue
            self._over[name], self._streak[name] = not over, 0
            alarms.append(
                GapAlarm(
                    vehicle_id=sample.vehicle_id,
                    stamp_ns=sample.stamp_ns,
                    quantity=name,
                    value=value,
                    limit=limit,
                    manoeuvre=sample.manoeuvre,
                    over=not over,
                )
            )
        return alarms
