"""How far the free model leaves reality, by horizon and by manoeuvre.

Limits on the gap raise an alarm when it is exceeded, and another when it is well back within.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Flags, Indices
from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.gap import (
    ALARM_HORIZON_S,
    ALARM_LIMITS_PER_S,
    GapAlarm,
    GapSample,
    Manoeuvre,
)
from foretwin.contracts.simulation import HORIZONS_S
from foretwin.sim_worker.analysis.gap.free_run import (
    FreeRunner,
    accel_commands_from_motion,
    start_states,
    tire_angles,
)
from foretwin.sim_worker.analysis.gap.measured_motion import (
    MANOEUVRES,
    MeasuredMotion,
    manoeuvre_of,
)
from foretwin.sim_worker.analysis.gap.measured_turning import MeasuredDrive
from foretwin.sim_worker.analysis.identify.road_grade import climb_under
from foretwin.sim_worker.analysis.motion_record import PERIOD_S, MotionRecord
from foretwin.sim_worker.vehicle.lag import without_lags

_EVERY_S, _TOLD = 1.0, 0.95
"""Between starts; so much of a run is commanded, through the rest commands hold. Chosen."""
QUANTITIES = ("along_m", "across_m", "yaw_rad", "yaw_rate_radps", "speed_mps", "accel_mps2")
"""Of a sample; a row has `position_m` too, how far apart both are."""
ALL_MANOEUVRES: Literal["all"] = "all"
"""What a row of all manoeuvres together is called."""

_STDS = {
    "along_m": "along_std_m",
    "across_m": "across_std_m",
    "yaw_rad": "yaw_std_rad",
    "speed_mps": "speed_std_mps",
}


class GapRow(NamedTuple):
    """RMS and 95th percentile of |model - reality| by quantity, for one horizon and manoeuvre."""

    horizon_s: float
    manoeuvre: Manoeuvre | Literal["all"]
    runs: int
    independent: bool
    rms: dict[str, float]
    p95: dict[str, float]
    state_std: dict[str, float]
    """RMS of what uncertain states leave open of the gap, as standard deviations."""


class GapMeter:
    """Lets the model run freely from measured states and measures how far it gets from reality."""

    def __init__(self, runner: FreeRunner, *, vehicle_id: str) -> None:
        self._runner = runner
        self._vehicle_id = vehicle_id
        self._immediate: FreeRunner | None = None

    def samples(
        self,
        record: MotionRecord,
        motion: MeasuredMotion,
        *,
        horizons_s: Sequence[float] = HORIZONS_S,
        measured: MeasuredDrive | None = None,
    ) -> list[GapSample]:
        """Return the gap at each horizon after each start, 1 s apart, in time order.

        Where no commands were recorded the model steers and rolls as `measured`; without that,
        commands are estimated from the motion and the samples are not independent. Runs that meet
        a gap in the measured motion, or in the commands, are left out.
        """
        known, told = motion.known, self._told(record)
        shortest = round(min(horizons_s) / PERIOD_S)
        starts = np.arange(0, len(known) - shortest, round(_EVERY_S / PERIOD_S))
        starts = starts[known[starts]]
        wanted = [(row, horizon) for row in range(len(starts)) for horizon in horizons_s]
        whole = [one for one in wanted if _throughout(told, int(starts[one[0]]), one[1])]
        commanded = bool(whole) and bool(told[starts].mean() > 0.9)
        wanted = whole if commanded else wanted
        return self._measure(record, motion, starts, wanted, measured, commanded=commanded)

    def latest(
        self, record: MotionRecord, motion: MeasuredMotion, *, horizons_s: Sequence[float]
    ) -> list[GapSample]:
        """Return the gap at the record's last instant after each horizon, all in one batch."""
        last = len(motion.known) - 1
        steps = {horizon: round(horizon / PERIOD_S) for horizon in horizons_s}
        fitting = [h for h, back in steps.items() if back <= last and motion.known[last - back]]
        starts = np.array([last - steps[horizon] for horizon in fitting], dtype=np.intp)
        told, wanted = self._told(record), list(enumerate(fitting))
        commanded = all(_throughout(told, int(starts[row]), horizon) for row, horizon in wanted)
        return self._measure(record, motion, starts, wanted, commanded=commanded)

    def _told(self, record: MotionRecord) -> Flags:
        """Return where (N,) the car was commanded."""
        steer = tire_angles(record, self._runner.vehicle).commanded_rad
        return np.asarray(np.isfinite(steer) & np.isfinite(record.command_accel_mps2))

    def _measure(
        self,
        record: MotionRecord,
        motion: MeasuredMotion,
        starts: Indices,
        wanted: Sequence[tuple[int, float]],
        measured: MeasuredDrive | None = None,
        *,
        commanded: bool,
    ) -> list[GapSample]:
        """Run from each of `starts`; return the gap of each (row, horizon) wanted."""
        if not len(starts):
            return []
        known = motion.known
        found: list[GapSample] = []
        vehicle, runner = self._runner.vehicle, self._runner
        signals = tire_angles(record, vehicle)
        measured = None if commanded else measured
        independent = commanded or measured is not None
        tire, climb = signals.measured_rad, climb_under(record, runner.roads)
        held = None
        if commanded:
            accel, steer = record.command_accel_mps2, signals.commanded_rad
        else:
            if self._immediate is None:
                self._immediate = FreeRunner(without_lags(vehicle), roads=runner.roads)
            runner = self._immediate
            accel = accel_commands_from_motion(
                vehicle,
                speed_mps=motion.speed_mps,
                accel_mps2=motion.accel_mps2,
                climb_mps2=None if climb is None else climb.mps2,
            )
            if measured is None:
                begin = start_states(vehicle, motion, tire_rad=tire)
                steer = np.where(known, begin[:, 6], np.nan)
            else:
                steer, held = measured
                tire = steer
        begin = start_states(vehicle, motion.at(starts), tire_rad=tire[starts])
        begin[:, :2] = 0.0  # near the origin, where numbers are exact
        steps = round(max(horizon for _, horizon in wanted) / PERIOD_S)
        runs = runner.run(
            states=begin,
            starts=starts,
            steps=steps,
            accel_mps2=accel,
            tire_rad=steer,
            hold_speed_mps=held,
            delayed=commanded,
            climb_mps2=None if climb is None else climb.mps2,
        )
        for row, horizon in wanted:
            start, count = int(starts[row]), round(horizon / PERIOD_S)
            end = start + count
            if end >= len(known) or not known[start : end + 1].all():
                continue
            real = motion.at(end)
            model = runs[row, count]
            dx = model[0] + motion.x_m[start] - real.x_m
            dy = model[1] + motion.y_m[start] - real.y_m
            cos, sin = np.cos(real.yaw_rad), np.sin(real.yaw_rad)
            stretch = slice(start, end + 1)
            found.append(
                GapSample(
                    vehicle_id=self._vehicle_id,
                    stamp_ns=int(record.stamp_ns[end]),
                    horizon_s=horizon,
                    manoeuvre=manoeuvre_of(
                        speed_mps=motion.speed_mps[stretch],
                        yaw_rate_radps=motion.yaw_rate_radps[stretch],
                        accel_mps2=motion.accel_mps2[stretch],
                    ),
                    along_m=float(cos * dx + sin * dy),
                    across_m=float(cos * dy - sin * dx),
                    yaw_rad=float(wrap_angle(model[2] - real.yaw_rad)),
                    yaw_rate_radps=float(model[5] - real.yaw_rate_radps),
                    speed_mps=float(model[3] - real.speed_mps),
                    accel_mps2=float(model[7] - real.accel_mps2),
                    independent=independent,
                    **_open_by_states(motion, start, end, horizon_s=horizon),
                )
            )
        return sorted(found, key=lambda sample: sample.stamp_ns)


