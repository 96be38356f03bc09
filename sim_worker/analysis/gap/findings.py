"""What the pairs of signals of one stretch say: each finding accuses the car or the model."""

from __future__ import annotations

import math
from typing import NamedTuple

from foretwin.contracts.gap import Culprit, Evidence
from foretwin.sim_worker.analysis.gap.consistency import Consistency, Lag
from foretwin.sim_worker.analysis.gap.fitting import DelayedLine, Line
from foretwin.sim_worker.analysis.motion_record import PERIOD_S

_DEGREES = 180.0 / math.pi
GAIN_LEFT_OPEN = 0.2
"""Ratios this far from 1 are beyond what parameters of the right car leave open."""
_SPEED_GAIN = 0.1
_SAME = 0.08
_MPH_MPS = 0.44704
_UNITS = {
    3.6: "sent in kilometres per hour",
    1.0 / 3.6: "metres per second taken for kilometres per hour",
    1.0 / _MPH_MPS: "sent in miles per hour",
    _MPH_MPS: "metres per second taken for miles per hour",
}
"""By the gain that they would make, to a share of `_SAME`: what a wrong speed may be sent in."""
_GYRO_RADPS = 0.045
_OFFSET_RAD, _OFFSET_PM = 0.02, 0.01
_MISSING_MPS2, _FOLLOWS = 0.5, 0.9
"""A right model misses no more than 0.17 m/s²; one whose gain alone is off still follows."""
_WIRE_S, _SLOW_S = 0.3, 0.36
"""Steering by wire takes 0.05 to 0.3 s."""
_LATE_S = 0.1
"""Sensors' stamps and what tyres do on their way to a side force leave as much open."""
_LEAST_EXCITED_S, _SETTLED_S = 0.8, 1.4


_BY_GYRO = {"steering_ratio", "cornering_stiffness", "friction", "inertia", "steering_offset"}
"""What a wrong gyro could show as well."""


class Finding(NamedTuple):
    """One departure: of which of the two, how, and the comparisons that show it."""

    culprit: Culprit
    cause: str
    text: str
    evidence: tuple[Evidence, ...]
    since_ns: int = 0
    """When it began."""
    decided_by: str = ""
    """Name of the comparison that accuses; empty is the first."""

    @property
    def deciding(self) -> Evidence:
        """The comparison that accuses, among others that agree."""
        named = (one for one in self.evidence if one.name == self.decided_by)
        return next(named, self.evidence[0])


def findings_of(seen: Consistency) -> Finding | None:
    """Return the finding that explains the others, None where all agree or too little is known.

    Sensors are judged before actuators, and these before the model: a wrong sensor makes
    whatever is compared with it look wrong.
    """
    found = speed_sensor(seen.speed_by_gnss)
    if found is None and (seen.excited_s >= _SETTLED_S or seen.moved_s >= 2.0):
        found = gyro_sensor(seen.gyro_by_course)
    if found is not None:
        return found
    if seen.excited_s >= _LEAST_EXCITED_S:
        if seen.measured_by_command is None:
            if seen.excited_s < _SETTLED_S:
                return None
            found = _degrees_without_commands(seen) or _model_without_commands(seen)
        else:
            found = _actuator(seen, seen.measured_by_command) or _model_turns(seen)
            if found is not None and found.cause in _BY_GYRO and seen.gyro_by_course is None:
                text = "no precise positions confirm the gyro: " + found.text
                found = found._replace(culprit="undecided", text=text)
        return found
    return None


def _beyond(seen: Consistency, line: Line) -> bool:
    """Whether a gain is off by more than parameters leave open; the shorter seen, the surer."""
    stds = 2.0 if seen.excited_s >= _SETTLED_S else 5.0
    return abs(line.gain - 1.0) > GAIN_LEFT_OPEN + stds * line.gain_std


def _evidence(name: str, value: float, expected: float, std: float, text: str) -> Evidence:
    return Evidence(name=name, value=value, expected=expected, std=std, text=text)


def _of(name: str, line: Line, text: str) -> Evidence:
    return _evidence(name, line.gain, 1.0, line.gain_std, text)


def _offset(name: str, line: Line, text: str) -> Evidence:
    return _evidence(name, line.offset, 0.0, line.offset_std, text)


