"""The speed that the nominal future aims at, from the speeds driven so far.

Law: present speed plus `LEAD_S` times the present acceleration, never below standing still nor
pushed above the speed limit. A driver who brakes goes on braking for a while, one who accelerates
goes on accelerating, and a car that stands goes on standing; the planner's free-road law and its
curve speeds do the rest. The form is the linear prediction with damped trend of Gardner and
McKenzie (1985), "Forecasting trends in time series", with the damping summed up in one lead time.

tests/orchestrator/routing/test_berlin_prediction.py holds it against constant velocity and constant
turn rate on the real drive that it was chosen on. On steady fast driving it is no better than
constant speed. Slowing down before every junction, at speeds learnt or fixed, hardly changed the
result and was left out.
"""

from __future__ import annotations

LEAD_S = 2.0
SLOPE_WINDOW_S = 1.0
_MIN_SPAN_S = 0.3
_GAP_S = 2.0


class CruiseSpeed:
    """Learns acceleration from speeds over the last second; sees nothing of the future."""

    def __init__(self) -> None:
        self._ages_s: list[float] = []
        self._speeds_mps: list[float] = []
        self._newest_ns: int | None = None

    def update(self, stamp_ns: int, speed_mps: float) -> None:
        """Take a speed; a gap of 2 s, or time running backwards, forgets what was before."""
        if self._newest_ns is not None:
            step_s = (stamp_ns - self._newest_ns) / 1e9
            if step_s == 0.0:
                return
            if step_s > _GAP_S or step_s < 0.0:
                self._ages_s, self._speeds_mps = [], []
            else:
                self._ages_s = [age + step_s for age in self._ages_s]
                while self._ages_s and self._ages_s[0] > SLOPE_WINDOW_S + 1e-6:
                    del self._ages_s[0], self._speeds_mps[0]
        self._newest_ns = stamp_ns
        self._ages_s.append(0.0)
        self._speeds_mps.append(max(0.0, speed_mps))

    @property
    def speed_mps(self) -> float:
        """The newest speed, 0 before the first."""
        return self._speeds_mps[-1] if self._speeds_mps else 0.0

    @property
    def acceleration_mps2(self) -> float:
        """The least-squares slope of the speeds of the last second, 0 while there are too few."""
        count = len(self._ages_s)
        if count < 3 or self._ages_s[0] < _MIN_SPAN_S:
            return 0.0
        mean_age, mean_speed = sum(self._ages_s) / count, sum(self._speeds_mps) / count
        older = [age - mean_age for age in self._ages_s]
        faster = [speed - mean_speed for speed in self._speeds_mps]
        spread = sum([one**2 for one in older])
        return -sum([one * other for one, other in zip(older, faster, strict=True)]) / spread

    def aim_mps(self, speed_limit_mps: float | None = None) -> float:
        """Return the speed to aim at, 0 before the first sample.

        A limit keeps the aim from rising above it, and leaves a car that is faster at its speed.
        """
        speed = self.speed_mps
        aim = max(0.0, speed + LEAD_S * self.acceleration_mps2)
        if speed_limit_mps is not None:
            aim = min(aim, max(speed, speed_limit_mps))
        return aim
