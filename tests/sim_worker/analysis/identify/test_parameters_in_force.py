"""What may be set by hand: plausible numbers of a road vehicle, and nothing else."""

from __future__ import annotations

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.errors import UserError
from foretwin.contracts.tuning import Identification, ParameterEstimate
from foretwin.contracts.vehicle import Parameter, VehicleParameters
from foretwin.sim_worker.analysis.identify.parameters_in_force import ParametersInForce
from foretwin.sim_worker.vehicle.parameters import bundled_vehicles, load_vehicle
from foretwin.sim_worker.vehicle.plausible import PLAUSIBLE

NAMES = [
    field.name for field in msgspec.structs.fields(VehicleParameters) if field.type is Parameter
]


def in_force() -> ParametersInForce:
    return ParametersInForce(vehicle=load_vehicle(), vehicle_id="car")


def test_every_parameter_has_plausible_values_and_every_bundled_vehicle_has_them() -> None:
    assert sorted(PLAUSIBLE) == sorted(NAMES)
    for vehicle in map(load_vehicle, bundled_vehicles()):
        for name, (low, high) in PLAUSIBLE.items():
            if vehicle.name in ("f1tenth", "autodrive_nigel"):
                continue  # plausible in their own size
            assert low <= getattr(vehicle, name).value <= high, (vehicle.name, name)


@given(name=st.sampled_from(NAMES), value=st.floats())
def test_a_number_counts_or_is_refused_in_one_line(name: str, value: float) -> None:
    parameters = in_force()
    low, high = PLAUSIBLE[name]
    try:
        change = parameters.set(name, value, stamp_ns=7)
    except UserError:
        # A centre of gravity ahead of the front axle is no vehicle either.
        assert not low <= value <= high or value == 0.0 or "wheelbase" in name or "cog" in name
        assert parameters.vehicle == load_vehicle()
        return
    assert (change.value, change.origin, change.pinned) == (value, "set", True)
    assert getattr(parameters.vehicle, name).value == value
    back = parameters.rollback(name, stamp_ns=8)
    assert back.value == getattr(load_vehicle(), name).value
    assert parameters.vehicle == load_vehicle()


def test_a_refusal_says_what_would_be_right() -> None:
    with pytest.raises(UserError, match=r"steering_ratio 150 is implausible; .* 1 to 40"):
        in_force().set("steering_ratio", 150.0, stamp_ns=0)
    with pytest.raises(UserError, match="wheels is no parameter"):
        in_force().set("wheels", 4.0, stamp_ns=0)


def test_an_implausible_estimate_is_not_taken() -> None:
    found = ParameterEstimate(name="drive_gain", value=7.0, low=6.9, high=7.1)
    told = Identification(vehicle_id="car", from_stamp_ns=0, stamp_ns=1, estimates=(found,))
    parameters = in_force()
    assert parameters.take(told) == ()
    assert parameters.vehicle == load_vehicle()
