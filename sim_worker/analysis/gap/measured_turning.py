"""The model driven by a car's measured steering and speed, and its turning held against the gyro.

Where people drive no commands are recorded, yet what their hands did often is. The model takes no
yaw rate and no position, so that how it turns says something of its own. Before, clocks are put
together and the gyro's bias and the steering's zero are found; what the drive says beyond the
vehicle file is told beside. Each second is predicted from the rest of the drive alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Stamps
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.shifted_fit import LEAST_S, LONGEST_SHIFT_S, ShiftedFit, shifted_fit
from foretwin.sim_worker.analysis.gap.clock_offsets import (
    ClockOffset,
    on_tick,
    position_offset,
    speed_offset,
    turning_offset,
)
from foretwin.sim_worker.analysis.gap.findings import GAIN_LEFT_OPEN
from foretwin.sim_worker.analysis.gap.free_run import FreeRunner, start_states, tire_angles
from foretwin.sim_worker.analysis.gap.measured_motion import MeasuredMotion
from foretwin.sim_worker.analysis.gap.turning_priors import (
    gyro_at_standstill,
    response_std_s,
    steering_prior,
)
from foretwin.sim_worker.analysis.motion_record import PERIOD_S, MotionRecord
from foretwin.sim_worker.vehicle.lag import without_lags

_ROLLS_MPS = 1.0
_RUN = round(2.0 / PERIOD_S)
_SECOND = round(1.0 / PERIOD_S)
"""Of a run the last second is compared: where it began is forgotten by then."""
_SHARE = 0.95
_LEAST_SECONDS = 20
_NO_CLOCK = (
    "how late the steering is stamped cannot be told from how the car turns: it is by "
    f"{LONGEST_SHIFT_S:g} s or more, or the stretches that have all are too short"
)


class MeasuredDrive(NamedTuple):
    """What a model is driven by where no commands were recorded, (N,) on the gyro's clock.

    Tyre angles are without the steering's zero as the drive tells it.
    """

    tire_rad: Array
    speed_mps: Array


class NotHeld(NamedTuple):
    """Says why the model's turning is held against no gyro."""

    why: str


class TurningGap(NamedTuple):
    """The model at measured steering and speed against the gyro, second by second (K,).

    `gain` is how much the car turns where the model turns by one; with `steering_offset_rad`, at
    the tyres, it is what the drive says beside the vehicle file. `error_radps` are means over
    seconds, model minus gyro, all that is fitted without the stretch that holds the second;
    `half_width_radps` is half of the interval that 95 % of such errors are said to be within.
    """

    stamp_ns: Stamps
    error_radps: Array
    half_width_radps: Array
    file_error_radps: Array
    """With the vehicle file's steering as it is: clocks and gyro alone are mended."""
    drive: MeasuredDrive
    steering_clock: ClockOffset
    speed_clock: ClockOffset | None
    """None where the drive does not tell it: then it is that of the steering."""
    position_clock: ClockOffset | None
    """None where speed or positions do not tell it."""
    response_std_s: float
    """What the vehicle file leaves open of how late its model turns in: the steering's clock is
    told given its tyres and inertia."""
    gyro_bias_radps: float
    gyro_bias_half_radps: float
    """Half of a 95 % interval, as that of the gain and of the steering's zero."""
    gain: float
    gain_half: float
    steering_offset_rad: float
    steering_offset_half_rad: float

    @property
    def full_width_radps(self) -> float:
        """Width of the interval, in the median over the seconds."""
        return 2.0 * float(np.median(self.half_width_radps))

    @property
    def departure(self) -> str:
        """What the car's turning says against the model, empty where parameters leave it open."""
        if abs(self.gain - 1.0) <= GAIN_LEFT_OPEN + self.gain_half:
            return ""
        return (
            f"the car turns {self.gain:.2f} times as the model does at the measured steering: the "
            "model's steering ratio, wheelbase or tyres are wrong, or the car's steering sensor"
        )

    @property
    def within(self) -> float:
        """Share of the seconds whose error is within its interval."""
        return float(np.mean(np.abs(self.error_radps) <= self.half_width_radps))