def _throughout(told: Flags, start: int, horizon_s: float) -> bool:
    """Return whether a run was commanded to its end: no command says what a human does."""
    return bool(told[start : start + round(horizon_s / PERIOD_S)].mean() >= _TOLD)


def _open_by_states(
    motion: MeasuredMotion, start: int, end: int, *, horizon_s: float
) -> dict[str, float]:
    """Return what the states at both ends leave open of a gap, as standard deviations.

    A heading that is off at the start leads the run aside, a speed ahead or behind. Positions count
    at both ends: how alike they err is not told.
    """
    yaw, speed = motion.yaw_std_rad, motion.speed_std_mps
    placed_m = float(np.hypot(motion.position_std_m[start], motion.position_std_m[end]))
    gone_m = abs(float(np.mean(motion.speed_mps[start : end + 1]))) * horizon_s
    return {
        "along_std_m": math.hypot(float(speed[start]) * horizon_s, placed_m),
        "across_std_m": math.hypot(float(yaw[start]) * gone_m, placed_m),
        "yaw_std_rad": float(np.hypot(yaw[start], yaw[end])),
        "speed_std_mps": float(np.hypot(speed[start], speed[end])),
    }


def gap_table(samples: Sequence[GapSample], *, also_all: bool = False) -> list[GapRow]:
    """Return one row for each horizon and manoeuvre that occurred, shortest horizon first.

    `also_all` puts one of all manoeuvres together before those of its horizon.
    """
    groups: dict[tuple[float, Manoeuvre | Literal["all"]], list[GapSample]] = defaultdict(list)
    for sample in samples:
        groups[sample.horizon_s, sample.manoeuvre].append(sample)
        if also_all:
            groups[sample.horizon_s, ALL_MANOEUVRES].append(sample)
    rows = []
    order = (ALL_MANOEUVRES, *MANOEUVRES)
    for horizon, manoeuvre in sorted(groups, key=lambda key: (key[0], order.index(key[1]))):
        group = groups[horizon, manoeuvre]
        values = {name: np.array([getattr(one, name) for one in group]) for name in QUANTITIES}
        values["position_m"] = np.hypot(values["along_m"], values["across_m"])
        rows.append(
            GapRow(
                horizon_s=horizon,
                manoeuvre=manoeuvre,
                runs=len(group),
                independent=all(one.independent for one in group),
                rms={name: float(np.sqrt(np.mean(v * v))) for name, v in values.items()},
                state_std={
                    name: float(np.sqrt(np.mean([getattr(one, std) ** 2 for one in group])))
                    for name, std in _STDS.items()
                },
                p95={name: float(np.percentile(np.abs(v), 95)) for name, v in values.items()},
            )
        )
    return rows


_BACK = 0.7
_OVER_IN_A_ROW, _BACK_IN_A_ROW = 2, 3


class GapLimits:
    """Watches each quantity of `ALARM_LIMITS_PER_S` at one horizon with hysteresis.

    Two samples in a row beyond the limit raise the alarm, three within 70 % of it end it: a gap
    that plays about its limit is told once. Where states are unsure limits are wider.
    """

    def __init__(self) -> None:
        self._streak = dict.fromkeys(ALARM_LIMITS_PER_S, 0)
        self._over = dict.fromkeys(ALARM_LIMITS_PER_S, False)

    def handle(self, sample: GapSample) -> list[GapAlarm]:
        """Take one sample; other horizons and gaps of estimated commands say nothing here."""
        if abs(sample.horizon_s - ALARM_HORIZON_S) > 1e-9 or not sample.independent:
            return []
        alarms = []
        for name, limit in sample.limits.items():
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
