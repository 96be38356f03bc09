"""What is taken of an identification, and the file that holds it."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.tuning import Identification, ParameterEstimate
from foretwin.sim_worker.analysis.identify.acceptance import (
    accepted,
    doubted,
    is_acceptable,
    judged,
    vehicle_toml,
)
from foretwin.sim_worker.analysis.identify.window import UNDERSTEER_NAME
from foretwin.sim_worker.vehicle.parameters import (
    bundled_vehicles,
    load_vehicle,
    scale_of,
    understeer_gradient,
)
from foretwin.sim_worker.vehicle.plausible import PLAUSIBLE


def told(name: str, value: float, half: float, reason: str = "") -> Identification:
    found = ParameterEstimate(
        name=name, value=value, low=value - half, high=value + half, reason=reason
    )
    return Identification(vehicle_id="car", from_stamp_ns=0, stamp_ns=60, estimates=(found,))


def test_a_value_without_a_reason_against_it_is_taken() -> None:
    vehicle, changes = accepted(told("steering_ratio", 15.3, 0.1), load_vehicle())
    assert vehicle.steering_ratio.value == 15.3
    assert vehicle.steering_ratio.std == pytest.approx(0.1 / 1.96)
    (change,) = changes
    assert (change.name, change.before, change.origin) == ("steering_ratio", 16.0, "identified")


@pytest.mark.parametrize(
    "given",
    [
        told("steering_ratio", 15.3, 0.1, reason="nearly straight"),
        told("drag_npv2", -0.3, 0.1),
        told(UNDERSTEER_NAME, -0.5, 0.1),
    ],
)
def test_what_speaks_against_itself_is_left(given: Identification) -> None:
    assert accepted(given, load_vehicle()) == (load_vehicle(), ())


def test_what_no_vehicle_has_is_said_and_brings_down_what_was_told_along_with_it() -> None:
    """A gyro whose sign is wrong turns ratio and offset around."""
    several = (
        told("steering_ratio", -15.4, 0.1),
        told("steering_offset_rad", -0.004, 1e-4),
        told(UNDERSTEER_NAME, 1e-4, 1e-4),
        told("drive_gain", 0.95, 0.01),
    )
    given = msgspec.structs.replace(
        several[0], estimates=tuple(one.estimates[0] for one in several)
    )
    ratio, offset, gradient, gain = judged(given, load_vehicle()).estimates
    assert ratio.reason.startswith("steering_ratio -15.4 is implausible; it must be 1 to 40; ")
    assert offset.reason == gradient.reason
    assert offset.reason == "it was told along with steering_ratio, which is wrong"
    assert (ratio.value, offset.value, gain.reason) == (-15.4, -0.004, "")
    assert [change.name for change in accepted(given, load_vehicle())[1]] == ["drive_gain"]


@pytest.mark.parametrize(
    ("sensor", "left"),
    [("speed_sensor", {"steering_lag_s"}), ("gyro_sensor", {"steering_lag_s", "drive_gain"})],
)
def test_nothing_is_taken_that_rests_on_a_sensor_in_doubt(sensor: str, left: set[str]) -> None:
    names = ("steering_ratio", "wheelbase_m", "steering_lag_s", "drive_gain")
    ratio = told("steering_ratio", 15.4, 0.1)
    several = tuple(
        msgspec.structs.replace(ratio.estimates[0], name=name, value=1.0) for name in names
    )
    silent = msgspec.structs.replace(several[1], value=None, reason="no tyre angle was measured")
    given = msgspec.structs.replace(ratio, estimates=(several[0], silent, *several[2:]))
    found = doubted(given, {sensor: "it disagrees"}).estimates
    assert {one.name for one in found if is_acceptable(one)} == left
    assert found[0].reason == "it disagrees"
    assert found[1].reason == "no tyre angle was measured"
    assert doubted(given, {}) == given


@pytest.mark.parametrize(("half", "wrong"), [(5.0, True), (40.0, False)])
def test_a_wide_interval_is_no_vehicles_where_all_of_it_is_not(half: float, wrong: bool) -> None:
    given = told("steering_ratio", 54.0, half, reason="the interval is wide")
    (found,) = judged(given, load_vehicle()).estimates
    assert ("implausible" in found.reason) is wrong
    assert found.reason


def test_what_is_pinned_stays() -> None:
    given = told("steering_ratio", 15.3, 0.1)
    assert accepted(given, load_vehicle(), pinned={"steering_ratio"})[1] == ()


@pytest.mark.parametrize("gradient", [0.003, -0.001, 0.0])
def test_an_understeer_gradient_becomes_front_stiffness(gradient: float) -> None:
    vehicle, (change,) = accepted(told(UNDERSTEER_NAME, gradient, 1e-4), load_vehicle())
    assert change.name == "front_cornering_stiffness_npr"
    assert understeer_gradient(vehicle) == pytest.approx(gradient, abs=1e-9)


@pytest.mark.parametrize("name", bundled_vehicles())
def test_a_written_vehicle_reads_back_the_same(name: str, tmp_path: Path) -> None:
    file = tmp_path / "vehicle.toml"
    was, scale = load_vehicle(name), scale_of(name)
    file.write_text(vehicle_toml(was, scale=scale), encoding="utf-8")
    assert scale_of(file) == scale
    read = load_vehicle(file)
    if scale == 1.0:
        assert read == was
    for field in PLAUSIBLE:
        assert getattr(read, field).value == pytest.approx(getattr(was, field).value, rel=1e-12)