def speed_sensor(speed: Line | None) -> Finding | None:
    """Return what is wrong with the measured speed, None where positions do not contradict it."""
    if speed is None or abs(speed.gain - 1.0) <= _SPEED_GAIN + 3.0 * speed.gain_std:
        return None
    said = f"wheel speed is {speed.gain:.2f} times the speed of the positions"
    unit = [f" ({unit}?)" for gain, unit in _UNITS.items() if abs(speed.gain / gain - 1.0) < _SAME]
    text = "".join([f"the car's speed sensor disagrees with its positions: {said}", *unit])
    return Finding("vehicle", "speed_sensor", text, (_of("speed_by_gnss", speed, said),))


def gyro_sensor(gyro: Line | None) -> Finding | None:
    """Return what is wrong with the gyro, None where positions do not contradict it."""
    if gyro is None:
        return None
    if gyro.gain_std < 0.15 and abs(gyro.gain - 1.0) > GAIN_LEFT_OPEN + 2.5 * gyro.gain_std:
        said = f"the gyro shows {gyro.gain:.2f} of the turn of the course over ground"
        said += " (its sign is wrong?)" if gyro.gain < 0.0 else ""
        text = f"the car's gyro disagrees with its positions: {said}"
        return Finding("vehicle", "gyro_sensor", text, (_of("gyro_by_course", gyro, said),))
    if abs(gyro.offset) > _GYRO_RADPS + 3.0 * gyro.offset_std:
        said = f"the gyro shows {gyro.offset:+z.3f} rad/s more than the course over ground turns"
        text = f"the car's gyro disagrees with its positions: {said}"
        return Finding("vehicle", "gyro_sensor", text, (_offset("gyro_offset", gyro, said),))
    return None


def _degrees_without_commands(seen: Consistency) -> Finding | None:
    line = seen.motion_by_angle
    if line is None or line.explained < 0.8 or not 0.6 < line.gain * _DEGREES < 1.6:
        return None
    said = f"the car turns {line.gain:.4f} of what its measured steering says: 1/57.3 is degrees"
    text = f"steering is sent in degrees where radians are declared: {said}"
    return Finding("vehicle", "steering_in_degrees", text, (_of("motion_by_angle", line, said),))


def _model_without_commands(seen: Consistency) -> Finding | None:
    found = _model_turns(seen)
    if found is None:
        return None
    text = "no commands are recorded, so car and model cannot be told apart: " + found.text
    return found._replace(culprit="undecided", text=text)


def _actuator(seen: Consistency, pair: DelayedLine) -> Finding | None:
    line, by_command = pair.line, seen.motion_by_command
    own = f"measured steering is {line.gain:.3f} times the commanded, {pair.delay_s:.2f} s later"
    evidence = [_of("measured_by_command", line, own)]
    if by_command is not None:
        said = f"the car turns {by_command.gain:.2f} times as the model does under its commands"
        evidence.append(_of("motion_by_command", by_command, said))

    def accuse(cause: str, text: str, *more: Evidence) -> Finding:
        by = more[0].name if more else ""
        return Finding("vehicle", cause, f"{text}: {own}", (*evidence, *more), decided_by=by)

    if not math.isnan(pair.saturated_at):
        return accuse(
            "saturated_steering",
            f"the car's steering stops at {math.degrees(pair.saturated_at):.1f}° of the tyres "
            "while the commands go on",
        )
    if line.explained < 0.8 or line.gain_std > 0.1 * abs(line.gain):
        return None
    for ratio in (_DEGREES, 1.0 / _DEGREES):
        if 0.7 < abs(line.gain) / ratio < 1.4:
            sent = "measured steering" if ratio > 1.0 else "the steering command"
            return accuse("steering_in_degrees", f"{sent} is in degrees where radians are declared")
    if line.gain < -0.3:
        return accuse("steering_sign", "the car steers to the other side than it is told")
    if _beyond(seen, line):
        return accuse("steering_gain", "the car does not steer as much as it is told")
    if seen.excited_s < _SETTLED_S:
        return None
    if pair.delay_s > _SLOW_S:
        said = f"measured steering comes {pair.delay_s:.2f} s after the command"
        late = _evidence("command_delay_s", pair.delay_s, _WIRE_S, PERIOD_S, said)
        return accuse("steering_delay", "the car steers late", late)
    if abs(line.offset) > _OFFSET_RAD + 3.0 * line.offset_std:
        beside = _offset(
            "measured_offset", line, f"{math.degrees(line.offset):+z.1f}° at the tyres"
        )
        if by_command is not None and abs(by_command.offset) < _OFFSET_PM:
            told = "the steering sensor is off while the motion is as told"
            return accuse("offset_sensor", told, beside)
        return accuse("steering_offset", "the car steers beside what it is told", beside)
    return None