def turning_gap(record: MotionRecord, vehicle: VehicleParameters) -> TurningGap | NotHeld:
    """Drive the model by measured steering and speed and compare its turning with the gyro."""
    tire, gyro = tire_angles(record, vehicle).measured_rad, record.yaw_rate_radps
    if not (np.isfinite(tire) & np.isfinite(gyro) & np.isfinite(record.speed_mps)).any():
        return NotHeld("steering, speed and gyro were not all measured")
    runner = FreeRunner(without_lags(vehicle))
    speed_clock = speed_offset(record)
    clock = speed_clock or ClockOffset(0.0, 0.0)
    model = turning_of_model(runner, record, tire_rad=tire, late_s=(clock.late_s, clock.late_s))
    more = turning_offset(gyro, model)
    if more is None:
        both_s = PERIOD_S * np.count_nonzero(np.isfinite(gyro) & np.isfinite(model))
        return NotHeld(_too_short(both_s) if both_s < LEAST_S else _NO_CLOCK)
    # The first run was on the speed's clock; on its own the steering may be earlier or later.
    clock = ClockOffset(clock.late_s + more.late_s, more.std_s)
    by_speed_s = clock.late_s if speed_clock is None else speed_clock.late_s
    model = turning_of_model(runner, record, tire_rad=tire, late_s=(clock.late_s, by_speed_s))
    speed = on_tick(record.speed_mps, -by_speed_s)
    columns = np.stack([model, speed / vehicle.wheelbase_m.value, np.ones(len(model))], axis=1)
    bias, bias_std = gyro_at_standstill(record)
    fit = shifted_fit(
        gyro,
        columns,
        period_s=PERIOD_S,
        around=np.array([1.0, 0.0, bias]),
        prior_std=np.array([*steering_prior(vehicle), bias_std]),
        shift_prior_s=clock.std_s,
    )
    if fit is None:
        return NotHeld(_NO_CLOCK)
    steered = as_commands(tire, clock.late_s) + fit.sizes[1]
    typical_mps = float(np.nanmedian(speed[fit.block >= 0]))
    drive = MeasuredDrive(steered, speed)
    return _told(
        record, columns, fit, drive, clock, speed_clock, response_std_s(vehicle, typical_mps)
    )


def as_commands(tire_rad: Array, late_s: float) -> Array:
    """Return measured tyre angles (N,) as what a model is told, which turns so far in a tick."""
    return on_tick(tire_rad, -late_s - PERIOD_S)


def turning_of_model(
    runner: FreeRunner, record: MotionRecord, *, tire_rad: Array, late_s: tuple[float, float]
) -> Array:
    """Return the yaw rates (N,) of the model that steers and rolls as measured, NaN where not.

    `late_s` is by how much steering and speed are stamped late. Runs begin each second as the car
    moves and last two, of which the second counts.
    """
    tire, speed = as_commands(tire_rad, late_s[0]), on_tick(record.speed_mps, -late_s[1])
    count = len(speed)
    known = np.isfinite(tire) & np.isfinite(speed) & (speed > _ROLLS_MPS)
    starts = np.arange(0, count - _RUN, _SECOND)
    unknown = np.concatenate([[0], np.cumsum(~known)])
    starts = starts[unknown[starts + _RUN + 1] == unknown[starts]]
    found = np.full(count, np.nan)
    if not len(starts):
        return found
    zero, begun_mps = np.zeros(len(starts)), speed[starts]
    rate = begun_mps * np.tan(tire[starts]) / runner.vehicle.wheelbase_m.value
    begun = MeasuredMotion(zero, zero, zero, begun_mps, rate, zero, zero, zero, zero)
    runs = runner.run(
        states=start_states(runner.vehicle, begun, tire_rad=tire[starts]),
        starts=starts,
        steps=_RUN,
        accel_mps2=np.zeros(count),
        tire_rad=tire,
        hold_speed_mps=speed,
        delayed=False,
    )
    tail = np.arange(_RUN - _SECOND + 1, _RUN + 1)
    found[starts[:, None] + tail] = runs[:, tail, 5]
    return found


