"""Limits on the gap: an alarm when it is exceeded, another when it is well back within."""

from __future__ import annotations

from foretwin.contracts.gap import ALARM_HORIZON_S, ALARM_LIMITS_PER_S, GapAlarm, GapSample

_BACK = 0.7
_OVER_IN_A_ROW, _BACK_IN_A_ROW = 2, 3


class GapLimits:
    """Watches each quantity of `ALARM_LIMITS_PER_S` at one horizon with hysteresis.

    Two samples in a row beyond the limit raise the alarm, three within 70 % of it end it: a gap
    that plays about its limit is told once.
    """

    def __init__(self) -> None:
        self._streak = dict.fromkeys(ALARM_LIMITS_PER_S, 0)
        self._over = dict.fromkeys(ALARM_LIMITS_PER_S, False)

    def handle(self, sample: GapSample) -> list[GapAlarm]:
        """Take one sample; other horizons and gaps of estimated commands say nothing here."""
        if abs(sample.horizon_s - ALARM_HORIZON_S) > 1e-9 or not sample.independent:
            return []
        alarms = []
        for name, limit_per_s in ALARM_LIMITS_PER_S.items():
            limit = limit_per_s * ALARM_HORIZON_S
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
