"""Errors that wander, judged by the Allan variance of long series."""

from __future__ import annotations

import math

import numpy as np
import pytest
from msgspec.structs import replace

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from foretwin.contracts.sensor_drift import Drift, DriftingError
from foretwin.telemetry.standin.car import CarMotion
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.sensors import Sensors

STEP_NS = 100_000_000
STEP_S = STEP_NS * 1e-9
AXES = 2000
"""Independent series: a mean of so many squares is known to 2 / sqrt(AXES), two deviations: 6 %."""
WITHIN = 4.0 * math.sqrt(2.0 / AXES)


def series(drift: Drift, samples: int, seed: int = 1) -> Array:
    error = DriftingError(drift, AXES, np.random.default_rng(seed))
    return np.array([error.at(k * STEP_NS) for k in range(samples)])


def allan_variance(values: Array, samples: int) -> float:
    """Half the mean square of the difference of two neighbouring means over so many samples."""
    first, second = values[:samples].mean(axis=0), values[samples : 2 * samples].mean(axis=0)
    return float(np.mean((second - first) ** 2) / 2.0)


def markov_variance(drift: Drift, tau_s: float) -> float:
    """Of a first-order Gauss-Markov process, from its autocovariance std² exp(-|t| / T)."""
    ratio = drift.time_s / tau_s
    bent = 3.0 - 4.0 * math.exp(-1.0 / ratio) + math.exp(-2.0 / ratio)
    return 2.0 * drift.std**2 * ratio * (1.0 - ratio / 2.0 * bent)


@pytest.mark.parametrize("tau_s", [1.0, 5.0, 20.0])
def test_a_gauss_markov_error_has_its_allan_variance(tau_s: float) -> None:
    drift = Drift(std=1.5, time_s=4.0)
    samples = round(tau_s / STEP_S)
    found = allan_variance(series(drift, 2 * samples), samples)

    # Means of samples, in place of those of the time between: less than 1 % at these spans.
    assert found == pytest.approx(markov_variance(drift, tau_s), rel=WITHIN + 0.01)


def test_a_walks_allan_deviation_grows_with_the_root_of_time() -> None:
    drift = Drift(walk_per_sqrt_s=0.3)
    values = series(drift, 400)
    found = [allan_variance(values, round(tau_s / STEP_S)) for tau_s in (2.0, 20.0)]

    assert found == pytest.approx([0.3**2 * 2.0 / 3.0, 0.3**2 * 20.0 / 3.0], rel=WITHIN + 0.01)
    slope = 0.5 * math.log10(found[1] / found[0])
    assert slope == pytest.approx(0.5, abs=WITHIN / math.log(10.0))


def test_it_is_as_wide_at_the_first_sample_as_later_whatever_the_spacing() -> None:
    drift = Drift(std=2.0, time_s=10.0)
    error = DriftingError(drift, AXES, np.random.default_rng(2))
    first, soon, late = (error.at(stamp_ns) for stamp_ns in (5, 5_000_000_005, 500_000_000_000))

    assert [one.var() for one in (first, soon, late)] == pytest.approx([4.0] * 3, rel=WITHIN)
    assert np.mean(first * soon) == pytest.approx(4.0 * math.exp(-0.5), rel=2 * WITHIN)
    assert np.mean(first * late) == pytest.approx(0.0, abs=4.0 * WITHIN)


def test_a_stamp_that_does_not_advance_leaves_it_as_it_is() -> None:
    error = DriftingError(Drift(std=1.0, walk_per_sqrt_s=1.0), 3, np.random.default_rng(3))
    error.at(0)
    now = error.at(STEP_NS)

    assert error.at(STEP_NS).tolist() == now.tolist()
    assert error.at(0).tolist() == now.tolist()


def test_without_a_drift_nothing_is_added_and_nothing_drawn() -> None:
    random = np.random.default_rng(4)
    error = DriftingError(Drift(), 2, random)

    assert [error.at(k * STEP_NS).tolist() for k in range(3)] == [[0.0, 0.0]] * 3
    assert random.random() == np.random.default_rng(4).random()


@pytest.mark.parametrize(
    "wrong", [{"std": -1.0}, {"time_s": 0.0}, {"walk_per_sqrt_s": math.inf}, {"std": math.nan}]
)
def test_what_is_no_drift_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="finite and not negative, time_s above 0"):
        Drift(**wrong)


def sensors(**changes: Drift) -> Sensors:
    given = read_parameters()
    frame = LocalFrame(GeoPoint(52.5, 13.4))
    return Sensors(replace(given.sensors, **changes), given.car, frame=frame, seed=7)


def test_the_stand_ins_samples_differ_by_the_drift_alone() -> None:
    motion = CarMotion(3.0, 4.0, 0.5, 5.0, 0.0, 0.1, 0.0, 0.2, 0.3, 0.0)
    drift = Drift(std=1000.0)
    plain = sensors()
    fix, sample = plain.gnss(0, motion), plain.imu(0, motion)

    gnss = sensors(gnss_drift=drift)
    drifted = gnss.gnss(0, motion)
    at = [
        local_from_geo(LocalFrame(fix.position), one.position.lat_deg, one.position.lon_deg)
        for one in (fix, drifted)
    ]
    assert np.abs(at[1] - at[0]).min() > 1.0
    assert (drifted.std_m, drifted.position.alt_m) == (fix.std_m, fix.position.alt_m)
    assert gnss.imu(0, motion) == sample

    gyro, accel = (
        sensors(**{name: drift}).imu(0, motion) for name in ("gyro_drift", "accel_drift")
    )
    assert gyro.accel_mps2 == sample.accel_mps2
    assert accel.rate_radps == sample.rate_radps
    assert np.abs(np.subtract(gyro.rate_radps, sample.rate_radps)).min() > 1.0
    assert np.abs(np.subtract(accel.accel_mps2, sample.accel_mps2)).min() > 1.0