def _told(
    record: MotionRecord,
    columns: Array,
    fit: ShiftedFit,
    drive: MeasuredDrive,
    clock: ClockOffset,
    speed_clock: ClockOffset | None,
    response_std_s: float,
) -> TurningGap | NotHeld:
    rows = np.stack([on_tick(column, fit.shift_s) for column in columns.T], axis=1)
    slope = -np.gradient(rows @ fit.sizes) / PERIOD_S
    gyro = record.yaw_rate_radps
    usable = (fit.block >= 0) & np.isfinite(rows).all(axis=1) & np.isfinite(slope)
    starts = np.arange(0, len(gyro) - _SECOND + 1, _SECOND)
    sums = np.concatenate([[0], np.cumsum(usable)])
    starts = starts[sums[starts + _SECOND] - sums[starts] == _SECOND]
    starts = starts[fit.block[starts] == fit.block[starts + _SECOND - 1]]
    if len(starts) < _LEAST_SECONDS:
        return NotHeld(_too_short(len(starts)))

    def mean(values: Array) -> Array:
        return np.asarray(values[starts[:, None] + np.arange(_SECOND)].mean(axis=1))

    block = fit.block[starts]
    design = np.stack([mean(column) for column in np.column_stack([rows, slope]).T], axis=1)
    theta = fit.without[block]
    theta = np.column_stack([theta[:, :-1], theta[:, -1] - fit.shift_s])
    seen = mean(gyro)
    said = np.einsum("kc,kc->k", design, theta)
    error = said - seen
    parameters = np.einsum("kc,cd,kd->k", design, fit.covariance, design)
    turning = np.abs(said - fit.sizes[2])
    half = np.empty(len(error))
    for number in np.unique(block):
        mine = block == number
        half[mine] = _half_width(
            error[~mine], turning[~mine], parameters[~mine], turning[mine], parameters[mine]
        )
    return TurningGap(
        stamp_ns=record.stamp_ns[starts + _SECOND // 2],
        error_radps=error,
        half_width_radps=half,
        file_error_radps=design[:, 0] + fit.sizes[2] - seen,
        drive=drive,
        steering_clock=clock,
        speed_clock=speed_clock,
        position_clock=None if speed_clock is None else position_offset(record, speed_clock),
        response_std_s=response_std_s,
        gyro_bias_radps=float(fit.sizes[2]),
        gyro_bias_half_radps=float(fit.half_widths[2]),
        gain=float(fit.sizes[0]),
        gain_half=float(fit.half_widths[0]),
        steering_offset_rad=float(fit.sizes[1]),
        steering_offset_half_rad=float(fit.half_widths[1]),
    )


def _half_width(
    error: Array, turning: Array, parameters: Array, now_turning: Array, now_parameters: Array
) -> Array:
    """Return half of the 95 % interval for seconds, from the errors of other seconds.

    The spread grows with the turning; a factor makes 95 % of the others hold (split conformal
    prediction with a scale: Lei et al. 2018).
    """
    square = np.maximum(error**2 - parameters, 0.0)
    grows = np.column_stack([np.ones(len(error)), turning**2])
    floor = 0.25 * float(np.mean(square))
    line, *_ = np.linalg.lstsq(grows, square, rcond=None)

    def scale(turns: Array, unsure: Array) -> Array:
        spread = np.maximum(line[0], floor) + max(line[1], 0.0) * turns**2
        return np.asarray(np.sqrt(spread + unsure))

    parts = np.sort(np.abs(error) / scale(turning, parameters))
    rank = min(int(np.ceil(_SHARE * (len(parts) + 1))), len(parts)) - 1
    return np.asarray(parts[rank] * scale(now_turning, now_parameters))


def _too_short(known_s: float) -> str:
    together = f"are known together for {known_s:.0f} s alone, which is too short"
    return f"steering, speed and gyro of a moving car {together}"