def _model_turns(seen: Consistency) -> Finding | None:
    line, model = seen.motion_by_measured, seen.model_by_command
    car = seen.measured_by_command
    evidence: list[Evidence] = []
    if car is not None:
        said = f"measured steering is {car.line.gain:.2f} times the commanded: the car obeys"
        evidence.append(_of("measured_by_command", car.line, said))

    def accuse(cause: str, text: str, more: Evidence) -> Finding:
        return Finding("model", cause, text, (more, *evidence))

    obeys = (
        car is not None and car.line.explained > 0.8 and abs(car.line.gain - 1.0) < GAIN_LEFT_OPEN
    )
    if obeys and car is not None and model is not None:
        said = f"the model's tyres do {model.line.gain:.2f} of the command"
        if not math.isnan(seen.model_stops_at_rad):
            at = f"at {math.degrees(seen.model_stops_at_rad):.1f}°"
            text = f"the model's steering stops {at} where the car's goes on: {said}"
            return accuse("steering_limit", text, _of("model_by_command", model.line, said))
        late = model.delay_s - car.delay_s
        if late > 0.12 and model.delay_s > _SLOW_S and model.line.explained > 0.8:
            said = f"the model steers {model.delay_s:.2f} s after the command, the car "
            said += f"{car.delay_s:.2f} s"
            more = _evidence("model_delay_s", model.delay_s, car.delay_s, PERIOD_S, said)
            return accuse("steering_delay", f"the model steers too late: {said}", more)
    if line is None or (car is not None and not obeys) or not confirmed(seen.gyro_by_course):
        return None
    hard = seen.motion_by_measured_hard
    lag = seen.motion_lag or Lag(0.0, 0.0)
    said = f"the car turns {line.gain:.2f} times as the model does at the measured steering"
    bent = hard is not None and hard.gain_std < 0.15
    if seen.missing_mps2 > _MISSING_MPS2 and hard is not None and line.explained < _FOLLOWS:
        text = f"the model's tyres do not carry what the car's do: {seen.missing_mps2:.1f} m/s² of "
        text += f"lateral acceleration apart, {said}"
        apart = f"{seen.missing_mps2:.2f} m/s² between model and car"
        more = _evidence("missing_mps2", seen.missing_mps2, 0.0, 0.15, apart)
        return accuse("friction", text, more)
    if line.gain_std > 0.1 or line.explained < 0.6:
        return None
    if _beyond(seen, line):
        # Without commands to hold it against, the car's own steering sensor may be off as well.
        whose = "the model's " if obeys else "the car's steering sensor or the model's "
        cause, why = "steering_ratio", "steering ratio or wheelbase"
        if lag.seconds >= 0.06 or (bent and hard is not None and abs(hard.gain - line.gain) > 0.25):
            cause, why = "cornering_stiffness", "cornering stiffness or friction"
        text = (
            f"{said}{', though the car obeys its commands' if obeys else ''}: {whose}{why} is wrong"
        )
        return accuse(cause, text, _of("motion_by_measured", line, said))
    if seen.excited_s < _SETTLED_S:
        return None
    if lag.seconds > _LATE_S + 3.0 * lag.std_s:
        said = f"the model's turning lags {lag.seconds:.2f} s behind the car's"
        more = _evidence("motion_lag_s", lag.seconds, 0.0, lag.std_s, said)
        clocks = "or steering and gyro are stamped by clocks that far apart"
        return accuse("inertia", f"{said}: its yaw inertia or tyres are wrong, {clocks}", more)
    if abs(line.offset) > _OFFSET_PM + 3.0 * line.offset_std:
        said = f"the model's curvature is off by {-line.offset:+z.4f} 1/m"
        text = f"{said}: its steering offset or the car's steering sensor is wrong"
        if obeys:
            text = f"{said}, though car and command agree: the model's steering offset is wrong"
        return accuse("steering_offset", text, _offset("curvature_offset", line, said))
    return None


def confirmed(by_positions: Line | None) -> bool:
    """Whether positions show that a sensor measures what it should; without any it may."""
    if by_positions is None:
        return True
    return abs(by_positions.gain - 1.0) + by_positions.gain_std < GAIN_LEFT_OPEN + 0.05
